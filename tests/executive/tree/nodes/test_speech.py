"""Questions whose answer a mission goes by: put, answered, not understood, not answered, cancelled, held."""

from dataclasses import replace

import pytest

from executive.run.control import Control
from executive.tree.context import ANSWER_TOPIC
from executive.tree.nodes.speech import SPEECH_TOPIC, AskPeople
from executive.words.expression import Template
from skills.api import Cause
from tests.executive.tree.scripted import F, N, R, S, play, tick

KEY, ID = "alice/answer", "alice/ask"


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def run_context(context, control):
    return replace(context, ask=lambda question: control.ask(question, context.clock))


@pytest.fixture
def ask(run_context):
    def make(text="tea or coffee?", choices=("tea", "coffee"), gives=str, default=None, names=None, **keys):
        known = {choice.lower(): choice for choice in choices} if names is None else names
        return AskPeople(
            path_id=ID,
            name="ask",
            text=Template(text),
            keys=keys,
            options=tuple(choices),
            names=known,
            gives=gives,
            limit_s=10.0,
            default=default,
            key=KEY,
            context=run_context,
        )

    return make


@pytest.fixture
def answered(control, run_context):
    """Tick until the question is put, answer it, tick again; status and answer."""

    def say(root, *said):
        root.tick_once()
        for each in said:
            control.answer(ID, each)
            root.tick_once()
        return root.status, run_context.board.values().get(KEY)

    return say


# kind     names               said                    answer
SAID = [
    (("tea", "coffee"), None, str, "Tea", "tea"),
    (("the hall", "a place to go."), None, str, "the hall", "the hall"),
    (("the hall", "a place to go."), None, str, "A place to go.", "a place to go."),
    (("in the end", "please"), None, str, "please", "please"),
    ((), {"kitchen": "kitchen", "living room": "lounge"}, str, "In the living room, please.", "lounge"),
    ((), {"kitchen": "kitchen", "living room": "lounge"}, str, "in the living room please", "lounge"),
    ((), {"kitchen": "kitchen"}, str, "The Kitchen!", "kitchen"),
    ((), {}, str, " what you like ", "what you like"),
    ((), {}, float, "3", 3.0),
    ((), {}, float, " -2.5. ", -2.5),
]


@pytest.mark.parametrize(("choices", "names", "gives", "said", "answer"), SAID)
def test_answers(ask, answered, published, choices, names, gives, said, answer):
    root = ask(choices=choices, names=names, gives=gives)
    assert answered(root, said) == (S, answer)
    told = [message for topic, message in published if topic == ANSWER_TOPIC]
    assert [message["answer"] for message in told] == [answer]


@pytest.mark.parametrize("said", ["many", "nan", "inf", "-inf", "1e300", "1e16", "3 beers"])
def test_an_answer_that_is_no_number_is_asked_for_again(ask, answered, control, published, said):
    root = ask(choices=(), names={}, gives=float)
    assert answered(root, said)[0] == R
    assert root.message == f"asks: I did not understand '{said}'. tea or coffee?"
    control.answer(ID, "7")
    assert tick(root) == [S]


def test_the_question_is_put_aloud_and_to_the_operator(ask, control, published):
    root = ask(text="{n} teas?", n="alice/n")
    root.context.board.put("alice/n", 2.0)
    root.tick_once()
    (asked,) = control.state.questions
    assert (asked.question.text, asked.options) == ("2 teas?", ("tea", "coffee"))
    assert [message["text"] for topic, message in published if topic == SPEECH_TOPIC] == ["2 teas?"]


# Nobody answers.
#
#   default  status  cause    answer
#   -        F       TIMEOUT  -
#   tea      S       -        tea
#   2.0      S       -        2.0
@pytest.mark.parametrize(
    ("default", "gives", "choices", "status", "answer"),
    [(None, str, ("tea",), F, None), ("tea", str, ("tea",), S, "tea"), (2.0, float, (), S, 2.0), ("", str, (), S, "")],
)
def test_nobody_answers(ask, run_context, control, clock, default, gives, choices, status, answer):
    root = ask(default=default, gives=gives, choices=choices)
    root.tick_once()
    assert tick(root, 1, clock, 9.9) == [R]
    assert tick(root, 1, clock, 0.2) == [status]
    assert run_context.board.values().get(KEY) == answer
    assert root.cause is (Cause.TIMEOUT if status == F else None)
    assert control.state.questions == ()


def test_answers_that_mean_nothing_give_no_more_time(ask, control, clock):
    root = ask(choices=(), names={"kitchen": "kitchen"})
    root.tick_once()
    for _ in range(3):
        control.answer(ID, "mars")
        assert tick(root, 1, clock, 3.0) == [R]
    assert (tick(root, 1, clock, 1.1), root.cause) == ([F], Cause.TIMEOUT)
    assert root.message.endswith("within 10 s; 'mars' was not understood")


def test_a_text_without_a_value_fails(ask, control):
    root = ask(text="{n} teas?", n="alice/n")
    assert (tick(root), root.cause, control.state.questions) == ([F], Cause.PRECONDITION, ())


def test_cancelled_it_takes_the_question_back_and_asks_again_when_it_starts_again(ask, answered, control, run_context):
    root = ask()
    assert play(root, "RI") == "RI"
    assert (root.status, root.cause, control.state.questions) == (N, Cause.CANCELLED, ())
    assert KEY not in run_context.board
    assert answered(root, "tea") == (S, "tea")


def test_a_suspension_leaves_the_question_open(ask, control):
    root = ask()
    assert play(root, "R|") == "R|"
    assert len(control.state.questions) == 1
    control.answer(ID, "coffee")
    assert tick(root) == [S]
