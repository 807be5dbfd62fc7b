"""Speaks the robot's answers where a synthesiser is installed."""

import queue
import shutil
import subprocess
import threading
from collections.abc import Callable
from typing import Final, Protocol

from skills.inputs.errors import InputError


class Voice(Protocol):
    """Voice that speaks texts. It never fails and never waits for the end."""

    def say(self, text: str) -> None:
        """Begins to speak `text`."""


class Silence:
    """Voice that says nothing."""

    def say(self, text: str) -> None:
        """Does nothing."""


class EspeakVoice:
    """Voice of the program `espeak-ng`, which drops texts that arrive while it speaks."""

    _LONGEST: Final = 300

    def __init__(self, program: str, *, longest: int = _LONGEST) -> None:
        """Takes the greatest number of letters that the voice speaks of a text."""
        self._program, self._longest = program, longest
        self._speaking: subprocess.Popen[bytes] | None = None

    def say(self, text: str) -> None:
        """Begins to speak `text`, cut off at the greatest length."""
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
        """Waits until the text has ended."""
        if self._speaking is not None:
            self._speaking.wait()


class QueuedVoice:
    """Voice that speaks all texts in order; `say` returns at once, because a thread waits for the end of each."""

    _LONGEST: Final = 500
    _PATIENCE_S: Final = 60.0

    def __init__(self, program: str) -> None:
        self._voice = EspeakVoice(program, longest=self._LONGEST)
        self._texts: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._speak, name="errand-voice", daemon=True)
        self._thread.start()

    def say(self, text: str) -> None:
        """Speaks `text` after all texts before it."""
        self._texts.put(text)

    def close(self) -> None:
        """Waits until all texts have been spoken, at most a minute; drops further texts. Idempotent."""
        self._texts.put(None)
        self._thread.join(self._PATIENCE_S)

    def _speak(self) -> None:
        while (text := self._texts.get()) is not None:
            self._voice.say(text)
            self._voice.wait()


def installed_voice(*, which: Callable[[str], str | None] = shutil.which) -> Voice:
    """Voice that this machine has; silent if `espeak-ng` is not installed."""
    program = which("espeak-ng")
    return Silence() if program is None else EspeakVoice(program)


def queued_voice(*, which: Callable[[str], str | None] = shutil.which) -> QueuedVoice:
    """Voice of this machine that speaks every text. Raises InputError when `espeak-ng` is not installed."""
    program = which("espeak-ng")
    if program is None:
        raise InputError("there is no voice on this machine", hint="install espeak-ng, or leave out --voice")
    return QueuedVoice(program)
