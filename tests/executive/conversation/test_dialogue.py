"""Sentences during a run that began with "fetch me a coke from the kitchen", and their effects."""

import time
from dataclasses import replace

import pytest

from executive.conversation import Conversation, ReplyKind
from executive.run.control_state import Mode
from executive.run.outcome import Outcome
from executive.words.command import Command
from executive.words.leaf_steps import Do, steps_of_commands
from skills.api import Question
from skills.testing.clock import VirtualClock


def fetch(thing, place="kitchen"):
    return [
        f"Take [Nothing] to [{place}] and do [grasp] to [{thing}]",
        f"Take [{thing}] to [start] and do [Nothing] to [Nothing]",
    ]


def carried(thing, goal, place="kitchen"):
    return [fetch(thing, place)[0], f"Take [{thing}] to [{goal}] and do [Nothing] to [Nothing]"]


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("no, the beer", fetch("beer")),
        ("No, a beer please.", fetch("beer")),
        ("not the coke, the beer", fetch("beer")),
        ("no, not the coke but the beer", fetch("beer")),
        ("the beer, not the coke", fetch("beer")),
        ("the beer instead", fetch("beer")),
        ("sorry, I mean the beer", fetch("beer")),
        ("actually, the beer", fetch("beer")),
        ("make it a beer", fetch("beer")),
        ("no, bring me the beer", fetch("beer")),
        ("no, to Robin", carried("coke", "Robin")),
        ("no, take it to the bedroom", carried("coke", "bedroom")),
        ("to the bedroom instead", carried("coke", "bedroom")),
        ("no, from the shelf", fetch("coke", "shelf")),
        ("not the kitchen, the bedroom", fetch("coke", "bedroom")),
        ("no, go to the bathroom", ["Take [Nothing] to [bathroom] and do [Nothing] to [Nothing]"]),
    ],
)
def test_a_correction_takes_the_place_of_the_mission_under_way(talk, given, text, commands):
    reply = talk().hear(text, 10.0)
    assert (reply.kind, reply.text.partition(":")[0]) == (ReplyKind.DONE, "instead")
    assert given() == {"instead": [commands]}


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("the beer too", fetch("beer")),
        ("and a beer", fetch("beer")),
        ("a beer as well, please", fetch("beer")),
        ("what about the beer?", fetch("beer")),
        ("and to the bedroom?", carried("coke", "bedroom")),
        ("another one", fetch("coke")),
        ("another one, please", fetch("coke")),
        ("again", fetch("coke")),
        ("then go to the bathroom", ["Take [Nothing] to [bathroom] and do [Nothing] to [Nothing]"]),
        ("bring me the beer too", fetch("beer")),
    ],
)
def test_more_of_it_is_done_afterwards(talk, given, text, commands):
    reply = talk().hear(text, 10.0)
    assert (reply.kind, reply.text.partition(":")[0]) == (ReplyKind.DONE, "afterwards")
    assert given() == {"later": [commands]}


def test_a_question_is_asked_again_of_another_place(talk, given):
    talk("is there a coke in the kitchen?").hear("and in the bedroom?", 5.0)
    assert given() == {"later": [["Take [Nothing] to [bedroom] and do [find] to [coke]"]]}


def test_it_means_the_last_object(talk, given):
    talk().hear("bring it to the bedroom", 10.0)
    assert given() == {"instead": [carried("coke", "bedroom")]}


def test_new_request_runs_first(talk, given):
    reply = talk().hear("go to the bathroom", 10.0)
    assert reply.text == "first: Take [Nothing] to [bathroom] and do [Nothing] to [Nothing]"
    assert list(given()) == ["first"]


def test_a_rule_for_a_room_comes_with_the_work_that_it_is_for(talk):
    conversation = talk()
    reply = conversation.hear("keep out of the kitchen and go to the bathroom")
    going = "Take [Nothing] to [bathroom] and do [Nothing] to [Nothing]"
    assert (reply.kind, reply.text) == (ReplyKind.DONE, f"until it is done, keep out of: kitchen; first: {going}")
    assert conversation.hear("keep out of the kitchen").kind is ReplyKind.REFUSED


@pytest.mark.parametrize("text", ["no, the beer", "the beer too", "another one", "bring it to the bedroom"])
def test_after_a_minute_of_the_robots_clock_it_is_forgotten(talk, given, text):
    reply = talk().hear(text, 60.1)
    assert reply.kind in (ReplyKind.REFUSED, ReplyKind.QUESTION)
    assert given() == {}


def test_corrections_may_follow_each_other(talk, given):
    conversation = talk()
    conversation.hear("no, the beer", 10.0)
    conversation.hear("no, to Robin", 65.0)
    assert given()["instead"][-1] == carried("beer", "Robin")


@pytest.mark.parametrize("text", ["stop", "Stop!", "STOP", "please stop", "halt", "stop moving now"])
def test_stop_presses_the_button_at_once(talk, control, text):
    assert talk().hear(text).kind is ReplyKind.DONE
    assert control.state.mode is Mode.STOPPED


@pytest.mark.parametrize(
    "text", ["stop", "Thank you!", "that's enough", "We are there.", "This is my office", "you can stop now"]
)
def test_a_remark_ends_the_skill_that_waits_for_one_and_not_the_mission(talk, control, text):
    conversation, remark = talk(), control.listen("Alice")
    assert conversation.hear(text).kind is ReplyKind.DONE
    assert (remark.done(), remark.result()) == (True, text)
    assert (control.state.mode, control.poll().cancel) == (Mode.RUNNING, None)


def test_stop_said_twice_ends_the_skill_and_presses_the_button(talk, control):
    conversation, remark = talk(), control.listen("Alice")
    conversation.hear("stop")
    assert conversation.hear("stop").kind is ReplyKind.DONE
    assert (remark.result(), control.state.mode) == ("stop", Mode.STOPPED)


@pytest.mark.parametrize("text", ["freeze", "emergency stop", "stop stop", "don't move"])
def test_an_emergency_stop_presses_the_button_whoever_waits_for_a_remark(talk, control, text):
    conversation, remark = talk(), control.listen("Alice")
    conversation.hear(text)
    assert (remark.done(), control.state.mode) == (False, Mode.STOPPED)


def test_stop_presses_the_button_of_a_paused_robot_whose_skill_waits_for_a_remark(talk, control):
    conversation, remark = talk(), control.listen("Alice")
    conversation.hear("wait")
    conversation.hear("stop")
    assert (remark.done(), control.state.mode) == (False, Mode.STOPPED)


@pytest.mark.parametrize("text", ["great", "what are you doing", "cancel the mission"])
def test_other_remarks_do_not_end_a_skill(talk, control, text):
    conversation, remark = talk(), control.listen("Alice")
    conversation.hear(text)
    assert not remark.done()


@pytest.mark.parametrize(("text", "says"), [("thank you", "you are welcome"), ("we are there", "all right")])
def test_thanks_are_only_answered_while_no_skill_waits(talk, control, text, says):
    conversation = talk()
    control.listen("Alice").withdraw()
    assert (conversation.hear(text).text, control.state.mode) == (says, Mode.RUNNING)


@pytest.mark.parametrize("text", ["wait", "Wait a moment, please.", "hold on", "pause", "could you wait please"])
def test_wait_holds_and_go_on_releases(talk, control, text):
    conversation = talk()
    conversation.hear(text)
    assert control.state.mode is Mode.PAUSED
    assert conversation.hear("ok, go on").text == "I go on"
    assert control.state.mode is Mode.RUNNING


def test_go_on_releases_a_stop_that_was_told_but_not_a_pressed_button(talk, control):
    conversation = talk()
    conversation.hear("stop")
    conversation.hear("continue")
    assert control.state.mode is Mode.RUNNING
    control.stop_button("pressed on the wall")
    assert conversation.hear("go on").kind is ReplyKind.REFUSED
    assert control.state.mode is Mode.STOPPED


def test_cancel_ends_the_run(talk, control):
    talk().hear("never mind")
    assert control.poll().cancel == "told to cancel"


def test_before_the_run_it_is_said_that_it_has_not_begun(talk):
    conversation = talk()
    assert "not begun" in conversation.hear("where are you?").text
    assert "not begun" in conversation.hear("what are you doing").text


def test_after_the_run_nothing_is_begun_any_more(talk, control):
    conversation = talk()
    control.end()
    for text in ("go to the bathroom", "no, the beer", "wait", "stop", "cancel"):
        reply = conversation.hear(text)
        assert (reply.kind, "over" in reply.text) == (ReplyKind.REFUSED, True)
    assert "nothing to do" in conversation.hear("what are you doing").text


def test_an_unclear_name_is_asked_and_the_answer_begins_it(talk, given):
    conversation = talk()
    reply = conversation.hear("fetch me a cake", 5.0)
    assert (reply.kind, reply.question.candidates) == (ReplyKind.QUESTION, ("coke",))
    assert conversation.hear("yes", 10.0).kind is ReplyKind.DONE
    assert given() == {"first": [fetch("coke")]}


def test_an_answer_that_is_unclear_is_asked_again_and_no_is_taken_for_never_mind(talk, given):
    conversation = talk()
    conversation.hear("fetch me a cake", 5.0)
    again = conversation.hear("the purple unicorn", 6.0)
    assert (again.kind, again.question.candidates) == (ReplyKind.QUESTION, ("coke",))
    assert conversation.hear("no", 7.0).text == "all right, never mind"
    assert given() == {}


def test_a_request_instead_of_an_answer_is_taken(talk, given):
    conversation = talk()
    conversation.hear("fetch me a cake", 5.0)
    assert conversation.hear("go to the bathroom", 6.0).kind is ReplyKind.DONE
    assert list(given()) == ["first"]


def test_a_question_waits_for_a_minute(talk):
    conversation = talk()
    conversation.hear("fetch me a cake", 5.0)
    assert conversation.hear("yes", 66.0).kind is ReplyKind.REFUSED


def test_listener_gets_the_open_question(talk):
    heard, conversation = [], talk("go to the hall")
    conversation.listen(heard.append)
    conversation.hear("bring me the cok", 1.0)
    conversation.hear("where are you", 2.0)
    conversation.hear("never mind", 3.0)
    assert [waiting and (waiting.question.candidates, waiting.until_s) for waiting in heard] == [
        (("coke",), 61.0),
        (("coke",), 61.0),
        None,
    ]


@pytest.mark.parametrize(("text", "answer"), [("Yes.", "yes"), ("Yes, I am.", "yes"), ("No, I am Sam", "no")])
def test_a_question_of_the_mission_is_answered(talk, control, text, answer):
    conversation, clock = talk(), VirtualClock()
    asked = control.ask(Question("q1", "Is the door open?", ("yes", "no"), "", 60.0), clock)
    assert conversation.hear(text).kind is ReplyKind.DONE
    assert (asked.done(), asked.result()) == (True, answer)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("Hey Alice, wait", ReplyKind.DONE),
        ("Hey Ellis, wait", ReplyKind.DONE),
        ("wait", ReplyKind.IGNORED),
        ("Hey Bob, wait", ReplyKind.IGNORED),
        ("I told Alice to wait", ReplyKind.IGNORED),
    ],
)
def test_robot_hears_only_sentences_with_its_name_when_required(talk, text, kind):
    assert talk(require_wake=True, others=("Bob",)).hear(text).kind is kind


def test_an_answer_needs_no_name(talk):
    conversation = talk(require_wake=True)
    assert conversation.hear("Hey Alice, fetch me a cake", 5.0).kind is ReplyKind.QUESTION
    assert conversation.hear("yes", 6.0).kind is ReplyKind.DONE


def test_sentence_to_another_robot_is_ignored_without_require_wake(talk):
    assert talk().hear("Hey Bob, wait").kind is ReplyKind.IGNORED


@pytest.mark.parametrize("text", ["what can you do", "help"])
def test_it_says_what_it_can_do(talk, text):
    assert "fetch" in talk().hear(text).text


@pytest.mark.parametrize(
    "text", ["tell me a joke", "no, the unicorn", "no, no, no", "and the moon?", "dance with me", "no"]
)
def test_unsupported_request_is_refused_in_one_line(talk, given, text):
    reply = talk().hear(text, 3.0)
    assert reply.kind is ReplyKind.REFUSED
    assert "\n" not in reply.text
    assert given() == {}


@pytest.mark.parametrize(
    "text", ["", "  ", "\x00\x1b", "🙂", "把饮料拿来", "no, " * 10_000, "a" * 100_000, "not , but"]
)
def test_odd_input_is_answered_at_once(talk, given, text):
    begin = time.process_time()
    reply = talk().hear(text, 3.0)
    assert reply.text
    assert given() == {}
    assert time.process_time() - begin < 1.0


@pytest.fixture
def compiling_talk(speech, control):
    """Conversation that compiles every mission as one drive, and the steps that it compiled."""
    asked = []

    def compiled(steps, taken):
        asked.append([step.words or str(step.command) for step in steps])
        plain = [Do.from_command(Command(goal="hall"))]
        return replace(speech.compile(plain, taken), steps=tuple(steps))

    conversation = Conversation(replace(speech, compile=compiled), control)
    tree = speech.compile([Do.from_command(Command(goal="kitchen"))], frozenset())
    control.begin({"Alice": tree})
    conversation.set_mission(tree)
    return conversation, asked


WAITING = "wait until person at kitchen"


def test_a_sentence_that_waits_is_no_pause_but_a_mission(compiling_talk, control):
    conversation, asked = compiling_talk
    reply = conversation.hear("wait in the kitchen until somebody comes", 1.0)
    going = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"
    assert (reply.kind, reply.text) == (ReplyKind.DONE, f"first: {going}; {WAITING}")
    assert asked == [[going, WAITING]]
    assert control.state.mode is not Mode.PAUSED


def test_it_is_done_again_whole(compiling_talk):
    conversation, asked = compiling_talk
    conversation.hear("wait in the kitchen until somebody comes", 1.0)
    conversation.hear("again", 2.0)
    assert len(asked) == 2
    assert asked[0] == asked[1]


def test_a_part_of_it_cannot_be_changed(compiling_talk):
    conversation, _ = compiling_talk
    conversation.hear("bring me a coke if there is one in the kitchen", 1.0)
    reply = conversation.hear("no, the beer", 2.0)
    assert reply.kind is ReplyKind.REFUSED
    assert "say it again" in reply.text


def test_a_corrected_mission_is_run_to_its_end(talk, speech, control, run_tree, compiled, script):
    """The speaker asks for a beer instead of the coke while the robot drives."""
    meant = speech.understand("fetch me a coke from the kitchen", None)
    tree = speech.compile(steps_of_commands(meant.commands), frozenset())
    conversation = Conversation(speech, control)
    conversation.set_mission(tree, memory=meant.memory)
    said = {2: "where are you", 3: "what are you doing", 4: "no, go to the bathroom"}
    replies = []

    def observe(progress):
        conversation.tick(progress)
        if progress.ticks in said:
            replies.append(conversation.hear(said.pop(progress.ticks)).text)

    result = run_tree(tree, control=control, observer=observe)
    assert (result.outcome, script.begun) == (Outcome.SUCCESS, ["navigate", "detect", "navigate"])
    assert result.trees["Alice"].commands[0].goal == "bathroom"
    assert replies[0] == "I am in the hall"
    assert replies[1].startswith("I am busy with 'fetch coke': ")
    assert "detect goes on" in replies[1]


def test_an_addition_is_corrected_while_it_waits(talk, speech, control, run_tree, script):
    meant = speech.understand("go to the bedroom", None)
    tree = speech.compile(steps_of_commands(meant.commands), frozenset())
    conversation = Conversation(speech, control)
    conversation.set_mission(tree, memory=meant.memory)
    said = {1: "and to the bathroom?", 2: "no, to the kitchen"}

    def observe(progress):
        conversation.tick(progress)
        if progress.ticks in said:
            conversation.hear(said.pop(progress.ticks))

    result = run_tree(tree, control=control, observer=observe)
    assert [each.tree.mission_name for each in result.worst.preempting] == ["go kitchen"]
    assert script.begun == ["navigate", "navigate"]


def test_held_object_is_put_down_before_another_is_fetched(speech, control, run_tree, script, registry):
    meant = speech.understand("fetch me a coke from the kitchen", None)
    tree = speech.compile(steps_of_commands(meant.commands), frozenset())
    conversation = Conversation(speech, control)
    conversation.set_mission(tree, memory=meant.memory)
    replies = []

    def observe(progress):
        conversation.tick(progress)
        if not replies and progress.robots["Alice"].holding:
            replies.append(conversation.hear("no, the beer"))

    run_tree(tree, control=control, observer=observe)
    assert [str(command) for command in replies[0].commands] == [
        "Take [coke] to [counter] and do [place] to [coke]",
        *fetch("beer"),
    ]


def test_held_object_is_used_by_a_changed_request(speech, control, run_tree):
    meant = speech.understand("fetch me a coke from the kitchen", None)
    tree = speech.compile(steps_of_commands(meant.commands), frozenset())
    conversation = Conversation(speech, control)
    conversation.set_mission(tree, memory=meant.memory)
    replies = []

    def observe(progress):
        conversation.tick(progress)
        if not replies and progress.robots["Alice"].holding:
            replies.append(conversation.hear("no, to the bedroom"))

    run_tree(tree, control=control, observer=observe)
    assert [str(command) for command in replies[0].commands] == carried("coke", "bedroom")[1:]
