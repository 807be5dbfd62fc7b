"""From a sentence to a compiled tree, against loading the parser in the same run."""

import time

from executive.compiler import compile_mission
from executive.knowledge import load_knowledge
from executive.language import load_parser
from executive.mission import mission_from_sentence
from executive.registry import built_in_skills
from plant.worlds.world import load_world

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"


def test_parse_to_compiled_tree(benchmark):
    begun = time.perf_counter()
    parser = load_parser()
    loading_s = time.perf_counter() - begun
    knowledge, registry = load_knowledge(load_world("flat").knowledge_path), built_in_skills()

    def compiled():
        mission = mission_from_sentence(SENTENCE, parser=parser, knowledge=knowledge, require_wake=True)
        return compile_mission(mission, knowledge=knowledge, registry=registry)

    assert benchmark(compiled).commands
    benchmark.extra_info["sentences in the time of loading the parser"] = round(loading_s / benchmark.stats["median"])
