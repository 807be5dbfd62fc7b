"""The robot's voice: what it answers, aloud where a synthesiser is installed."""

from __future__ import annotations

import queue
import shutil
import subprocess
import threading
from collections.abc import Callable
from typing import Final, Protocol

from skills.files.errors import InputError


class Voice(Protocol):
    """Says something aloud. It never fails and never waits for the end."""

    def say(self, text: str) -> None:
        """Begins to say `text`."""


class Silence:
    """No voice: says nothing."""

    def say(self, text: str) -> None:
        """Does nothing."""


class EspeakVoice:
    """Speaks through the program `espeak-ng`. While it still speaks, more is left unsaid."""

    _LONGEST: Final = 300

    def __init__(self, program: str, *, longest: int = _LONGEST) -> None:
        """`longest` is how many letters of a text are said."""
        self._program, self._longest = program, longest
        self._speaking: subprocess.Popen[bytes] | None = None

    def say(self, text: str) -> None:
        """Begins to say `text`, or as much of it as is ever said."""
        if self._speaking is not None and self._speaking.poll() is None:
            return
        quiet = subprocess.DEVNULL
        try:
            self._speaking = subprocess.Popen(
                (self._program, "--", text[: self._longest]), stdin=quiet, stdout=quiet, stderr=quiet
            )
        except OSError:
            self._speaking = None

    def wait(self) -> None:
        """Waits until it has said all."""
        if self._speaking is not None:
            self._speaking.wait()


class QueuedVoice:
    """Says one text after the other and leaves none out; `say` returns at once, since a thread of its own waits."""

    _LONGEST: Final = 500
    _PATIENCE_S: Final = 60.0

    def __init__(self, program: str) -> None:
        self._voice = EspeakVoice(program, longest=self._LONGEST)
        self._texts: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._speak, name="errand-voice", daemon=True)
        self._thread.start()

    def say(self, text: str) -> None:
        """Says `text` when all before it is said."""
        self._texts.put(text)

    def close(self) -> None:
        """Waits until all is said, a minute at most; nothing is said afterwards. Idempotent."""
        self._texts.put(None)
        self._thread.join(self._PATIENCE_S)

    def _speak(self) -> None:
        while (text := self._texts.get()) is not None:
            self._voice.say(text)
            self._voice.wait()


def installed_voice(*, which: Callable[[str], str | None] = shutil.which) -> Voice:
    """The voice of this machine; silence when `espeak-ng` is not installed."""
    program = which("espeak-ng")
    return Silence() if program is None else EspeakVoice(program)


def queued_voice(*, which: Callable[[str], str | None] = shutil.which) -> QueuedVoice:
    """The voice of this machine for texts that must all be said. Raises InputError: `espeak-ng` is not installed."""
    program = which("espeak-ng")
    if program is None:
        raise InputError("there is no voice on this machine", hint="install espeak-ng, or leave out --voice")
    return QueuedVoice(program)
