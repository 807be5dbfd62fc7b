"""The second look: words that forbid, limit, share or time, and what of a mission carries them."""

import re
from pathlib import Path

import pytest

from executive.language.lexicon import word_list
from executive.words import second_look as module
from executive.words.knowledge import load_knowledge
from executive.words.second_look import second_look
from executive.words.steps import steps_from_yaml
from skills.inputs.yaml_source import read_yaml
from tests.tables import table

CUES = read_yaml(Path(module.__file__).with_name("cues.yaml")).data


@pytest.fixture(scope="module")
def knowledge():
    return load_knowledge(Path(__file__).with_name("test_knowledge_world.yaml"))


@pytest.mark.parametrize(*table(__file__, "lost"))
def test_a_word_that_no_part_of_the_mission_carries_is_named(knowledge, sentence, mission, word):
    assert second_look(sentence, steps_from_yaml(mission), knowledge) == word


@pytest.mark.parametrize(*table(__file__, "carried"))
def test_nothing_is_named_where_all_words_are_carried(knowledge, sentence, mission):
    assert second_look(sentence, steps_from_yaml(mission), knowledge) is None


def test_several_robots_carry_what_each_or_both_of_them_do(knowledge):
    steps = steps_from_yaml(["- {to: kitchen}"])
    assert second_look("both of you go to the kitchen", steps, knowledge) == "both"
    assert second_look("both of you go to the kitchen", steps, knowledge, robots=True) is None


def test_no_word_that_makes_a_note_is_one_that_the_look_must_find():
    cues = re.compile("|".join(f"(?:{row['cue']})" for row in CUES["rows"] if "<" not in row["cue"]), re.IGNORECASE)
    assert [word for word in word_list("noted") if cues.fullmatch(word)] == []
