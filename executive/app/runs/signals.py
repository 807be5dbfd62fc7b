"""Signals that end a run in order: Ctrl-C, SIGTERM, and the end of the terminal."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

_OUTPUTS: Final = (1, 2)
_ENDS_WITHIN_S: Final = 3.0
"""Time from SIGTERM until KeyboardInterrupt; services and containers kill a program 10 s after SIGTERM."""


@contextmanager
def ended_by_signals(end: Callable[[str], None]) -> Iterator[Ending]:
    """Yields a handler that calls `end` with the reason at Ctrl-C, SIGTERM and the end of the terminal.

    Nested blocks call the inner first. A second Ctrl-C raises KeyboardInterrupt, and so does SIGTERM when the block has
    not ended after `_ENDS_WITHIN_S`. Output after the end of the terminal is dropped. Under `nohup` the end of the
    terminal ends nothing.
    """
    ending = Ending(end, [output for output in _OUTPUTS if os.isatty(output)])
    if threading.current_thread() is not threading.main_thread():
        yield ending
        return
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGALRM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, ending) for number in numbers}
    ending.outer = next((each for each in before.values() if isinstance(each, Ending)), None)
    ending.outer_alarm = before[signal.SIGALRM]
    try:
        yield ending
    finally:
        ending.stop_waiting()
        for number, handler in before.items():
            signal.signal(number, handler)


class Ending:
    """Handler of the signals; `hung_up` says that the terminal was closed, `hurried` that SIGTERM has come."""

    def __init__(self, end: Callable[[str], None], terminals: Sequence[int]) -> None:
        self._end, self._terminals = end, terminals
        self._asked, self.hung_up, self.hurried = "", False, False
        self.outer: Ending | None = None
        self.outer_alarm: Any = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handles a signal."""
        reason = f"cancelled by {signal.Signals(number).name}"
        if number == signal.SIGHUP:
            self.hung_up = True
            _drop_output(self._terminals)
        elif self._asked:
            raise KeyboardInterrupt(self._asked)
        elif number == signal.SIGALRM:  # of somebody else
            if callable(self.outer_alarm):
                self.outer_alarm(number, frame)
            return
        else:
            self._asked = reason
        if number == signal.SIGTERM:
            self.hurried = True
            signal.setitimer(signal.ITIMER_REAL, _ENDS_WITHIN_S)
        self._end(reason)
        if self.outer is not None:
            self.outer(number, frame)

    def stop_waiting(self) -> None:
        """Ends the wait that SIGTERM began."""
        if self._asked:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def interrupted_by_hang_up() -> Iterator[None]:
    """Treats a closed terminal as Ctrl-C, for commands that move no robot; drops later output."""
    terminals = [output for output in _OUTPUTS if os.isatty(output)]

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        _drop_output(terminals)
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        yield
        return
    before = signal.signal(signal.SIGHUP, on_signal)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


def _drop_output(terminals: Sequence[int]) -> None:
    """Redirects descriptors to /dev/null, because writing to a closed terminal fails."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for terminal in terminals:
        os.dup2(nowhere, terminal)
    os.close(nowhere)
