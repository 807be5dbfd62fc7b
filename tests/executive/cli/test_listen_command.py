"""`errand listen` and `errand run --listen`, with a recogniser that follows a script."""

import io
import json
from types import SimpleNamespace

import pytest
from made_speech import silence, speech_like, write_wav
from rich.console import Console

import executive.cli.listen_command as listen_command
from executive.cli.listen_command import answer_line, hear_request, show_hearing
from executive.language.understand import Status, Understanding
from executive.mission.request import Request
from executive.speech.listener import follow
from executive.words.robot_config import RobotConfig
from skills.inputs.errors import InputError
from tests.executive.cli.calls import done, errand

GO = "Hey Alice, go to the kitchen."
KITCHEN = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"
KEYS = {"file", "transcript", "addressed", "status", "commands", "reason"}


def _lines(result):
    return [json.loads(line) for line in result.stdout.splitlines()]


def test_transcript_and_commands_are_shown(says, wav):
    says(GO)
    result = done("listen", wav)
    assert GO in result.stdout and KITCHEN in result.stdout


def test_each_file_is_one_line_for_scripts(says, wav):
    says(GO, "What a day.")
    first, second = _lines(errand("listen", wav, wav, "--jsonl"))
    assert set(first) >= KEYS
    assert (first["file"], first["addressed"], first["status"]) == (str(wav), True, "ok")
    assert (second["addressed"], second["status"], second["commands"]) == (False, "not_addressed", [])


def test_without_the_wake_phrase_only_when_it_may_be_left_out(says, wav):
    says("Go to the kitchen.")
    assert errand("listen", wav).exit_code == 2
    says("Go to the kitchen.")
    done("listen", wav, "--no-wake")


def test_open_words_stay_as_spoken_and_are_matched_to_the_vocabulary(says, wav, tmp_path):
    names = tmp_path / "names.txt"
    names.write_text("big dish\nwashing machine\n")
    says("Take the big fish to the washing machine.")
    (told,) = _lines(errand("listen", wav, "--jsonl", "--open", "--no-wake", "--vocabulary", names))
    assert (told["commands"][-1]["item"], told["commands"][-1]["goal"]) == ("big dish", "washing machine")


# What is heard; what each robot is to do there.
CALLED = [
    ("Hey Bob, go to the kitchen.", {"Bob": "kitchen"}),
    ("Hey Bop, go to the kitchen.", {"Bob": "kitchen"}),
    ("Hey everyone, go to the kitchen.", {"all": "kitchen"}),
    ("Alice, go to the kitchen, and Bob, go to the office.", {"Alice": "kitchen", "Bob": "office"}),
]


@pytest.mark.parametrize(("heard", "goals"), CALLED)
def test_any_of_several_robots_may_be_called(says, wav, heard, goals):
    says(heard)
    (told,) = _lines(errand("listen", wav, "--jsonl", "--robots", "alice=spot,bob=fetch"))
    assert (told["status"], told["addressed"]) == ("ok", True), told["reason"]
    found = {part["robot"]: part["meaning"]["commands"][0]["goal"] for part in told["parts"]}
    assert found == goals


def test_the_commands_of_each_robot_are_shown(says, wav):
    says("Hey Bob, go to the kitchen.")
    assert f"  Bob: {KITCHEN}" in errand("listen", wav, "--robots", "alice=spot,bob=fetch").stdout.splitlines()


def test_a_call_to_a_robot_that_is_not_there_is_to_none_of_them(says, wav):
    says("Hey Carl, go to the kitchen.")
    (told,) = _lines(errand("listen", wav, "--jsonl", "--robots", "alice=spot,bob=fetch"))
    assert (told["status"], told["commands"], "Carl" in told["reason"]) == ("not_addressed", [], True)


def test_a_run_with_several_robots_hears_the_one_that_is_called(says, wav):
    says("Hey Bob, go to the kitchen.")
    robots = (RobotConfig("Alice", "spot"), RobotConfig("Bob", "fetch"))
    console = Console(file=io.StringIO())
    assert hear_request(wav, Request(robots=robots), console=console) == ("Hey Bob, go to the kitchen.")


def test_the_robot_may_have_another_name(says, wav):
    says("Hey Bob, go to the kitchen.")
    (told,) = _lines(errand("listen", wav, "--jsonl", "--robot", "Bob"))
    assert told["addressed"] and told["status"] == "ok"


def test_a_broken_file_is_told_and_the_others_are_heard(says, wav, tmp_path):
    broken = tmp_path / "b.wav"
    broken.write_text("Hey Alice")
    says(GO)
    result = errand("listen", broken, wav, "--jsonl")
    bad, good = _lines(result)
    assert result.exit_code == 2
    assert set(bad) >= KEYS and "no recording" in bad["reason"] and str(broken) in result.stderr
    assert good["status"] == "ok"


def test_a_silent_file_is_refused(says, tmp_path):
    says()
    (told,) = _lines(errand("listen", write_wav(tmp_path / "s.wav", silence(2.0)), "--jsonl"))
    assert (told["status"], told["reason"]) == ("refused", "the recording is silent")


def test_the_request_to_run_is_what_was_heard(says, wav):
    says("High Alice, go to the kitchen.")
    console = Console(file=io.StringIO())
    assert hear_request(wav, Request(world="flat"), console=console) == "Hey Alice, go to the kitchen."
    assert "heard: Hey Alice" in console.file.getvalue()


def test_there_is_no_second_request_beside_the_one_heard(wav):
    with pytest.raises(InputError, match="gives the sentence"):
        hear_request(wav, Request("go home"), console=Console(file=io.StringIO()))


def test_a_silent_request_is_refused_with_its_file(says, tmp_path):
    says()
    file = write_wav(tmp_path / "s.wav", silence(1.0))
    result = errand("run", "--listen", str(file), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2 and "silent" in result.stderr and str(file) in result.stderr


def test_the_microphones_sentences_are_answered_in_text_and_aloud(says, flat_listener):
    sound = speech_like(0.5, 2.0, 1.5, 2.0, 1.5)
    console, said = Console(file=io.StringIO(), width=120), []
    blocks = (sound[at : at + 1600] for at in range(0, len(sound), 1600))
    show_hearing(follow(blocks, flat_listener(GO, "Go to the hall.")), console, SimpleNamespace(say=said.append))
    shown = console.file.getvalue()
    assert GO in shown and f"All right: {KITCHEN}" in shown and "name was not said" in shown
    assert said == ["All right."]


@pytest.fixture
def flat_listener(says):
    def listener(*texts):
        says(*texts)
        knowledge = listen_command.knowledge_of(listen_command.open_world("flat"))
        return listen_command.listener_for(knowledge)

    return listener


def test_answers_are_one_line():
    refused = Understanding("", Status.REFUSED, reason="I know no object 'x'; known: y")
    assert answer_line(refused) == "I know no object 'x'"
    assert answer_line(Understanding("", Status.REFUSED)) == "I did not understand."


def test_a_sentence_with_a_condition_is_shown_and_written_as_its_mission(says, wav):
    says("Hey Alice, go to the kitchen if there is a beer in the hall.")
    (told,) = _lines(errand("listen", wav, "--jsonl"))
    assert told["mission"][0].keys() == {"if", "then"}
    assert "- if: {object: beer, at: hall}" in errand("listen", wav).stdout
