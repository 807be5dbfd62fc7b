"""Sentences with relations, order and size: which object is meant, and where to put one."""

import re

import pytest

from executive.language.understand import understand
from executive.words.command import split_relations
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.executive.language.notation import as_noted, noted
from tests.tables import yaml_beside

FILES = tuple(f"relations_sentences{part}.yaml" for part in ("", "_later", "_last", "_fresh"))
SENTENCES = [
    (world, text, expected)
    for file in FILES
    for world, rows in yaml_beside(__file__, file).items()
    for text, expected in rows.items()
]
GET = "Take [Nothing] to [{where}] and do [{task}] to [{what}]"
BRING = "Take [{plain}] to [{to}] and do [Nothing] to [Nothing]"
FORMS = {
    "fetch": f"{GET} then {BRING}",
    "carry": f"{GET} then {BRING}",
    "put": f"{GET} then Take [{{plain}}] to [{{to}}] and do [place] to [{{plain}}]",
    "take": GET,
    "find": GET,
    "give": "Take [{plain}] to [{where}] and do [Nothing] to [Nothing]",
    "go": "Take [Nothing] to [{what}] and do [Nothing] to [Nothing]",
}


def commands(lines):
    """The lines of a table with their short forms written out."""

    def full(match):
        what, where, to, *_ = (*match[2].split(" | "), "start", "start")
        task, plain = "find" if match[1] == "find" else "grasp", split_relations(what)[0]
        return FORMS[match[1]].format(what=what, where=where, to=to, task=task, plain=plain)

    return as_noted(re.sub(rf"\b({'|'.join(FORMS)})\(([^()]*)\)", full, line) for line in lines)


@pytest.fixture(scope="module")
def worlds():
    return {name: load_knowledge(load_world(name).knowledge_path) for name in ("flat", "shop", "lab")}


@pytest.mark.parametrize(("world", "sentence", "expected"), SENTENCES, ids=[text for _, text, _ in SENTENCES])
def test_relations_become_those_of_the_command_or_are_refused_by_name(parser, worlds, world, sentence, expected):
    answer = understand(sentence, parser=parser, knowledge=worlds[world], require_wake=False)
    if isinstance(expected, str):
        status, words = expected.split(": ")
        assert (answer.status.value, answer.all_steps) == (status, ())
        assert words in answer.reason
    else:
        assert (answer.reason, noted(answer.all_steps)) == (None, commands(expected))
