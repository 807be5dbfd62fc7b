import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.language.followups import (
    Amendment,
    FollowUpKind,
    Remark,
    amend,
    parse_follow_up,
    parse_remark,
    skip_fetching,
)
from executive.words.command import parse_command
from skills.api import ObjectKind

FETCH = tuple(
    map(
        parse_command,
        (
            "Take [Nothing] to [kitchen] and do [grasp] to [coke]",
            "Take [coke] to [start] and do [Nothing] to [Nothing]",
        ),
    )
)
CORRECTION, ADDITION, AGAIN = FollowUpKind.CORRECTION, FollowUpKind.ADDITION, FollowUpKind.AGAIN


@pytest.mark.parametrize(
    ("text", "kind", "said", "preposition", "old"),
    [
        ("no, the hammer", CORRECTION, "the hammer", "", ""),
        ("No the hammer.", CORRECTION, "the hammer", "", ""),
        ("no no, I meant the hammer", CORRECTION, "the hammer", "", ""),
        ("not the coke, the beer", CORRECTION, "the beer", "", "the coke"),
        ("no, not the coke but the beer", CORRECTION, "the beer", "", "the coke"),
        ("the beer instead of the coke", CORRECTION, "the beer", "", "the coke"),
        ("no, to the bedroom", CORRECTION, "the bedroom", "to", ""),
        ("make that two", CORRECTION, "two", "", ""),
        ("the beer too", ADDITION, "the beer", "", ""),
        ("and to the kitchen?", ADDITION, "the kitchen", "to", ""),
        ("how about the kitchen", ADDITION, "the kitchen", "", ""),
        ("one more beer please", ADDITION, "beer", "", ""),
        ("another one", AGAIN, "", "", ""),
        ("bring me another one please", AGAIN, "", "", ""),
        ("once more", AGAIN, "", "", ""),
    ],
)
def test_follow_ups_are_parsed(text, kind, said, preposition, old):
    follow_up = parse_follow_up(text)
    assert (follow_up.kind, follow_up.said, follow_up.preposition) == (kind, said, preposition)
    assert follow_up.instead_of == old


@pytest.mark.parametrize("text", ["", "no", "go to the kitchen", "the hammer", "bring me the coke", "nothing", "stop"])
def test_sentence_of_its_own_is_no_follow_up(text):
    assert parse_follow_up(text) is None


def texts(commands):
    return [str(command) for command in commands]


@pytest.mark.parametrize(
    ("by", "commands"),
    [
        (
            Amendment(kind=ObjectKind("hammer")),
            [
                "Take [Nothing] to [workshop] and do [grasp] to [hammer]",
                "Take [hammer] to [start] and do [Nothing] to [Nothing]",
            ],
        ),
        (Amendment(kind=ObjectKind("hammer"), old="beer"), texts(FETCH)),
        (
            Amendment(goal="Robin", goal_at="hall"),
            [str(FETCH[0]), "Take [coke] to [Robin at hall] and do [Nothing] to [Nothing]"],
        ),
        (
            Amendment(goal="bedroom", source=True),
            ["Take [Nothing] to [bedroom] and do [grasp] to [coke]", str(FETCH[1])],
        ),
        (
            Amendment(count=2),
            [
                "Take [Nothing] to [kitchen] and do [grasp] to [2 coke]",
                "Take [2 coke] to [start] and do [Nothing] to [Nothing]",
            ],
        ),
    ],
)
def test_commands_are_amended(knowledge, by, commands):
    assert texts(amend(FETCH, by, knowledge)) == commands


def test_the_place_that_was_named_is_changed(knowledge):
    assert amend(FETCH, Amendment(goal="bedroom", old="kitchen"), knowledge)[0].goal == "bedroom"


def test_held_object_is_not_fetched_again(knowledge):
    assert skip_fetching(FETCH, ObjectKind("coke"), knowledge) == FETCH[1:]


def test_robot_puts_another_object_down_first(knowledge):
    commands = skip_fetching(FETCH, ObjectKind("hammer"), knowledge)
    assert texts(commands)[0] == "Take [hammer] to [workbench] and do [place] to [hammer]"
    assert commands[1:] == FETCH


def test_empty_gripper_changes_no_commands(knowledge):
    assert skip_fetching(FETCH, None, knowledge) == FETCH


WORDS = "no not the coke , but instead of too and a to make it another one please again ' - kitchen".split()  # noqa: SIM905


@settings(deadline=200)
@given(st.one_of(st.text(max_size=200), st.lists(st.sampled_from(WORDS), max_size=40).map(" ".join)))
def test_any_text_is_read_without_an_error_and_soon(text):
    parse_follow_up(text)


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        ("stop", Remark.STOP),
        ("Stop!", Remark.STOP),
        ("please stop right now", Remark.STOP),
        ("don’t move", Remark.FREEZE),
        ("wait", Remark.WAIT),
        ("Wait a second, please.", Remark.WAIT),
        ("ok hold on", Remark.WAIT),
        ("go on", Remark.GO_ON),
        ("okay, you can go on now", Remark.GO_ON),
        ("could you continue please?", Remark.GO_ON),
        ("never mind", Remark.CANCEL),
        ("cancel that, please", Remark.CANCEL),
        ("Where are you?", Remark.WHERE),
        ("can you tell me where you are", Remark.WHERE),
        ("what room are you in", Remark.WHERE),
        ("What are you doing right now?", Remark.DOING),
        ("why are you waiting", Remark.DOING),
        ("what can you do?", Remark.ABLE),
        ("Thank you!", Remark.THANKS),
    ],
)
def test_a_remark_is_known_with_and_without_politeness(text, remark):
    assert parse_remark(text) is remark


@pytest.mark.parametrize(
    "text",
    [
        "",
        "stop the music",
        "wait in the kitchen and bring me a coke",
        "go on to the kitchen",
        "go to the kitchen",
        "where is the hammer",
        "where are you going to put the hammer",
        "what are you doing with the hammer",
        "cancel my appointment",
        "is there a stop sign in the hall",
        "don't stop",
    ],
)
def test_sentence_with_more_words_is_no_remark(text):
    assert parse_remark(text) is None


@given(st.text(max_size=300))
def test_any_text_is_judged_without_an_error(text):
    parse_remark(text)
