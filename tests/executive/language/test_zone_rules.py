"""Rules for rooms in sentences: zones around the work, and sentences that are refused."""

import pytest

from executive.language.several_robots import understand_for_robots
from executive.language.understand import Status, understand
from executive.words.steps import Group, lines_of_steps, steps_from_lines


@pytest.fixture
def meant(parser, knowledge):
    """Meaning of a sentence."""
    return lambda text: understand(text, parser=parser, knowledge=knowledge, require_wake=False)


def rules(meaning):
    """Kind, room and speed of each zone, and the goals of the commands below."""
    (group,) = meaning.steps
    assert isinstance(group, Group)
    zones = [(zone.kind.value, zone.place, *([zone.speed] if zone.speed else [])) for zone in group.zones.values()]
    return zones, [command.goal for step in group.steps for command in step.commands]


KEPT_OUT = ("keep_out", "kitchen")
TO_BEDROOM = ["bedroom"]


@pytest.mark.parametrize(
    ("sentence", "zones"),
    [
        ("do not go into the kitchen and go to the bedroom", [KEPT_OUT]),
        ("go to the bedroom, but don't enter the kitchen today", [KEPT_OUT]),
        ("Go to the bedroom. Please stay out of the kitchen.", [KEPT_OUT]),
        ("Stay away from the kitchen. Go to the bedroom.", [KEPT_OUT]),
        ("you must not go into the kitchen, so go to the bedroom", [KEPT_OUT]),
        ("avoid the kitchen and go to the bedroom", [KEPT_OUT]),
        ("go to the bedroom without going through the kitchen", [KEPT_OUT]),
        ("the kitchen is off limits, go to the bedroom", [KEPT_OUT]),
        ("keep out of the kitchen and the workshop and go to the bedroom", [KEPT_OUT, ("keep_out", "workshop")]),
        ("drive slowly in the entrance and go to the bedroom", [("speed_limit", "hall", 0.3)]),
        ("in the hall drive slowly, and go to the bedroom", [("speed_limit", "hall", 0.3)]),
        ("go to the bedroom, no faster than half a metre per second in the hall", [("speed_limit", "hall", 0.5)]),
        (
            "don't drive faster than 40 centimetres per second in the hall, and go to the bedroom",
            [("speed_limit", "hall", 0.4)],
        ),
        ("tell me whether anybody is in the bedroom but keep out of the kitchen", [KEPT_OUT]),
        ("be quiet in the living room and go to the bedroom", [("silent", "living room")]),
        (
            "keep out of the kitchen, drive slowly in the hall and go to the bedroom",
            [KEPT_OUT, ("speed_limit", "hall", 0.3)],
        ),
    ],
)
def test_a_rule_for_a_room_is_a_zone_around_the_work(meant, sentence, zones):
    assert rules(meant(sentence)) == (zones, TO_BEDROOM)


def test_work_before_and_behind_a_rule_is_done_in_order(meant):
    meaning = meant("Go to the hall. Do not go into the kitchen. Go to the bedroom.")
    assert rules(meaning) == ([KEPT_OUT], ["hall", "bedroom"])


def test_a_rule_is_told_in_a_note(meant):
    assert meant("keep out of the kitchen and go to the hall").notes == ("until it is done, keep out of: kitchen",)


def test_a_rule_survives_the_text_form_of_steps(meant):
    steps = meant("keep out of the kitchen and go to the hall").steps
    assert steps_from_lines(lines_of_steps(steps)) == steps


def test_an_object_is_not_expected_in_a_forbidden_room(meant):
    assert rules(meant("bring me a hammer but keep out of the workshop"))[1] == [None, "start"]


def test_a_rule_holds_around_conditions_as_well(meant):
    (group,) = meant("keep out of the kitchen and if there is a hammer in the workshop, bring it").steps
    assert [*group.zones] == ["kitchen"]
    assert group.steps[0].key == "if"


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        ("do not go into the kitchen today", "needs work in the same sentence"),
        ("drive slowly in the hall", "needs work in the same sentence"),
        ("go to the kitchen but do not go into the kitchen", "you keep me out of the kitchen"),
        ("find the coke on the kitchen table and do not enter the kitchen", "you keep me out of the kitchen"),
        ("drive slowly through the hall to the kitchen", "say it in a sentence of its own"),
        ("tell Robin that dinner is ready, but don't go into the kitchen", "say it in a sentence of its own"),
        ("go to the hall, and go at 20 metres per second in the hall", "I cannot keep a limit of 20 metres"),
        ("if the door of the kitchen is open, do not go into the kitchen and go to the hall", ""),
        ("go to the hall and do not go into the kitchen until I am there", ""),
        ("go to the hall and do not go into the kitchen tomorrow", ""),
        ("do not go into the kitchen unless Robin is there, and go to the hall", ""),
        ("do not keep out of the kitchen and go to the hall", ""),
        ("do not stay out of the kitchen and go to the hall", ""),
        ("do not go into the attic and go to the hall", ""),
        ("avoid the kitchen if you can and go to the hall", ""),
        ("do not leave the kitchen and find a coke", ""),
    ],
)
def test_a_sentence_whose_rule_cannot_be_kept_is_refused(meant, sentence, words):
    meaning = meant(sentence)
    assert meaning.status is not Status.OK
    assert words in meaning.reason
    assert meaning.all_steps == ()


@pytest.mark.parametrize(
    "sentence",
    [
        "tell Robin to keep out of the kitchen",
        "go to the hall, not the kitchen",
        "go slowly to the hall",
        "do not go to the kitchen, go to the hall",
    ],
)
def test_other_sentences_have_no_rule(meant, sentence):
    meaning = meant(sentence)
    assert meaning.status is Status.OK
    assert not any(isinstance(step, Group) for step in meaning.all_steps)


def test_a_rule_is_for_all_robots_of_a_sentence(parser, knowledge):
    text = "Do not go into the kitchen. Alice, go to the bedroom. Bob, go to the bedroom."
    meaning = understand_for_robots(text, robots=("alice", "bob"), parser=parser, knowledge=knowledge)
    assert meaning.status is Status.OK, meaning.reason
    assert {part.robot: rules(part.meaning) for part in meaning.parts} == dict.fromkeys(
        ("alice", "bob"), ([KEPT_OUT], TO_BEDROOM)
    )


def test_a_rule_behind_the_name_of_a_robot(parser, knowledge):
    text = "Alice, keep out of the kitchen and go to the bedroom"
    meaning = understand_for_robots(text, robots=("alice", "bob"), parser=parser, knowledge=knowledge)
    (part,) = meaning.parts
    assert (part.robot, rules(part.meaning)) == ("alice", ([KEPT_OUT], TO_BEDROOM))
