"""Rules for rooms in sentences: zones around the work, and sentences that are refused."""

import pytest

from executive.language.several_robots import understand_for_robots
from executive.language.understand import Status, understand
from executive.words.steps import Group, lines_of_steps, steps_from_lines
from tests.tables import table


@pytest.fixture
def meant(parser, knowledge):
    """Meaning of a sentence."""
    return lambda text: understand(text, parser=parser, knowledge=knowledge, require_wake=False)


def rules(meaning):
    """Kind, room and speed of each zone, and the goals of the commands below."""
    (group,) = meaning.steps
    assert isinstance(group, Group)
    zones = [[zone.kind.value, zone.place, *([zone.speed] if zone.speed else [])] for zone in group.zones.values()]
    return zones, [command.goal for step in group.steps for command in step.commands]


KEPT_OUT = ["keep_out", "kitchen"]


@pytest.mark.parametrize(*table(__file__, "zones"))
def test_a_rule_for_a_room_is_a_zone_around_the_work_in_order(meant, sentence, zones, goals):
    assert rules(meant(sentence)) == (zones, goals)


def test_a_rule_is_told_in_a_note(meant):
    assert meant("keep out of the kitchen and go to the hall").notes == ("until it is done, keep out of: kitchen",)


def test_a_rule_survives_the_text_form_of_steps(meant):
    steps = meant("keep out of the kitchen and go to the hall").steps
    assert steps_from_lines(lines_of_steps(steps)) == steps


def test_a_rule_holds_around_conditions_as_well(meant):
    (group,) = meant("keep out of the kitchen and if there is a hammer in the workshop, bring it").steps
    assert ([*group.zones], group.steps[0].key) == (["kitchen"], "if")


@pytest.mark.parametrize(*table(__file__, "refused"))
def test_a_sentence_whose_rule_cannot_be_kept_is_refused(meant, sentence, words):
    meaning = meant(sentence)
    assert meaning.status is not Status.OK and words in meaning.reason and meaning.all_steps == ()


@pytest.mark.parametrize(*table(__file__, "no_rules"))
def test_other_sentences_have_no_rule(meant, sentence):
    meaning = meant(sentence)
    assert meaning.status is Status.OK
    assert not any(isinstance(step, Group) for step in meaning.all_steps)


@pytest.mark.parametrize(
    ("text", "robots"),
    [
        ("Do not go into the kitchen. Alice, go to the bedroom. Bob, go to the bedroom.", ["alice", "bob"]),
        ("Alice, keep out of the kitchen and go to the bedroom", ["alice"]),
    ],
)
def test_a_rule_is_for_all_robots_unless_it_stands_behind_a_name(parser, knowledge, text, robots):
    meaning = understand_for_robots(text, robots=("alice", "bob"), parser=parser, knowledge=knowledge)
    assert meaning.status is Status.OK, meaning.reason
    assert [(part.robot, rules(part.meaning)) for part in meaning.parts] == [
        (robot, ([KEPT_OUT], ["bedroom"])) for robot in robots
    ]
