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
from tests.tables import yaml_beside

BEGUN = "fetch me a coke from the kitchen"


def fetch(thing, place="kitchen"):
    return [
        f"Take [Nothing] to [{place}] and do [grasp] to [{thing}]",
        f"Take [{thing}] to [start] and do [Nothing] to [Nothing]",
    ]


def carried(thing, goal, place="kitchen"):
    return [fetch(thing, place)[0], f"Take [{thing}] to [{goal}] and do [Nothing] to [Nothing]"]


GO = "Take [Nothing] to [{}] and do [Nothing] to [Nothing]"


def commands_of(words):
    """The commands that a dialogue names in short."""
    match words.split():
        case ["fetch", thing, *place]:
            return fetch(thing, *place[1:])
        case ["carry", thing, "to", goal]:
            return carried(thing, goal)
        case ["find", thing, "in", place]:
            return [f"Take [Nothing] to [{place}] and do [find] to [{thing}]"]
        case ["go", place]:
            return [GO.format(place)]


ACTIONS = {
    "end the run": lambda hands: hands.end(),
    "press the button": lambda hands: hands.stop_button("on the wall"),
    "stop listening": lambda hands: hands.listen("Alice").withdraw(),
}
DIALOGUES = [
    pytest.param(dialogue, text, id=f"{dialogue['name']} {text}".strip())
    for dialogue in yaml_beside(__file__, "dialogues.yaml")
    for text in dialogue.get("said", [""])
]


@pytest.mark.parametrize(("dialogue", "text"), DIALOGUES)
def test_a_dialogue_has_the_replies_and_the_effects_that_it_says(talk, control, given, dialogue, text):
    conversation = talk(dialogue.get("begin", BEGUN), **dialogue.get("options", {}))
    remark = control.listen("Alice") if "listening" in dialogue else None
    for turn in dialogue["turns"]:
        ACTIONS.get(turn.get("do"), lambda hands: None)(control)
        reply = conversation.hear(turn.get("say", text), float(turn.get("at", 0.0)))
        assert reply.kind.value in turn.get("kind", reply.kind.value).split(" or "), reply
        assert turn.get("text", reply.text) == reply.text
        assert turn.get("has", "") in reply.text
        assert len(reply.text.splitlines()) == turn.get("lines", len(reply.text.splitlines()))
        assert "candidates" not in turn or reply.question.candidates == tuple(turn["candidates"])
        assert control.state.mode.value == turn.get("mode", control.state.mode.value)
    assert control.state.mode.value == dialogue.get("mode", control.state.mode.value)
    if remark is not None:
        heard = text if dialogue["listening"] == "said" else dialogue["listening"]
        assert (remark.done(), remark.result() if remark.done() else None) == (heard is not None, heard)
    if "given" in dialogue:
        assert given() == {turn: list(map(commands_of, missions)) for turn, missions in dialogue["given"].items()}
    elif "mode" in dialogue or "cancel" in dialogue:
        assert control.poll().cancel == dialogue.get("cancel")


def test_listener_gets_the_open_question(talk):
    heard, conversation = [], talk("go to the hall")
    conversation.listen(heard.append)
    conversation.hear("bring me the cok", 1.0)
    conversation.hear("where are you", 2.0)
    conversation.hear("never mind", 3.0)
    told = [waiting and (waiting.question.candidates, waiting.until_s) for waiting in heard]
    assert told == [(("coke",), 61.0), (("coke",), 61.0), None]


@pytest.mark.parametrize(("text", "answer"), [("Yes.", "yes"), ("Yes, I am.", "yes"), ("No, I am Sam", "no")])
def test_a_question_of_the_mission_is_answered(talk, control, text, answer):
    conversation, clock = talk(), VirtualClock()
    asked = control.ask(Question("q1", "Is the door open?", ("yes", "no"), "", 60.0), clock)
    assert conversation.hear(text).kind is ReplyKind.DONE
    assert (asked.done(), asked.result()) == (True, answer)


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


def test_a_sentence_that_waits_is_a_mission_that_is_done_again_whole(compiling_talk, control):
    conversation, asked = compiling_talk
    reply = conversation.hear("wait in the kitchen until somebody comes", 1.0)
    going = GO.format("kitchen")
    assert (reply.kind, reply.text) == (ReplyKind.DONE, f"first: {going}; {WAITING}")
    assert control.state.mode is not Mode.PAUSED
    conversation.hear("again", 2.0)
    assert asked == [[going, WAITING]] * 2


def test_a_part_of_it_cannot_be_changed(compiling_talk):
    conversation, _ = compiling_talk
    conversation.hear("bring me a coke if there is one in the kitchen", 1.0)
    reply = conversation.hear("no, the beer", 2.0)
    assert (reply.kind, "say it again" in reply.text) == (ReplyKind.REFUSED, True)


@pytest.fixture
def converse(speech, control, run_tree):
    """Runs the mission of a sentence; `say` gives what is said after a tick. Returns the result and the replies."""

    def run(sentence, say, later_s=0.0):
        meant, replies = speech.understand(sentence, None), []
        tree = speech.compile(steps_of_commands(meant.commands), frozenset())
        conversation = Conversation(speech, control)
        conversation.set_mission(tree, memory=meant.memory)

        def observe(progress):
            conversation.tick(progress)
            if (text := say(progress)) is not None:
                replies.append(conversation.hear(text, progress.now_s + later_s))

        return run_tree(tree, control=control, observer=observe), replies

    return run


def test_a_corrected_mission_is_run_to_its_end(converse, script):
    """The speaker asks for another place while the robot drives."""
    said = {2: "where are you", 3: "what are you doing", 4: "no, go to the bathroom"}
    result, replies = converse(BEGUN, lambda progress: said.get(progress.ticks))
    assert (result.outcome, script.begun) == (Outcome.SUCCESS, ["navigate", "detect", "navigate"])
    assert (result.trees["Alice"].commands[0].goal, replies[0].text) == ("bathroom", "I am in the hall")
    assert replies[1].text.startswith("I am busy with 'fetch coke': ")
    assert "detect goes on" in replies[1].text


def test_the_robot_says_what_it_has_done(converse):
    """The speaker asks for it again and again, from the first step on."""
    _, replies = converse(
        "go to the bedroom and then to the bathroom", lambda progress: "have you been to the bedroom yet?"
    )
    told = [reply.text for reply in replies]
    assert (told[0], told[-1]) == ("no, not so far", "yes, I have done that")
    assert {reply.kind for reply in replies} == {ReplyKind.ANSWER}


@pytest.mark.parametrize(
    ("asked", "kind", "text"),
    [
        ("did you bring me a coke", ReplyKind.ANSWER, "no, not so far"),
        ("have you already brought it to Robin?", ReplyKind.ANSWER, "no, not so far"),
        ("have you fetched the dragon", ReplyKind.REFUSED, "dragon"),
        ("did you go to the hall three times", ReplyKind.REFUSED, "I know of single steps only"),
        ("have you seen the coke", ReplyKind.DONE, "first: "),
    ],
)
def test_a_question_about_the_past_begins_nothing(talk, asked, kind, text):
    reply = talk().hear(asked, 1.0)
    assert (reply.kind, text in reply.text) == (kind, True), reply


def test_an_addition_is_corrected_while_it_waits(converse, script):
    said = {1: "and to the bathroom?", 2: "no, to the kitchen"}
    result, _ = converse("go to the bedroom", lambda progress: said.get(progress.ticks))
    assert [each.tree.mission_name for each in result.worst.preempting] == ["go kitchen"]
    assert script.begun == ["navigate", "navigate"]


# What is said as soon as the robot holds the coke -> what it then does.
HELD = [
    ("no, the beer", ["Take [coke] to [counter] and do [place] to [coke]", *fetch("beer")]),
    ("no, to the bedroom", carried("coke", "bedroom")[1:]),
    ("no, bring it to the bedroom instead", carried("coke", "bedroom")[1:]),
    ("no, bring it to the bedroom", carried("coke", "bedroom")[1:]),
]


def test_it_is_the_held_object_also_after_a_minute(converse):
    left = ["no, bring it to the bedroom instead"]
    says = converse(BEGUN, lambda now: left.pop() if left and now.robots["Alice"].holding else None, later_s=100.0)
    assert [str(command) for command in says[1][0].commands] == carried("coke", "bedroom")[1:]


@pytest.mark.parametrize(("text", "commands"), HELD)
def test_a_held_object_is_used_by_a_changed_request_or_put_down_before_another_is_fetched(converse, text, commands):
    left = [text]
    _, replies = converse(BEGUN, lambda progress: left.pop() if left and progress.robots["Alice"].holding else None)
    assert [str(command) for command in replies[0].commands] == commands
