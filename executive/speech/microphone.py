"""Sound as it comes in, and what is heard of it while somebody still speaks."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from executive.speech.activity import Endpointer
from executive.speech.listener import HeardUtterance, Listener
from executive.speech.sound import RATE_HZ, Samples, level_db
from skills.files.errors import InputError

__all__ = ["Hearing", "follow", "microphone_blocks"]

BLOCK_S: Final = 0.1
_HINT: Final = "install alsa-utils, or record to a wav file and give that"


@dataclass(frozen=True)
class Hearing:
    """The state after one block of sound: the time (s), its level (dB below full scale), and what is being said.

    `partial` is a first reading of the sentence under way, `finished` a sentence that has just ended.
    """

    time_s: float
    level_db: float
    speaking: bool
    partial: str = ""
    finished: HeardUtterance | None = None


def follow(blocks: Iterable[Samples], listener: Listener, *, partial_every_s: float = 1.0) -> Iterator[Hearing]:
    """What is heard, block by block; all times are those of the sound, so that any source will do."""
    endpointer = Endpointer(listener.new_detector(), listener.rules)
    time_s, read_s, partial = 0.0, 0.0, ""
    for block in blocks:
        time_s += len(block) / RATE_HZ
        ended = [*map(listener.hear, endpointer.push(block))]
        if not endpointer.speaking:
            partial, read_s = "", time_s
        elif time_s - read_s >= partial_every_s:
            partial, read_s = listener.recogniser.draft(endpointer.so_far(), listener.vocabulary), time_s
        yield from (Hearing(time_s, level_db(block), False, finished=one) for one in ended if one is not None)
        yield Hearing(time_s, level_db(block), endpointer.speaking, partial)
    for utterance in endpointer.flush():
        if (last := listener.hear(utterance)) is not None:
            yield Hearing(time_s, -100.0, False, finished=last)


def microphone_blocks(*, which: Callable[[str], str | None] = shutil.which) -> Generator[Samples, None, None]:
    """The sound of the default microphone in blocks of 0.1 s, until it is closed; recorded by ALSA's `arecord`.

    Raises:
        InputError: `arecord` is not installed, or there is no microphone.
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
            told = " ".join(recorder.stderr.read().decode(errors="replace").split())
            raise InputError(f"the microphone is not heard ({told})", hint="plug one in, or give a wav file")
        finally:
            recorder.terminate()
