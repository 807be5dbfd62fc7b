import pytest

from executive.language.questions import ClarifyingQuestion, Slot, chosen_candidate, insert_answer, make_answerer
from executive.language.understand import Status, understand
from executive.words.mission import QuestionPolicy
from tests.tables import table

TABLE = ClarifyingQuestion("Which?", Slot.PLACE, ("kitchen table", "coffee table"), "kitchen table", "table")
CAKE = ClarifyingQuestion("I know no object 'cake'; did you mean 'coke'?", Slot.THING, ("coke",), "coke", "cake")
QUESTIONS = {
    "table": TABLE,
    "cake": CAKE,
    "it": ClarifyingQuestion("?", Slot.THING, heard="it"),
    "there": ClarifyingQuestion("?", Slot.PLACE, heard="there"),
    "goal": ClarifyingQuestion("?", Slot.GOAL),
    "where": ClarifyingQuestion("?", Slot.PLACE),
    "what": ClarifyingQuestion("?", Slot.THING),
}


@pytest.mark.parametrize(*table(__file__, "answers"))
def test_an_answer_means_one_of_the_candidates_or_is_unclear(answer, candidate):
    assert chosen_candidate(TABLE, answer) == candidate


@pytest.mark.parametrize("answer", ["yes", "yes please", "Yeah", "coke", "the coke", "1"])
def test_yes_is_enough_where_there_is_one_candidate(answer):
    assert chosen_candidate(CAKE, answer) == "coke"


@pytest.mark.parametrize(*table(__file__, "completed"))
def test_the_answer_is_put_into_the_sentence(sentence, question, answer, whole):
    assert insert_answer(sentence, QUESTIONS[question], answer) == whole


@pytest.mark.parametrize(*table(__file__, "commands"))
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
    asked = [(QuestionPolicy.REFUSE, lambda _: "2"), (QuestionPolicy.ASK, None), (QuestionPolicy.ASK, lambda _: "2")]
    assert make_answerer(QuestionPolicy.FIRST)(TABLE) == "kitchen table"
    assert [make_answerer(policy, answer)(TABLE) for policy, answer in asked] == [None, None, "2"]
