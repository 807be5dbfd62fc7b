"""`errand listen` recognises words and commands in recordings or at the microphone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.app.runs.signals import interrupted_by_hang_up
from executive.cli.options import takes_request
from executive.cli.output import BAD_INPUT, console_for, print_json
from executive.language.parser import load_parser
from executive.language.understand import Status, Understanding
from executive.mission.request import Request
from executive.speech.activity import load_detector
from executive.speech.hearing import Reader, refuse_similar_names, spoken_phrases
from executive.speech.listener import HeardUtterance, Hearing, Listener, Recording, follow, microphone_blocks
from executive.speech.recogniser import Vocabulary, read_vocabulary, vocabulary_of_world
from executive.speech.voice import Voice, installed_voice
from executive.speech.whisper import load_whisper
from executive.words.knowledge import Knowledge
from executive.words.mission import DEFAULT_WORLD
from executive.words.robot_config import RobotConfig, display_name
from executive.words.steps import steps_to_yaml
from skills.inputs.errors import InputError, listing

_METER_WIDTH = 24
_QUIETEST_DB = -60.0


@takes_request("world", "robots")
def listen(
    request: Request,
    files: Annotated[list[Path] | None, typer.Argument(metavar="FILE...", show_default=False)] = None,
    mic: Annotated[bool, typer.Option("--mic", help="Listen to the microphone until Ctrl-C.")] = False,
    open_words: Annotated[bool, typer.Option("--open", help="Ground no names in a world.")] = False,
    no_wake: Annotated[bool, typer.Option("--no-wake", help="Take sentences without the robot's name.")] = False,
    vocabulary: Annotated[
        Path | None, typer.Option(help="A text file with one name on each line, which replaces the names of the world.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Name of the robot; by default the world's robot.")] = None,
    jsonl: Annotated[bool, typer.Option("--jsonl", help="One JSON object for each file.")] = False,
) -> None:
    """Recognises sentences in recordings or at the microphone, and shows the commands that they mean."""
    if mic == bool(files):
        raise InputError("errand listen takes recordings or --mic", hint="try: errand listen request.wav")
    knowledge = knowledge_of(open_world(request.world or DEFAULT_WORLD))
    several = called_robots(request.robots, knowledge) if robot is None else ()
    if (robot is not None and request.robots) or (open_words and several):
        what = "--robots stands without --robot and --open"
        raise InputError(what, hint="what is said to several robots is understood in a world")
    listener = listener_for(
        knowledge,
        open_words=open_words,
        require_wake=not no_wake,
        vocabulary=vocabulary,
        robot_name=robot,
        robots=several,
    )
    if mic:
        _follow_microphone(listener)
        return
    answers = [_answer(listener, file, jsonl=jsonl) for file in files or ()]
    if any(answer is None or not (jsonl or answer.status is Status.OK) for answer in answers):
        raise typer.Exit(BAD_INPUT)


def listener_for(
    knowledge: Knowledge,
    *,
    open_words: bool = False,
    require_wake: bool = True,
    vocabulary: Path | None = None,
    robot_name: str | None = None,
    robots: Sequence[str] = (),
) -> Listener:
    """Builds a listener for the robot of a world, or for several robots, and loads the recogniser.

    Args:
        knowledge: knowledge of the world, which contains its names.
        open_words: whether to accept names that the world does not have.
        require_wake: whether a sentence must call the robot by name.
        vocabulary: a file of names that replace the names in the world.
        robot_name: name of the robot, which replaces the name in `knowledge`.
        robots: names of several robots, which replace the only robot.

    Raises:
        InputError: the extra `speech` is not installed, the vocabulary cannot be read, or names of robots sound alike.
    """
    names = tuple(robots) or (robot_name or knowledge.robot.name,)
    refuse_similar_names(robots)
    plain = vocabulary_of_world(knowledge, called=False) if vocabulary is None else read_vocabulary(vocabulary, None)
    called = (names[0], names[1:]) if require_wake else (None, ())
    words = Vocabulary((*plain.names, *(names if require_wake or robots else ())), *called)
    world, others = None if open_words else knowledge, () if robots else tuple(knowledge.robot.others)
    reader = Reader(load_parser(), world, words, names, require_wake, others)
    return Listener(load_whisper(), load_detector, reader, spoken_phrases(words))


def called_robots(robots: Sequence[RobotConfig], knowledge: Knowledge) -> tuple[str, ...]:
    """Returns the spoken names of several robots: the given names, else those in the world."""
    return tuple(each.name for each in robots) or tuple(map(display_name, knowledge.robots or ()))


def hear_request(wav: Path, request: Request, *, console: Console) -> str:
    """Recognises the sentence in a recording, for the request's robots and world, and prints the sentence.

    Raises:
        InputError: the request already has a sentence or a file, the extra `speech` is not installed, the recording
            cannot be read, or it has no speech.
    """
    if request.file is not None or request.sentence is not None:
        raise InputError("--listen gives the sentence", hint="leave out --say and the mission file")
    knowledge = knowledge_of(open_world(request.world or DEFAULT_WORLD))
    robots = called_robots(request.robots, knowledge)
    listener = listener_for(knowledge, require_wake=request.require_wake is not False, robots=robots)
    recording = listener.hear_file(wav)
    if not recording.heard:
        raise InputError(recording.reason or "", hint="speak louder, or nearer to the microphone", file=wav)
    sentence = " ".join(one.meant.text for one in recording.decisive)
    console.print(Text(f"heard: {sentence}"))
    return sentence


def answer_line(meaning: Understanding) -> str:
    """Returns the robot's answer to a sentence, in one line."""
    if meaning.status is Status.OK:
        return "All right: " + "; ".join(steps_to_yaml(meaning.steps) or map(str, meaning.commands))
    return (meaning.reason or "I did not understand.").split(";")[0]


def show_hearing(hearings: Iterable[Hearing], console: Console, voice: Voice) -> None:
    """Shows sound level and recognised words for each block, and answers each sentence at its end."""
    with Live(console=console, refresh_per_second=8, transient=True) as live:
        for hearing in hearings:
            live.update(_meter(hearing))
            if hearing.finished is not None:
                _show_heard(hearing.finished, console, voice)


def _show_heard(heard: HeardUtterance, console: Console, voice: Voice) -> None:
    meaning = heard.meant
    console.print(Text(f"{heard.start_s:7.1f} s  {heard.text}"))
    console.print(Text(f"           {answer_line(meaning)}", style="green" if meaning.commands else "yellow"))
    if meaning.status is not Status.NOT_ADDRESSED:
        # the text form of commands is not for reading aloud
        voice.say("All right." if meaning.status is Status.OK else answer_line(meaning))


def _meter(hearing: Hearing) -> Text:
    """Returns a bar of the sound level, and the words so far."""
    share = max(0.0, 1.0 - hearing.level_db / _QUIETEST_DB)
    filled = min(round(share * _METER_WIDTH), _METER_WIDTH)
    bar = Text("█" * filled + "░" * (_METER_WIDTH - filled), style="green" if hearing.speaking else "dim")
    return bar.append(f" {hearing.level_db:6.1f} dB  ").append(hearing.partial, style="italic")


def _follow_microphone(listener: Listener) -> None:
    console = console_for(as_json=False)
    calls = listing((f'"Hey {name}, ..."' for name in listener.reader.robots), last="or")
    called = calls if listener.reader.require_wake else "your request"
    console.print(f"Listening; say {called}. Ctrl-C ends.", markup=False)
    with suppress(KeyboardInterrupt), interrupted_by_hang_up(), closing(microphone_blocks()) as blocks:
        show_hearing(follow(blocks, listener), console, installed_voice())


def _answer(listener: Listener, file: Path, *, jsonl: bool) -> Recording | None:
    """Shows the sentences in a file; returns None if it cannot be read."""
    try:
        recording = listener.hear_file(file)
    except InputError as error:
        typer.echo(f"errand: {error}", err=True)
        if jsonl:
            nothing = {
                "transcript": "",
                "addressed": False,
                "status": Status.REFUSED.value,
                "commands": [],
                "mission": [],
            }
            print_json({"file": str(file), **nothing, "reason": str(error), "notes": [], "utterances": []})
        return None
    if jsonl:
        print_json(recording.to_json())
    else:
        _show_recording(recording)
    return recording


def _show_recording(recording: Recording) -> None:
    """Prints transcript and commands on standard output, or the reason on standard error."""
    typer.echo(f"{recording.file}: {recording.transcript}")
    for note in recording.notes:
        typer.echo(f"  {note}")
    if recording.status is not Status.OK:
        typer.echo(f"errand: {recording.file}: {recording.reason}", err=True)
    for part in recording.parts:
        who = part.robot if isinstance(part.robot, str) else f"{part.robot.value} of the robots"
        for line in steps_to_yaml(part.meaning.steps) or map(str, part.meaning.commands):
            typer.echo(f"  {who}: {line}")
    for line in () if recording.parts else steps_to_yaml(recording.steps) or map(str, recording.commands):
        typer.echo(f"  {line}")
