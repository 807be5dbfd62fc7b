"""The second look: words that forbid, limit, share or time, and what of a mission carries them."""

from pathlib import Path

import pytest

from executive.words.knowledge import load_knowledge
from executive.words.second_look import second_look
from executive.words.steps import steps_from_yaml
from tests.tables import table


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
