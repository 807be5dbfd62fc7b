"""Sentences for several robots."""

import pytest

from executive.language.several_robots import understand_for_robots
from executive.language.understand import Status, understand
from tests.tables import table

ROBOTS = ("alice", "bob")


@pytest.fixture
def said(parser, knowledge):
    def meaning(sentence, robots=ROBOTS, **options):
        return understand_for_robots(sentence, robots=robots, parser=parser, knowledge=knowledge, **options)

    return meaning


@pytest.mark.parametrize(*table(__file__, "parts"))
def test_each_part_has_its_robot_under_the_name_of_the_run(said, sentence, robots):
    assert [getattr(part.robot, "value", part.robot) for part in said(sentence).parts] == robots


@pytest.mark.parametrize(*table(__file__, "waits"))
def test_a_part_waits_where_that_is_said(said, sentence, after):
    assert [[*part.after] for part in said(sentence, robots=("Alice", "Bob", "Eve")).parts] == after


def test_next_robot_takes_an_object_from_where_the_first_put_it(said):
    first, second = said("Alice, put the beer on the kitchen table and let Bob bring it to me").parts
    assert second.after == (0,)
    assert str(second.meaning.commands[0]) == "Take [Nothing] to [kitchen table] and do [grasp] to [beer]"
    assert first.meaning.commands[-1].goal == second.meaning.commands[0].goal


def test_the_speaker_stands_by_the_robot_that_is_spoken_to(said):
    assert [part.speaker_by for part in said("Hey Alice, let Bob come here").parts] == ["alice"]
    assert [part.speaker_by for part in said("Hey everyone, come here").parts] == [None]


@pytest.mark.parametrize(*table(__file__, "refused"))
def test_request_that_no_robot_can_do_is_refused(said, sentence, reason):
    meant = said(sentence)
    assert (meant.status is Status.OK, meant.parts, reason in meant.reason) == (False, (), True), meant.reason


def test_reason_lists_the_names_when_one_must_be_said(said):
    meant = said("go to the kitchen", require_wake=True)
    assert meant.status is Status.NOT_ADDRESSED and '"Hey Alice" or "Hey Bob"' in meant.reason
    assert said("Hey everyone, go to the kitchen", require_wake=True).status is Status.OK


@pytest.mark.parametrize("sentence", ["Hey Alice, fetch me a beer", "bring it to Bob", "everyone, come here", "", "go"])
def test_with_one_robot_a_sentence_means_what_it_always_does(said, parser, knowledge, sentence):
    alone = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False, robot_name="Alice")
    meant = said(sentence, robots=("Alice",))
    assert (meant.status, meant.reason) == (alone.status, alone.reason)
    assert [part.meaning for part in meant.parts] == [alone] * (alone.status is Status.OK)


def test_a_robot_with_the_name_of_a_person_can_be_brought_things(said, knowledge):
    person = next(iter(knowledge.people))
    meant = said(f"Hey Alice, bring a beer to {person}", robots=("Alice", person))
    assert [part.robot for part in meant.parts] == ["Alice"]
