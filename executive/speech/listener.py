"""Listens to a recording or a microphone: recognises and understands one utterance after another."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from executive.language.spelling import SoundAlikes
from executive.language.understand import Part, Status, Understanding
from executive.speech.activity import Endpointer, PauseRules, SpeechDetector, Utterance
from executive.speech.hearing import Reader
from executive.speech.interpret import choose_opening, interpret
from executive.speech.recogniser import Recogniser
from executive.speech.sound import RATE_HZ, Loudness, Samples, concatenate, level_db, read_sound
from executive.words.command import Command
from executive.words.step import Step
from executive.words.steps import steps_to_data
from skills.inputs.errors import InputError

NOBODY_SPOKE: Final = "nobody is heard to speak"
SILENT: Final = "the recording is silent"
CLIPPED: Final = "the recording is clipped (too loud for its scale): words may be lost"


@dataclass(frozen=True)
class HeardUtterance:
    """Utterance (s from the beginning of the sound) with its meaning."""

    start_s: float
    end_s: float
    text: str
    meant: Understanding


@dataclass(frozen=True)
class Listener:
    """Converts sound to commands. `new_detector` returns a speech detector in its initial state."""

    recogniser: Recogniser
    new_detector: Callable[[], SpeechDetector]
    reader: Reader
    alikes: SoundAlikes
    rules: PauseRules = field(default_factory=PauseRules)

    def hear_file(self, wav: Path) -> Recording:
        """Listens to a recording of any length, and holds only seconds of it in memory.

        Raises:
            InputError: see `read_sound`.
        """
        loudness = Loudness()

        def measured() -> Iterator[Samples]:
            nonlocal loudness
            for block in read_sound(wav):
                loudness = loudness.with_block(block)
                yield block

        heard = tuple(filter(None, map(self.hear, join_utterances(self.utterances(measured()), self.rules.most_s))))
        if not loudness.count:
            raise InputError("it holds no sound", hint="record again", file=wav)
        return Recording(str(wav), heard, loudness)

    def utterances(self, blocks: Iterable[Samples]) -> Iterator[Utterance]:
        """Yields the utterances in a stream of sound."""
        endpointer = Endpointer(self.new_detector(), self.rules)
        for block in blocks:
            yield from endpointer.push(block)
        yield from endpointer.flush()

    def hear(self, utterance: Utterance) -> HeardUtterance | None:
        """Recognises and understands an utterance; None when it is no speech."""
        recognition = self.recogniser.transcribe(utterance.samples, self.reader.vocabulary)
        best = interpret(recognition, self.reader.read, self.alikes)
        if best is None:
            return None
        text, meant = best.text, best.meaning
        if meant.addressed:
            text = choose_opening(recognition, text, self.reader.robots, self.reader.calls)
            meant = meant if text == best.text else self.reader.read(text).meaning
        return HeardUtterance(utterance.start_s, utterance.end_s, text, meant)


@dataclass(frozen=True)
class Recording:
    """Utterances in a recording, with their meanings."""

    file: str
    heard: tuple[HeardUtterance, ...]
    loudness: Loudness

    @property
    def transcript(self) -> str:
        """Text of all utterances."""
        return " ".join(one.text for one in self.heard)

    @property
    def addressed(self) -> bool:
        """Returns whether the robot was called."""
        return any(one.meant.addressed for one in self.heard)

    @property
    def decisive(self) -> tuple[HeardUtterance, ...]:
        """Utterances that count: those addressed to the robot, or the first one if none is."""
        addressed = tuple(one for one in self.heard if one.meant.status is not Status.NOT_ADDRESSED)
        return addressed or self.heard[:1]

    @property
    def status(self) -> Status:
        """Status OK if all decisive utterances are OK, else the status of the first that is not."""
        states = [one.meant.status for one in self.decisive]
        return next((state for state in states if state is not Status.OK), Status.OK if states else Status.REFUSED)

    @property
    def commands(self) -> tuple[Command, ...]:
        """Commands from all utterances; empty if any utterance was not understood."""
        if self.status is not Status.OK:
            return ()
        return tuple(command for one in self.decisive for command in one.meant.commands)

    @property
    def steps(self) -> tuple[Step, ...]:
        """Mission of all utterances, if one has conditions, loops or waits; empty if any was not understood."""
        if self.status is not Status.OK or not any(one.meant.steps for one in self.decisive):
            return ()
        return tuple(step for one in self.decisive for step in one.meant.all_steps)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Part of the mission for each of several robots; empty if any utterance was not understood."""
        return tuple(part for one in self.decisive for part in one.meant.parts) if self.status is Status.OK else ()

    @property
    def reason(self) -> str | None:
        """Reason why there are no commands."""
        if not self.heard:
            return SILENT if self.loudness.silent else NOBODY_SPOKE
        return next(filter(None, (one.meant.reason for one in self.decisive)), None)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the quality of the sound, and on words that were taken for known names."""
        clipped = (CLIPPED,) if self.loudness.much_clipped else ()
        return (*clipped, *(note for one in self.decisive for note in one.meant.notes))

    def to_json(self) -> dict[str, Any]:
        """Returns the answer as JSON values."""
        return {
            "file": self.file,
            "transcript": self.transcript,
            "addressed": self.addressed,
            "status": self.status.value,
            "commands": [command.to_json() for command in self.commands],
            "mission": steps_to_data(self.steps),
            "reason": self.reason,
            "notes": list(self.notes),
            **({"parts": [part.to_json() for part in self.parts]} if self.parts else {}),
            "utterances": [
                {"start_s": round(one.start_s, 2), "end_s": round(one.end_s, 2), "text": one.text} for one in self.heard
            ],
        }


def join_utterances(utterances: Iterable[Utterance], most_s: float) -> Iterator[Utterance]:
    """Joins utterances that together last no longer than `most_s`: a request with pauses for thought.

    If they last longer, each stays an utterance of its own.
    """
    held = list[Utterance]()
    length_s = 0.0
    rest = iter(utterances)
    for utterance in rest:
        held.append(utterance)
        length_s += utterance.length_s
        if length_s > most_s:
            yield from held
            yield from rest
            return
    if held:
        yield Utterance(concatenate(one.samples for one in held), held[0].start_s, held[-1].end_s)


BLOCK_S: Final = 0.1
_HINT: Final = "install alsa-utils, or record to a wav file and give that"


@dataclass(frozen=True)
class Hearing:
    """State after one block of sound: time (s), level (dB below full scale), and whether somebody speaks.

    `partial` is a first transcript of the sentence under way, `finished` is a sentence that has just ended.
    """

    time_s: float
    level_db: float
    speaking: bool
    partial: str = ""
    finished: HeardUtterance | None = None


def follow(blocks: Iterable[Samples], listener: Listener, *, partial_every_s: float = 1.0) -> Iterator[Hearing]:
    """Listens block by block; all times are counted in the sound, so that the blocks may come at any speed."""
    endpointer = Endpointer(listener.new_detector(), listener.rules)
    time_s, read_s, partial = 0.0, 0.0, ""
    for block in blocks:
        time_s += len(block) / RATE_HZ
        ended = [*map(listener.hear, endpointer.push(block))]
        if not endpointer.speaking:
            partial, read_s = "", time_s
        elif time_s - read_s >= partial_every_s:
            sound, words = endpointer.current_sound(), listener.reader.vocabulary
            partial, read_s = listener.recogniser.partial_transcript(sound, words), time_s
        yield from (Hearing(time_s, level_db(block), False, finished=one) for one in ended if one is not None)
        yield Hearing(time_s, level_db(block), endpointer.speaking, partial)
    for utterance in endpointer.flush():
        if (last := listener.hear(utterance)) is not None:
            yield Hearing(time_s, -100.0, False, finished=last)


def microphone_blocks(*, which: Callable[[str], str | None] = shutil.which) -> Generator[Samples, None, None]:
    """Records the default microphone in blocks of 0.1 s with ALSA's `arecord`, until the iterator is closed.

    Raises InputError when `arecord` is not installed, or there is no microphone.
    """
    program = which("arecord")
    if program is None:
        raise InputError("a microphone needs the program arecord", hint=_HINT)
    form = ("--quiet", "--format=S16_LE", f"--rate={RATE_HZ}", "--channels=1", "--file-type=raw")
    with subprocess.Popen((program, *form), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as recorder:
        assert recorder.stdout is not None and recorder.stderr is not None
        try:
            size = round(BLOCK_S * RATE_HZ) * 2
            while len(raw := recorder.stdout.read(size)) == size:
                yield np.frombuffer(raw, "<i2").astype(np.float32) / 32768.0
            errors = " ".join(recorder.stderr.read().decode(errors="replace").split())
            raise InputError(f"the microphone is not heard ({errors})", hint="plug one in, or give a wav file")
        finally:
            recorder.terminate()
