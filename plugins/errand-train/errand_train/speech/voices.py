"""Synthetic voices of this machine that speak the training sentences: Debian's flite, espeak-ng and festival.

The voices of the benchmark (`tests/benchmarks/speech/voices.py`) are not among them.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from executive.speech.sound import Samples, concatenate, read_sound
from skills.inputs.errors import InputError

__all__ = ["Speaker", "draw_speaker", "speak", "speakers"]

_ACCENTS: Final = ("en-us", "en-us", "en-gb", "en-gb", "en-us-nyc", "en-gb-x-gbclan", "en-gb-x-gbcwmd")
_VARIANTS: Final = (
    *("", "", "+m1", "+m2", "+m3", "+m4", "+m5", "+m6", "+m7", "+f1", "+f2", "+f4", "+f5"),
    *("+klatt", "+klatt2", "+klatt3", "+klatt4", "+adam", "+steph", "+linda", "+belinda", "+john", "+rob", "+michel"),
)


@dataclass(frozen=True)
class Speaker:
    """A kind of voice: its program, its weight in draws, and the arguments of one such voice (with {wav})."""

    name: str
    program: str
    weight: float
    arguments: Callable[[random.Random], tuple[str, ...]]


def speakers(left_out: tuple[str, ...] = ()) -> tuple[Speaker, ...]:
    """Finds the kinds of voices of this machine, without those named.

    Raises:
        InputError: none of the programs is installed.
    """
    found = tuple(one for one in _SPEAKERS if shutil.which(one.program) and one.name not in left_out)
    if not found:
        hint = "install them: apt-get install flite festival espeak-ng"
        raise InputError("no synthetic voice to train with is installed", hint=hint)
    return found


def draw_speaker(found: tuple[Speaker, ...], draw: random.Random) -> Speaker:
    """Draws a kind of voice by weight."""
    return draw.choices(found, [one.weight for one in found])[0]


def speak(speaker: Speaker, text: str, draw: random.Random) -> Samples:
    """Synthesises a text by a voice of a kind, at RATE_HZ."""
    with tempfile.TemporaryDirectory() as folder:
        wav = Path(folder) / "spoken.wav"
        command = [speaker.program, *(part.format(wav=wav) for part in speaker.arguments(draw))]
        subprocess.run(command, input=text.encode(), check=True, capture_output=True)
        return concatenate(read_sound(wav))


def _espeak(draw: random.Random) -> tuple[str, ...]:
    voice = draw.choice(_ACCENTS) + draw.choice(_VARIANTS)
    pitch, speed = str(draw.randint(25, 80)), str(draw.randint(120, 190))
    return ("-v", voice, "-p", pitch, "-s", speed, "-w", "{wav}", "--stdin")


def _flite(voice: str) -> Callable[[random.Random], tuple[str, ...]]:
    def arguments(draw: random.Random) -> tuple[str, ...]:
        stretch = f"duration_stretch={draw.uniform(0.8, 1.3):.2f}"
        pitch = f"int_f0_target_mean={draw.uniform(80.0, 190.0):.0f}"
        return ("-voice", voice, "--setf", stretch, "--setf", pitch, "-f", "/dev/stdin", "-o", "{wav}")

    return arguments


def _festival(draw: random.Random) -> tuple[str, ...]:
    stretch = f"(Parameter.set 'Duration_Stretch {draw.uniform(0.8, 1.3):.2f})"
    return ("-o", "{wav}", "-eval", "(voice_kal_diphone)", "-eval", stretch)


_SPEAKERS: Final = (
    Speaker("flite-rms", "flite", 0.36, _flite("rms")),
    Speaker("flite-kal16", "flite", 0.2, _flite("kal16")),
    Speaker("espeak", "espeak-ng", 0.3, _espeak),
    Speaker("festival-kal", "text2wave", 0.14, _festival),
)
