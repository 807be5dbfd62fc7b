from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.language.understand import Status, understand
from executive.words.command import parse_command
from tests.tables import table, yaml_beside

FAMILIES = yaml_beside(__file__, "sentences.yaml")
UNUSABLE = yaml_beside(__file__, "refused.yaml")
UNDERSTOOD = [(text, commands) for family in FAMILIES.values() for text, commands in family.items()]


@pytest.fixture
def understood(parser, knowledge):
    return partial(understand, parser=parser, knowledge=knowledge, require_wake=False)


def texts(answer):
    return [str(command) for command in answer.commands]


@pytest.mark.parametrize(("sentence", "commands"), UNDERSTOOD, ids=[text for text, _ in UNDERSTOOD])
def test_a_sentence_becomes_its_commands(understood, sentence, commands):
    answer = understood(sentence)
    assert (answer.reason, texts(answer), answer.status) == (None, commands, Status.OK)


@pytest.mark.parametrize(("sentence", "commands"), UNDERSTOOD[::6], ids=[text for text, _ in UNDERSTOOD[::6]])
def test_the_wake_phrase_changes_nothing_but_the_address(understood, sentence, commands):
    assert texts(understood(f"Hey Alice, {sentence}", require_wake=True)) == commands


@pytest.mark.parametrize(
    ("sentence", "lines"),
    [
        (
            "take the coke to the kitchen table",
            ["Take [Nothing] to [kitchen] and do [grasp]", "Take [coke] to [kitchen table] and do [Nothing]"],
        ),
        ("if a beer is in the kitchen, go to the kitchen", ["- if: {object: beer", "  then:", "  - {to: kitchen}"]),
        ("go to the moon", ["I do not understand 'go to the moon'"]),
        (
            "wait 5 seconds, then go to the kitchen",
            ["Take [Nothing] to [Nothing] and do [wait]", "Take [Nothing] to [kitchen] and do [Nothing]"],
        ),
    ],
)
def test_an_answer_reads_as_its_commands_or_its_reason(understood, sentence, lines):
    shown = str(understood(sentence)).splitlines()
    assert len(shown) == len(lines) and all(map(str.startswith, shown, lines))


UNCLEAR = [(Status(status), *row) for status, rows in UNUSABLE.items() for row in rows.items()]


@pytest.mark.parametrize(("status", "sentence", "words"), UNCLEAR, ids=[text for _, text, _ in UNCLEAR])
def test_refusal_or_question_names_the_unsupported_words(understood, status, sentence, words):
    answer = understood(sentence)
    assert (answer.status, answer.commands) == (status, ())
    assert [word for word in words if word not in answer.reason] == [] and "\n" not in answer.reason


@pytest.mark.parametrize(*table(__file__, "similar"))
def test_refusal_names_only_similar_names(understood, knowledge, sentence, unknown, hint):
    answer = understood(sentence)
    assert (answer.unknown_words, hint in answer.reason) == ((unknown,), True), answer.reason
    assert sum(name in answer.reason for name in (*knowledge.object_names(), *knowledge.place_names())) <= 3


def test_verb_stays_as_spoken(understood):
    assert [command.verb for command in understood("could you pick the hammer up").commands] == ["pick up"]


@pytest.mark.parametrize(*table(__file__, "not_taken"))
def test_a_sentence_for_nobody_or_another_is_not_taken(understood, sentence, says):
    answer = understood(sentence, require_wake=True)
    assert (answer.status, answer.commands, says in answer.reason) == (Status.NOT_ADDRESSED, (), True), answer.reason


def test_a_mission_may_give_the_robot_another_name(understood):
    assert understood("Hey Spot, come here", require_wake=True, robot_name="Spot").status is Status.OK


@pytest.mark.parametrize(*table(__file__, "open_vocabulary"))
def test_with_open_vocabulary_names_stay_as_spoken(understood, sentence, commands):
    answer = understood(sentence, knowledge=None)
    assert (answer.reason, texts(answer)) == (None, commands)


def test_lines_are_answered_in_order_and_one_by_one(understood):
    answers = [understood(line, knowledge=None) for line in ("go to the attic", "", "what day is it")]
    assert [answer.status.value for answer in answers] == ["ok", "refused", "refused"]
    nothing = {"item": None, "goal_at": None, "task": None, "object": None, "item_count": 0, "object_count": 0}
    assert answers[0].to_json() == {
        "text": "go to the attic",
        "status": "ok",
        "commands": [nothing | {"goal": "attic", "verb": "go"}],
        **{"reason": None, "question": None, "unknown_words": [], "notes": [], "mission": []},
    }


WORDS = [*yaml_beside(__file__, "mangled.yaml")]
MANGLED = st.one_of(st.text(max_size=60), st.lists(st.sampled_from(WORDS), max_size=12).map(" ".join))


@settings(max_examples=200, deadline=None)
@given(MANGLED, st.booleans())
def test_no_sentence_raises_and_every_command_parses_back(parser, knowledge, sentence, is_open):
    answer = understand(sentence, parser=parser, knowledge=None if is_open else knowledge, require_wake=False)
    assert (answer.status is Status.OK) == bool(answer.commands or answer.steps) == (answer.reason is None)
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
def test_odd_input_is_refused(understood, sentence):
    assert understood(sentence).status is Status.REFUSED
