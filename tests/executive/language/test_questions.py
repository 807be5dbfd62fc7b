import pytest

from executive.language.questions import ClarifyingQuestion, Slot, chosen_candidate, insert_answer, make_answerer
from executive.language.understand import Status, understand
from executive.words.mission import QuestionPolicy

TABLE = ClarifyingQuestion(
    "Which table: kitchen table or coffee table?",
    Slot.PLACE,
    ("kitchen table", "coffee table"),
    "kitchen table",
    "table",
)
CAKE = ClarifyingQuestion("I know no object 'cake'; did you mean 'coke'?", Slot.THING, ("coke",), "coke", "cake")


@pytest.mark.parametrize(
    ("answer", "candidate"),
    [
        ("the coffee table", "coffee table"),
        ("Coffee table, please.", "coffee table"),
        ("coffee", "coffee table"),
        ("the coffee one", "coffee table"),
        ("2", "coffee table"),
        ("the second one", "coffee table"),
        ("first", "kitchen table"),
        ("on the kitchen table", "kitchen table"),
        ("I mean the kitchen table", "kitchen table"),
        ("kitchn table", "kitchen table"),
        ("coughy table", "coffee table"),
        ("table", None),
        ("yes", None),
        ("neither", None),
        ("the desk", None),
        ("", None),
    ],
)
def test_an_answer_means_one_of_the_candidates_or_is_unclear(answer, candidate):
    assert chosen_candidate(TABLE, answer) == candidate


@pytest.mark.parametrize("answer", ["yes", "yes please", "Yeah", "coke", "the coke", "1"])
def test_yes_is_enough_where_there_is_one_candidate(answer):
    assert chosen_candidate(CAKE, answer) == "coke"


@pytest.mark.parametrize(
    ("sentence", "question", "answer", "whole"),
    [
        ("put the cube on the table", TABLE, "coffee", "put the cube on the coffee table"),
        (
            "move the cube from the kitchen table to the table",
            TABLE,
            "2",
            "move the cube from the kitchen table to the coffee table",
        ),
        ("fetch me a cake", CAKE, "yes", "fetch me a coke"),
        ("put the cube on the table", TABLE, "the desk", "put the cube on the desk"),
        ("put the cube on the table", TABLE, "on the desk", "put the cube on the desk"),
        (
            "take it to the kitchen",
            ClarifyingQuestion("?", Slot.THING, heard="it"),
            "hammer",
            "take the hammer to the kitchen",
        ),
        ("go there", ClarifyingQuestion("?", Slot.PLACE, heard="there"), "kitchen", "go to the kitchen"),
        ("send the hammer.", ClarifyingQuestion("?", Slot.GOAL), "to the kitchen", "send the hammer to the kitchen"),
        ("send the hammer", ClarifyingQuestion("?", Slot.GOAL), "Robin", "send the hammer to Robin"),
    ],
)
def test_the_answer_is_put_into_the_sentence(sentence, question, answer, whole):
    assert insert_answer(sentence, question, answer) == whole


@pytest.mark.parametrize(
    ("sentence", "answer", "commands"),
    [
        ("put the cube on the table", "the coffee table", 2),
        ("fetch me a cake", "yes", 2),
        ("take it to the kitchen", "the hammer", 2),
        ("go there", "the bedroom", 1),
        ("send the hammer", "to Robin", 2),
        ("put the hammer back", "on the workbench", 2),
        ("bring the hammer to the man", "Charlie", 2),
        ("bring me coke or beer", "beer", 2),
        ("bring me the coke or the beer please", "the second one", 2),
        ("take the hammer to the kitchen and the bedroom", "bedroom", 2),
    ],
)
def test_an_answered_question_leads_to_the_commands(parser, knowledge, sentence, answer, commands):
    def understood(text):
        return understand(text, parser=parser, knowledge=knowledge, require_wake=False)

    asked = understood(sentence)
    assert asked.status is Status.QUESTION
    answered = understood(insert_answer(sentence, asked.question, answer))
    assert (answered.reason, len(answered.commands)) == (None, commands)


def test_first_of_indefinite_choices_is_taken_with_a_note(parser, knowledge):
    meant = understand("bring me a beer or a coke", parser=parser, knowledge=knowledge, require_wake=False)
    assert [str(command.item or command.object) for command in meant.commands] == ["beer", "beer"]
    assert meant.notes == ("of a beer or a coke I take the first",)


def test_the_policy_says_who_answers():
    assert make_answerer(QuestionPolicy.FIRST)(TABLE) == "kitchen table"
    assert make_answerer(QuestionPolicy.REFUSE, lambda question: "2")(TABLE) is None
    assert make_answerer(QuestionPolicy.ASK)(TABLE) is None
    assert make_answerer(QuestionPolicy.ASK, lambda question: "2")(TABLE) == "2"
