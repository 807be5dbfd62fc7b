"""Keys at the terminal: what they do to a run, what is said below the tree, and that the terminal is put back."""

import os
import pty
import termios
import time
from dataclasses import replace

import pytest

from executive.cli.run_keys import HELP, SAY_HELP, Keys, Typing, prompt_lines, read_keys
from executive.run.control import Control
from executive.run.control_state import Mode
from executive.tree.node import NodeSpec
from executive.tree.nodes.decision_nodes import Decision
from executive.words.condition import AnyOf, ButtonPressed, Not
from skills.api import Question
from skills.testing.clock import VirtualClock

QUESTION = Question("alice/ask", "Nothing found. What now?", ("retry", "skip"), "skip", 30.0)


@pytest.fixture
def control(compiled, make):
    hands = Control()
    hands.begin({"Alice": compiled(*make.FETCH)})
    return hands


@pytest.fixture
def terminal():
    """Both ends of a terminal: what a person types into, what a program reads."""
    person, program = pty.openpty()
    yield person, program
    os.close(person)
    os.close(program)


def pressed(control, keys):
    board = Keys(control)
    for key in keys:
        board.press(key)
    return control.state


@pytest.mark.parametrize(("key", "mode"), [(" ", Mode.PAUSED), ("x", Mode.STOPPED)])
@pytest.mark.parametrize("asks", [False, True])
def test_space_pauses_and_x_stops_until_the_key_is_pressed_again(control, key, mode, asks):
    if asks:
        control.ask(QUESTION, VirtualClock())
    assert [pressed(control, key).mode for _ in range(2)] == [mode, Mode.RUNNING]


def test_s_steps_from_a_running_mission(control):
    assert pressed(control, "s").mode is Mode.STEPPING
    assert control.poll().hold is None
    control.note_tick(changed=True)
    assert control.poll().hold == "stepping"


@pytest.mark.parametrize("key", ["c", "q"])
def test_c_and_q_cancel(control, key):
    pressed(control, key)
    assert control.poll().cancel == "cancelled at the terminal"


def test_other_keys_do_nothing(control):
    version = control.state.version
    assert pressed(control, "zZ5\x1b[A\n").version == version


def test_a_digit_answers_the_question(control):
    asked = control.ask(QUESTION, VirtualClock())
    assert pressed(control, "3").questions != ()
    pressed(control, "1")
    assert asked.result() == "retry"


def test_free_text_is_typed_and_sent_with_enter(control):
    asked = control.ask(Question("alice/name", "Which shelf?", (), "any", 30.0), VirtualClock())
    pressed(control, "the loo\x7fw one\n")
    assert asked.result() == "the low one"


def test_below_the_tree_stand_reason_question_and_keys(control):
    clock = VirtualClock()
    control.ask(QUESTION, clock)
    control.pause("somebody walks by")
    assert prompt_lines(control.state, 4.6) == [
        "PAUSED: somebody walks by",
        "? Nothing found. What now?  [1] retry  [2] skip  ('skip' in 25 s)",
        HELP,
    ]


def test_keys_typed_at_a_terminal_reach_the_run_and_it_is_put_back(control, terminal):
    person, program = terminal
    before = termios.tcgetattr(program)
    version = control.state.version
    with read_keys(Keys(control).press, program) as heard:
        assert heard
        assert termios.tcgetattr(program) != before
        os.write(person, b" ")
        assert control.wait(version, timeout_s=5.0).mode is Mode.PAUSED
    assert termios.tcgetattr(program) == before


def test_the_terminal_is_put_back_after_an_exception(control, terminal):
    _, program = terminal
    before = termios.tcgetattr(program)
    with pytest.raises(ZeroDivisionError), read_keys(Keys(control).press, program):
        raise ZeroDivisionError
    assert termios.tcgetattr(program) == before


def test_nothing_is_read_where_there_is_no_terminal(control, tmp_path):
    with (tmp_path / "in").open("w+") as file, read_keys(Keys(control).press, file.fileno()) as heard:
        assert not heard


def test_waiting_for_keys_takes_no_time_of_the_processor(control, terminal):
    with read_keys(Keys(control).press, terminal[1]):
        before = time.process_time()
        control.wait(control.state.version, timeout_s=0.3)
        assert time.process_time() - before < 0.1


def said_with(control, keys, answer="all right"):
    said = []
    board = Keys(control, lambda text: said.append(text) or answer)
    for key in keys:
        board.press(key)
    return said, board.typing


# Keys -> what is said, what is being typed, and the mode of the run afterwards.
TYPED = [
    ("\nstop\x1b", [], Typing(can_say=True), Mode.RUNNING),
    (":  \n", [], Typing(can_say=True), Mode.RUNNING),
    (":no, the x\x7fhammer\n", ["no, the hammer"], Typing(reply="all right", can_say=True), Mode.RUNNING),
    (":where are you\n ", ["where are you"], Typing(reply="all right", can_say=True), Mode.PAUSED),
]


@pytest.mark.parametrize(("keys", "said", "typing", "mode"), TYPED)
def test_a_sentence_is_typed_behind_a_colon_or_enter_and_escape_leaves_it(control, keys, said, typing, mode):
    assert (*said_with(control, keys), control.state.mode) == (said, typing, mode)


def test_a_sentence_being_typed_and_its_answer_stand_below_the_tree(control):
    assert prompt_lines(control.state, 0.0, Typing("go o", True, can_say=True))[0] == ": go o_"
    assert prompt_lines(control.state, 0.0, Typing(reply="I go on", can_say=True)) == ["I go on", SAY_HELP]


@pytest.fixture
def waiting(compiled, make):
    """A control of a mission that waits for two buttons."""
    hands, tree = Control(), compiled(*make.FETCH)
    either = Decision(AnyOf(any=(ButtonPressed(button="go"), Not(**{"not": ButtonPressed(button="hold on")}))))
    decide = NodeSpec("decide", "alice/fetch-drink/decide", "either?", {"decision": either})
    hands.begin({"Alice": replace(tree, root=replace(tree.root, children=(*tree.root.children, decide)))})
    return hands


def test_a_digit_presses_the_button_of_that_number(waiting):
    # key   1  2  2  3
    # go    1  1  1  1
    # hold  0  1  2  2
    assert pressed(waiting, "1223").buttons == ("go", "hold on")
    assert waiting.presses == {"go": 1, "hold on": 2}


def test_a_digit_answers_a_question_rather_than_pressing_a_button(waiting):
    waiting.ask(QUESTION, VirtualClock())
    pressed(waiting, "1")
    assert (waiting.presses, waiting.state.questions) == ({}, ())


def test_the_buttons_stand_below_the_tree(waiting):
    assert "buttons: [1] go  [2] hold on" in prompt_lines(waiting.state, 0.0)


def test_a_button_that_no_mission_has_cannot_be_pressed(waiting):
    with pytest.raises(ValueError, match="the run has no button 'stop'; there are: go, hold on"):
        waiting.press("stop")
