"""Sentences for several robots."""

from __future__ import annotations

import pytest

from executive.language.addressees import RobotChoice
from executive.language.several_robots import understand_for_robots
from executive.language.understand import Status, understand

ROBOTS = ("alice", "bob")


@pytest.fixture
def said(parser, knowledge):
    def meaning(sentence, robots=ROBOTS, **options):
        return understand_for_robots(sentence, robots=robots, parser=parser, knowledge=knowledge, **options)

    return meaning


@pytest.mark.parametrize(
    ("sentence", "robots"),
    [
        # sentence, whose its parts are
        ("Hey Bob, go to the kitchen", ["bob"]),
        ("go to the kitchen", [RobotChoice.ANY]),
        ("Hey everyone, come here", [RobotChoice.ALL]),
        ("you two, come here", [RobotChoice.ALL]),
        ("Hey Alice and Bob, go to the kitchen", ["alice", "bob"]),
        ("Hey Alice, let Bob go to the kitchen", ["bob"]),
        ("Alice, go to the kitchen, and Bob, come here", ["alice", "bob"]),
    ],
)
def test_each_part_has_its_robot_under_the_name_of_the_run(said, sentence, robots):
    assert [part.robot for part in said(sentence).parts] == robots


@pytest.mark.parametrize(
    ("sentence", "after"),
    [
        # sentence, which parts each part waits for
        ("Alice, go to the kitchen, and Bob, go to the kitchen", [(), ()]),
        ("Alice, go to the kitchen, then Bob, go to the kitchen", [(), (0,)]),
        ("Alice, go to the kitchen. When Alice is done, Bob should go to the kitchen", [(), (0,)]),
        ("Alice and Bob, go to the kitchen, then Bob should come here", [(), (), (0, 1)]),
        ("Alice goes to the kitchen and Bob goes to the kitchen, then Eve should come here", [(), (), (0, 1)]),
        ("everyone go to the kitchen, then Bob should come here", [(), (0,)]),
    ],
)
def test_a_part_waits_where_that_is_said(said, sentence, after):
    assert [part.after for part in said(sentence, robots=("Alice", "Bob", "Eve")).parts] == after


def test_next_robot_takes_an_object_from_where_the_first_put_it(said):
    first, second = said("Alice, put the beer on the kitchen table and let Bob bring it to me").parts
    assert second.after == (0,)
    assert str(second.meaning.commands[0]) == "Take [Nothing] to [kitchen table] and do [grasp] to [beer]"
    assert first.meaning.commands[-1].goal == second.meaning.commands[0].goal


def test_the_speaker_stands_by_the_robot_that_is_spoken_to(said):
    assert [part.speaker_by for part in said("Hey Alice, let Bob come here").parts] == ["alice"]
    assert [part.speaker_by for part in said("Hey everyone, come here").parts] == [None]


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        # sentence, what the refusal says
        ("Hey Alice, go to Bob", "Bob is a robot"),
        ("Hey Alice, bring Bob a beer", "Bob is a robot"),
        ("Hey Charlie, bring me a beer", "there is no robot called Charlie; there are Alice and Bob"),
        ("Alice, bring me the beer and let Bob put it on the kitchen table", "Bob cannot take the beer then"),
        ("Alice or Bob should come here", "say which of the robots is meant"),
        ("Bob should not come here", "say only what a robot is to do"),
        ("all three of you, come here", "there are 2 robots, Alice and Bob"),
        ("when Alice is done, Bob should come here", "no earlier task of Alice is in the sentence"),
        ("Hey everyone, bring me the hammer", "cannot all take the one hammer"),
    ],
)
def test_request_that_no_robot_can_do_is_refused(said, sentence, reason):
    meant = said(sentence)
    assert meant.status is not Status.OK
    assert meant.parts == ()
    assert reason in meant.reason


def test_reason_lists_the_names_when_one_must_be_said(said):
    meant = said("go to the kitchen", require_wake=True)
    assert meant.status is Status.NOT_ADDRESSED
    assert '"Hey Alice" or "Hey Bob"' in meant.reason
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
