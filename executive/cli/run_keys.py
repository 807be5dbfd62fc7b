"""Keys at the terminal: pause, step, stop, cancel, answers, buttons of missions, and sentences to the robot."""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from executive.run.control import Control
from executive.run.control_state import ControlState, Mode, OpenQuestion
from skills.inputs.outside import LONGEST_ANSWER

HELP: Final = "space pause/go on · s step · x stop button · c cancel"
SAY_HELP: Final = f"{HELP} · : say something"
_SAY_KEYS: Final = frozenset(":\r\n")
_LEAVE: Final = "\x1b"
_ENTER: Final = frozenset("\r\n")
_LONGEST: Final = LONGEST_ANSWER
_ERASE: Final = frozenset("\x7f\b")


@dataclass(frozen=True)
class Typing:
    """State of typing: `text` is an answer or, with `saying`, a sentence to the robot; `reply` is the last reply.

    `can_say` is True if the robot accepts sentences.
    """

    text: str = ""
    saying: bool = False
    reply: str = ""
    can_say: bool = False


class Keys:
    """Controls a run by keys. While a question that accepts any text is open, keys write the answer.

    A colon or Enter begins a sentence, Enter sends it to `say`, and Escape drops it.
    """

    def __init__(self, control: Control, say: Callable[[str], str] | None = None) -> None:
        self._control, self._say = control, say
        self.typing = Typing(can_say=say is not None)
        self._actions: Mapping[str, Callable[[], None]] = MappingProxyType(
            {
                " ": control.toggle_pause,
                "s": control.step,
                "x": self._toggle_stop_button,
                "c": lambda: control.cancel("cancelled at the terminal"),
                "q": lambda: control.cancel("cancelled at the terminal"),
            }
        )

    def press(self, key: str) -> None:
        """Handles a key; unknown keys do nothing."""
        if self.typing.saying:
            self._write_sentence(key)
            return
        question = next(iter(self._control.state.questions), None)
        if question is not None and not question.options:
            self._write(key, question)
        elif question is not None and key.isdecimal() and 1 <= int(key) <= len(question.options):
            self._answer(question, question.options[int(key) - 1])
        elif key.isdecimal() and 1 <= int(key) <= len(buttons := self._control.state.buttons):
            self._control.press(buttons[int(key) - 1])
        elif key in _SAY_KEYS and self._say is not None:
            self.typing = replace(self.typing, saying=True, text="", reply="")
        else:
            self._actions.get(key, lambda: None)()

    def _write_sentence(self, key: str) -> None:
        text = self.typing.text
        if key in _ENTER or key == _LEAVE:
            said = key != _LEAVE and self._say is not None and bool(text.strip())
            self.typing = replace(self.typing, saying=False, text="", reply="…" if said else "")
            if said and self._say is not None:
                self.typing = replace(self.typing, reply=self._say(text))
        else:
            self._edit(key)

    def _edit(self, key: str) -> None:
        """Adds or erases a letter."""
        text = self.typing.text
        if key in _ERASE:
            self.typing = replace(self.typing, text=text[:-1])
        elif key.isprintable() and len(text) < _LONGEST:
            self.typing = replace(self.typing, text=text + key)

    def _write(self, key: str, question: OpenQuestion) -> None:
        if key in _ENTER:
            text, self.typing = self.typing.text, replace(self.typing, text="")
            self._answer(question, text)
        else:
            self._edit(key)

    def _answer(self, question: OpenQuestion, text: str) -> None:
        """Answers the question, unless its time is just over."""
        with suppress(ValueError):
            self._control.answer(question.id, text)

    def _toggle_stop_button(self) -> None:
        if self._control.state.mode is Mode.STOPPED:
            self._control.release_stop_button()
        else:
            self._control.stop_button("the stop button is pressed at the terminal")


def prompt_lines(state: ControlState, now_s: float, typing: Typing = Typing()) -> list[str]:
    """Returns the lines below the tree: why the run is paused, questions, typed text, replies, and the keys."""
    lines = [f"{state.mode.value.upper()}: {state.reason}"] if state.mode not in _NOTHING_TO_SAY else []
    for waiting in state.questions:
        question, left_s = waiting.question, max(0.0, waiting.until_s - now_s)
        choices = "  ".join(f"[{number}] {option}" for number, option in enumerate(question.options, start=1))
        until = f"'{question.default}' in {left_s:.0f} s" if question.default else f"{left_s:.0f} s left"
        lines.append(f"? {question.text}  {choices or typing.text + '_'}  ({until})")
    if state.buttons and not state.questions:
        names = "  ".join(f"[{number}] {name}" for number, name in enumerate(state.buttons, start=1))
        lines.append(f"buttons: {names}")
    lines += [typing.reply] if typing.reply else []
    if typing.saying:
        return [*lines, f": {typing.text}_", "Enter says it · Esc drops it"]
    return [*lines, SAY_HELP if typing.can_say else HELP]


@contextmanager
def read_keys(press: Callable[[str], object], descriptor: int | None = None) -> Iterator[bool]:
    """Calls `press` with each key from a thread while the block runs; yields False if there is no terminal.

    `descriptor` is by default standard input. The terminal's mode is restored at the end.
    """
    source = _stdin() if descriptor is None else descriptor
    if source is None or not os.isatty(source):
        yield False
        return
    before = termios.tcgetattr(source)
    wake, waker = os.pipe()
    reader = threading.Thread(target=_read, args=(source, wake, press), name="errand-keys", daemon=True)
    try:
        tty.setcbreak(source, termios.TCSADRAIN)
        reader.start()
        yield True
    finally:
        os.write(waker, b"x")
        if reader.ident is not None:
            reader.join()
        for end in (wake, waker):
            os.close(end)
        with suppress(termios.error):  # the terminal was closed
            termios.tcsetattr(source, termios.TCSADRAIN, before)


def _read(source: int, wake: int, press: Callable[[str], object]) -> None:
    while True:
        ready, _, _ = select.select([source, wake], [], [])
        if wake in ready:
            return
        try:
            data = os.read(source, 64)
        except OSError:  # the terminal was closed
            return
        if not data:
            return
        for key in data.decode(errors="ignore"):
            press(key)


def _stdin() -> int | None:
    """Returns the descriptor of standard input; None if it is closed or replaced."""
    try:
        return sys.stdin.fileno()
    except (AttributeError, ValueError, OSError):
        return None


_NOTHING_TO_SAY: Final = frozenset({Mode.READY, Mode.RUNNING, Mode.ENDED})
