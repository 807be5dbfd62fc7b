import pytest

from executive.language.understand import understand
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world


@pytest.fixture(scope="session")
def worlds():
    return {name: load_knowledge(load_world(name).knowledge_path) for name in ("flat", "shop")}


@pytest.fixture(scope="session")
def meant(parser, worlds):
    def understood(sentence, world="flat", **options):
        return understand(sentence, parser=parser, knowledge=worlds[world], require_wake=False, **options)

    return understood
