from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.language.understand import Status, understand
from executive.words.command import parse_command

HERE = Path(__file__).parent
FAMILIES = yaml.safe_load((HERE / "sentences.yaml").read_text(encoding="utf-8"))
UNUSABLE = yaml.safe_load((HERE / "refused.yaml").read_text(encoding="utf-8"))
UNDERSTOOD = [(text, commands) for family in FAMILIES.values() for text, commands in family.items()]


def texts(answer):
    return [str(command) for command in answer.commands]


@pytest.mark.parametrize(("sentence", "commands"), UNDERSTOOD, ids=[text for text, _ in UNDERSTOOD])
def test_a_sentence_becomes_its_commands(parser, knowledge, sentence, commands):
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
    assert (answer.reason, texts(answer)) == (None, commands)
    assert answer.status is Status.OK


@pytest.mark.parametrize(("sentence", "commands"), UNDERSTOOD[::6], ids=[text for text, _ in UNDERSTOOD[::6]])
def test_the_wake_phrase_changes_nothing_but_the_address(parser, knowledge, sentence, commands):
    answer = understand(f"Hey Alice, {sentence}", parser=parser, knowledge=knowledge, require_wake=True)
    assert texts(answer) == commands


@pytest.mark.parametrize(("sentence", "words"), UNUSABLE["refused"].items())
def test_refusal_names_the_unsupported_words(parser, knowledge, sentence, words):
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
    assert (answer.status, answer.commands) == (Status.REFUSED, ())
    assert [word for word in words if word not in answer.reason] == []
    assert "\n" not in answer.reason


@pytest.mark.parametrize(("sentence", "words"), UNUSABLE["question"].items())
def test_missing_destination_makes_a_question(parser, knowledge, sentence, words):
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
    assert (answer.status, answer.commands) == (Status.QUESTION, ())
    assert [word for word in words if word not in answer.reason] == []


@pytest.mark.parametrize(
    ("sentence", "unknown", "hint"),
    [("sing a song", "sing a song", "I can fetch"), ("bring me the wheelbarrow", "wheelbarrow", "more")],
)
def test_refusal_names_only_similar_names(parser, knowledge, sentence, unknown, hint):
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
    assert answer.unknown_words == (unknown,)
    assert hint in answer.reason
    assert sum(name in answer.reason for name in (*knowledge.object_names(), *knowledge.place_names())) <= 3


def test_verb_stays_as_spoken(parser, knowledge):
    answer = understand("could you pick the hammer up", parser=parser, knowledge=knowledge, require_wake=False)
    assert [command.verb for command in answer.commands] == ["pick up"]


@pytest.mark.parametrize(
    ("sentence", "says"),
    [
        ("fetch me a drink", 'begin with "Hey Alice"'),
        ("Hey Bob, fetch me a drink", "said to Bob"),
        ("Alice fetched me a drink yesterday", 'begin with "Hey Alice"'),
    ],
)
def test_a_sentence_for_nobody_or_another_is_not_taken(parser, knowledge, sentence, says):
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=True)
    assert (answer.status, answer.commands) == (Status.NOT_ADDRESSED, ())
    assert says in answer.reason


def test_a_mission_may_give_the_robot_another_name(parser, knowledge):
    answer = understand("Hey Spot, come here", parser=parser, knowledge=knowledge, require_wake=True, robot_name="Spot")
    assert answer.status is Status.OK


OPEN = {
    "fetch me the teapot from the pantry": [
        "Take [Nothing] to [pantry] and do [grasp] to [teapot]",
        "Take [teapot] to [start] and do [Nothing] to [Nothing]",
    ],
    "bring three small boxes to Ms Miller in the archive": [
        "Take [Nothing] to [Nothing] and do [grasp] to [3 small boxes]",
        "Take [3 small boxes] to [Ms Miller at archive] and do [Nothing] to [Nothing]",
    ],
    "put the pot on the stove in the basement": [
        "Take [Nothing] to [Nothing] and do [grasp] to [pot]",
        "Take [pot] to [stove in basement] and do [place] to [pot]",
    ],
    "bring me the thing under the newspaper from the sofa": [
        "Take [Nothing] to [sofa] and do [grasp] to [thing under newspaper]",
        "Take [thing under newspaper] to [start] and do [Nothing] to [Nothing]",
    ],
    "give the parcel to the man holding his hand up in the lobby": [
        "Take [Nothing] to [Nothing] and do [grasp] to [parcel]",
        "Take [parcel] to [man holding his hand up at lobby] and do [Nothing] to [Nothing]",
    ],
    "bring a glass of milk to the garden": [
        "Take [Nothing] to [Nothing] and do [grasp] to [glass of milk]",
        "Take [glass of milk] to [garden] and do [Nothing] to [Nothing]",
    ],
    "find grandma's glasses": ["Take [Nothing] to [Nothing] and do [find] to [some grandma's glasses]"],
}


@pytest.mark.parametrize(("sentence", "commands"), OPEN.items())
def test_with_open_vocabulary_names_stay_as_spoken(parser, sentence, commands):
    answer = understand(sentence, parser=parser, knowledge=None, require_wake=False)
    assert (answer.reason, texts(answer)) == (None, commands)


def test_lines_are_answered_in_order_and_one_by_one(parser):
    lines = ["go to the attic", "", "what day is it"]
    answers = [understand(line, parser=parser, knowledge=None, require_wake=False) for line in lines]
    assert [answer.status.value for answer in answers] == ["ok", "refused", "refused"]
    assert answers[0].to_json() == {
        "text": "go to the attic",
        "status": "ok",
        "reason": None,
        "unknown_words": [],
        "question": None,
        "notes": [],
        "commands": [
            {
                "item": None,
                "goal": "attic",
                "goal_at": None,
                "task": None,
                "object": None,
                "item_count": 0,
                "object_count": 0,
                "verb": "go",
            }
        ],
        "mission": [],
    }


WORDS = [*yaml.safe_load((HERE / "mangled.yaml").read_text(encoding="utf-8"))]
MANGLED = st.one_of(st.text(max_size=60), st.lists(st.sampled_from(WORDS), max_size=12).map(" ".join))


@settings(max_examples=200, deadline=None)
@given(MANGLED, st.booleans())
def test_no_sentence_raises_and_every_command_parses_back(parser, knowledge, sentence, is_open):
    answer = understand(sentence, parser=parser, knowledge=None if is_open else knowledge, require_wake=False)
    assert (answer.status is Status.OK) == bool(answer.commands or answer.steps)
    assert (answer.status is Status.OK) == (answer.reason is None)
    for command in answer.commands:
        assert str(parse_command(str(command))) == str(command)


@settings(max_examples=150, deadline=None)
@given(st.data(), st.booleans())
def test_no_understood_sentence_raises_when_it_is_mangled(parser, knowledge, data, is_open):
    """Words of a good sentence are left out, doubled, moved or run together, with odd characters between them."""
    words = data.draw(st.sampled_from(UNDERSTOOD))[0].split()
    words = data.draw(st.permutations(words)) if data.draw(st.booleans()) else words
    cut = data.draw(st.integers(0, len(words)))
    odd = data.draw(st.text(alphabet="\x00\x07\u202e🙂饮é\n\t\"'[]{}<>;,.!?-_ ", max_size=6))
    sentence = (
        odd.join([*words[:cut], *words[max(cut - 1, 0) :]]) if data.draw(st.booleans()) else " ".join(words[cut:])
    )
    answer = understand(sentence, parser=parser, knowledge=None if is_open else knowledge, require_wake=False)
    assert (answer.status is Status.OK) == bool(answer.commands or answer.steps)


@pytest.mark.parametrize(
    "sentence",
    ["fetch " * 10_000, "a" * 100_000, "\x00\x07\x1b[31m", "把饮料拿来", "🙂🙂", "[]\"'", "no " * 50, ", " * 5000],
)
def test_odd_input_is_refused(parser, knowledge, sentence):
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
    assert answer.status is Status.REFUSED
