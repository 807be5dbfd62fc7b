"""A part that no command supports refuses the whole sentence, and the reason names the part."""

import pytest

from executive.language.understand import Status, understand
from executive.words.command import parse_command
from tests.tables import table, yaml_beside

ROWS = yaml_beside(__file__, "unsupported_words.yaml")
SENTENCES = [(kind, text, part) for kind, rows in ROWS.items() for text, part in rows.items()]


@pytest.fixture
def understood(parser, knowledge):
    return lambda sentence: understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)


@pytest.mark.parametrize(("kind", "sentence", "part"), SENTENCES, ids=[text for _, text, _ in SENTENCES])
def test_unsupported_part_is_named_in_the_refusal(understood, kind, sentence, part):
    answer = understood(sentence)
    assert (answer.status, answer.commands) == (Status.REFUSED, ()) and kind in answer.reason
    assert part in answer.reason and answer.unknown_words


@pytest.mark.parametrize(*table(__file__, "goals"))
def test_carried_object_stays_in_the_command(understood, sentence, goal):
    assert [command.goal for command in understood(sentence).commands] == [goal]


@pytest.mark.parametrize("sentence", ["go to the room", "go to kitchen 3", "go to the red kitchen"])
def test_place_with_an_unknown_description_makes_a_question(understood, sentence):
    answer = understood(sentence)
    assert (answer.status, "kitchen" in answer.question.candidates) == (Status.QUESTION, True)


def test_a_question_after_one_place_or_the_other_is_asked_about(understood):
    answer = understood("is there a beer on the bench or the counter")
    assert (answer.status, len(answer.question.candidates)) == (Status.QUESTION, 2)


@pytest.mark.parametrize(*table(__file__, "counts"))
def test_number_of_objects_stays_in_a_correction(understood, said, count):
    answer = understood(f"put {said} on the coffee table")
    assert [command.object_count for command in answer.commands] == [count, count]


@pytest.mark.parametrize(*table(__file__, "missions"))
def test_requests_become_their_missions(understood, sentence, commands):
    answer = understood(sentence)
    assert [str(command) for command in answer.commands] == commands
    assert [str(parse_command(str(command))) for command in answer.commands] == commands
