"""The robot's voice: what it answers, aloud where a synthesiser is installed."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from typing import Final, Protocol

__all__ = ["EspeakVoice", "Silence", "Voice", "installed_voice"]


class Voice(Protocol):
    """Says something aloud. It never fails and never waits for the end."""

    def say(self, text: str) -> None:
        """Begin to say `text`."""
        ...


class Silence:
    """No voice: says nothing."""

    def say(self, text: str) -> None:
        """Do nothing."""


class EspeakVoice:
    """Speaks through the program `espeak-ng`. While it still speaks, more is left unsaid."""

    _LONGEST: Final = 300

    def __init__(self, program: str) -> None:
        self._program = program
        self._speaking: subprocess.Popen[bytes] | None = None

    def say(self, text: str) -> None:
        """Begin to say `text`, at most 300 letters of it."""
        if self._speaking is not None and self._speaking.poll() is None:
            return
        quiet = subprocess.DEVNULL
        try:
            self._speaking = subprocess.Popen(
                (self._program, "--", text[: self._LONGEST]), stdin=quiet, stdout=quiet, stderr=quiet
            )
        except OSError:
            self._speaking = None

    def wait(self) -> None:
        """Wait until it has said all."""
        if self._speaking is not None:
            self._speaking.wait()


def installed_voice(*, which: Callable[[str], str | None] = shutil.which) -> Voice:
    """The voice of this machine; silence when `espeak-ng` is not installed."""
    program = which("espeak-ng")
    return Silence() if program is None else EspeakVoice(program)
