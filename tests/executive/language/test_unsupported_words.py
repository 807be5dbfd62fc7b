"""A part that no command supports refuses the whole sentence, and the reason names the part."""

from pathlib import Path

import pytest
import yaml

from executive.language.understand import Status, understand
from executive.words.command import parse_command

ROWS = yaml.safe_load(Path(__file__).with_name("unsupported_words.yaml").read_text(encoding="utf-8"))
SENTENCES = [(kind, text, part) for kind, rows in ROWS.items() for text, part in rows.items()]


@pytest.fixture
def understood(parser, knowledge):
    return lambda sentence: understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)


@pytest.mark.parametrize(("kind", "sentence", "part"), SENTENCES, ids=[text for _, text, _ in SENTENCES])
def test_unsupported_part_is_named_in_the_refusal(understood, kind, sentence, part):
    answer = understood(sentence)
    assert (answer.status, answer.commands) == (Status.REFUSED, ())
    assert kind in answer.reason
    assert part in answer.reason
    assert answer.unknown_words


@pytest.mark.parametrize(
    ("sentence", "goal"),
    [
        ("don't go to the kitchen, go to the hall", "hall"),
        ("go to the hall, not to the kitchen", "hall"),
        ("go next to Robin", "Robin"),
        ("stand in front of the workbench", "workbench"),
        ("go through the door to the kitchen", "kitchen"),
        ("walk over to Robin", "Robin"),
        ("go to the living room table", "coffee table"),
    ],
)
def test_carried_object_stays_in_the_command(understood, sentence, goal):
    assert [command.goal for command in understood(sentence).commands] == [goal]


@pytest.mark.parametrize("sentence", ["go to the room", "go to kitchen 3", "go to the red kitchen"])
def test_place_with_an_unknown_description_makes_a_question(understood, sentence):
    answer = understood(sentence)
    assert answer.status is Status.QUESTION
    assert "kitchen" in answer.question.candidates


@pytest.mark.parametrize(
    "sentence", ["is there a beer or a coke on the bench", "is there a beer on the bench or the counter"]
)
def test_a_question_after_one_or_the_other_is_asked_about(understood, sentence):
    answer = understood(sentence)
    assert answer.status is Status.QUESTION
    assert len(answer.question.candidates) == 2


@pytest.mark.parametrize(
    ("said", "count"),
    [
        ("two hammers", 2),
        ("twenty one hammers", 21),
        ("two dozen hammers", 24),
        ("exactly two hammers", 2),
        ("a couple of hammers", 2),
        ("14 hammers", 14),
    ],
)
def test_number_of_objects_stays_in_a_correction(understood, said, count):
    answer = understood(f"put {said} on the coffee table")
    assert [command.object_count for command in answer.commands] == [count, count]


@pytest.mark.parametrize(
    ("sentence", "commands"),
    [
        ("what is on the workbench", ["Take [Nothing] to [workbench] and do [find] to [some object]"]),
        ("what do you see in the kitchen", ["Take [Nothing] to [kitchen] and do [find] to [some object]"]),
        ("is the counter empty", ["Take [Nothing] to [kitchen counter] and do [find] to [some object]"]),
        ("is there anything on the bench", ["Take [Nothing] to [workbench] and do [find] to [some object]"]),
        ("do we have any coke left", ["Take [Nothing] to [kitchen] and do [find] to [coke]"]),
        ("have we got a hammer in the workshop", ["Take [Nothing] to [workshop] and do [find] to [hammer]"]),
        ("go charge yourself", ["Take [Nothing] to [Nothing] and do [charge] to [Nothing]"]),
        ("go to the charging station and charge", ["Take [Nothing] to [Nothing] and do [charge] to [Nothing]"]),
        (
            "go to the workshop and back",
            [
                "Take [Nothing] to [workshop] and do [Nothing] to [Nothing]",
                "Take [Nothing] to [start] and do [Nothing] to [Nothing]",
            ],
        ),
        ("wait there for ten seconds", ["Take [Nothing] to [Nothing] and do [wait] to [10 second]"]),
        ("wait in the hall for a minute", ["Take [Nothing] to [hall] and do [wait] to [minute]"]),
        (
            "fetch the beer, wait for 5 seconds and bring it to Robin",
            [
                "Take [Nothing] to [kitchen] and do [grasp] to [beer]",
                "Take [Nothing] to [Nothing] and do [wait] to [5 second]",
                "Take [beer] to [Robin] and do [Nothing] to [Nothing]",
            ],
        ),
    ],
)
def test_requests_become_their_missions(understood, sentence, commands):
    answer = understood(sentence)
    assert [str(command) for command in answer.commands] == commands
    assert [str(parse_command(str(command))) for command in answer.commands] == commands
