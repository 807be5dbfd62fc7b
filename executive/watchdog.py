"""A watchdog on the wall's clock around the verbs of a robot: a verb that hangs ends the run."""

from __future__ import annotations

import functools
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, cast

from skills.robot import Robot

VERB_LIMIT_S = 2.0
IMAGE_LIMIT_S = 20.0  # `image` may block by contract


class VerbHung(BaseException):
    """A verb of the Robot protocol did not come back in time. Like KeyboardInterrupt, no skill may swallow it."""


class _Watched:
    """Passes every verb on to the robot, under the alarm."""

    def __init__(self, robot: Robot, limit_s: float, image_limit_s: float) -> None:
        self._robot = robot
        self._limits_s = {"image": image_limit_s}
        self._limit_s = limit_s

    def __getattr__(self, verb: str) -> Any:
        value = getattr(self._robot, verb)
        if verb.startswith("_") or not callable(value):
            return value
        watched = _watched_call(value, verb, self._limits_s.get(verb, self._limit_s))
        self.__dict__[verb] = watched
        return watched


def watched(robot: Robot, *, limit_s: float = VERB_LIMIT_S, image_limit_s: float = IMAGE_LIMIT_S) -> Robot:
    """The robot with the watchdog around each verb.

    A verb called from the main thread that takes longer than its limit on the wall's clock is broken off by an alarm
    and raises `VerbHung`. A verb that hangs inside compiled code without giving way to Python is broken off when it
    returns. Calls from other threads (images taken by a worker) are not watched.
    """
    return cast(Robot, _Watched(robot, limit_s, image_limit_s))


def _watched_call(call: Callable[..., Any], verb: str, limit_s: float) -> Callable[..., Any]:
    @functools.wraps(call)
    def guarded(*arguments: Any, **options: Any) -> Any:
        if threading.current_thread() is not threading.main_thread():
            return call(*arguments, **options)
        with _alarm(verb, limit_s):
            return call(*arguments, **options)

    return guarded


@contextmanager
def _alarm(verb: str, limit_s: float) -> Iterator[None]:
    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise VerbHung(f"the robot did not answer '{verb}' within {limit_s:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
