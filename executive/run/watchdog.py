"""A watchdog on the wall's clock around the verbs of a robot, and around ticks: what hangs ends the run."""

from __future__ import annotations

import functools
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from queue import SimpleQueue
from types import FrameType
from typing import Any, cast

from skills.robot import Robot

VERB_LIMIT_S = 2.0
IMAGE_LIMIT_S = 20.0  # `image` may block by contract
TICK_LIMIT_S = 300.0  # in lock-step, planning and detection are part of a tick
_ALARM_GRAIN_S = 1e-4


class VerbHung(BaseException):
    """A verb of the Robot protocol, or a tick, did not come back in time.

    Like KeyboardInterrupt, no skill may swallow it.
    """


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
        watched = _watched_call(value, verb, self._limits_s.get(verb, self._limit_s), helped=verb != "image")
        self.__dict__[verb] = watched
        return watched


def watched(robot: Robot, *, limit_s: float = VERB_LIMIT_S, image_limit_s: float = IMAGE_LIMIT_S) -> Robot:
    """The robot with the watchdog around each verb.

    A verb that takes longer than its limit on the wall's clock raises `VerbHung`. Called from the main thread, it is
    broken off by an alarm. Called from another thread, it is done by a helper thread, and waited for no longer.

    What this cannot do: pictures that are taken outside the main thread are not watched, since what renders them is
    bound to its thread; an alarm breaks off compiled code only when that returns to Python; and a helper thread
    cannot be broken off, so what hangs in it may still act when it comes back. By then the run has stopped the robot
    and returned the lease, under which such a late command is refused.
    """
    return cast(Robot, _Watched(robot, limit_s, image_limit_s))


def _watched_call(call: Callable[..., Any], verb: str, limit_s: float, *, helped: bool) -> Callable[..., Any]:
    @functools.wraps(call)
    def guarded(*arguments: Any, **options: Any) -> Any:
        if threading.current_thread() is not threading.main_thread():
            done = functools.partial(call, *arguments, **options)
            return _helped(done, verb, limit_s) if helped else done()
        with _alarm(limit_s, lambda: _hung(verb, limit_s)):
            return call(*arguments, **options)

    return guarded


@contextmanager
def tick_watch(robot_name: str, limit_s: float) -> Iterator[None]:
    """Break off a tick that takes longer than its limit: a skill in an endless loop. Raises VerbHung.

    This works in the main thread only; elsewhere nothing can break off Python code, and nothing is watched.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _alarm(limit_s, lambda: VerbHung(f"a tick of {robot_name} took longer than {limit_s:g} s")):
        yield


@contextmanager
def _alarm(limit_s: float, hung: Callable[[], VerbHung]) -> Iterator[None]:
    """Raise `hung()` when the block takes longer; an alarm around this one goes on counting."""
    before = signal.getsignal(signal.SIGALRM)
    outer = before if isinstance(before, _Ring) else None
    ring = _Ring(limit_s, hung, outer)
    foreign_s, _ = signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, ring)
    ring.arm()
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if outer is not None:
            outer.arm()
        elif foreign_s > 0.0:
            signal.setitimer(signal.ITIMER_REAL, max(foreign_s - ring.elapsed_s(), _ALARM_GRAIN_S))


class _Ring:
    """The handler of an alarm that knows of the one around it. Whichever is due first rings."""

    def __init__(self, limit_s: float, hung: Callable[[], VerbHung], outer: _Ring | None) -> None:
        self._begun_s = time.monotonic()
        self._due_s, self._hung, self._outer = self._begun_s + limit_s, hung, outer

    def __call__(self, _signal: int, _frame: FrameType | None) -> None:
        self.raise_when_due(time.monotonic())
        self.arm()  # it rang too early

    def elapsed_s(self) -> float:
        """How long the block has taken so far."""
        return time.monotonic() - self._begun_s

    def raise_when_due(self, now_s: float) -> None:
        """Raise VerbHung for the outermost block whose time is over."""
        if self._outer is not None:
            self._outer.raise_when_due(now_s)
        if now_s >= self._due_s:
            raise self._hung()

    def arm(self) -> None:
        """Ring when the first block is due."""
        signal.setitimer(signal.ITIMER_REAL, max(self._first_due_s() - time.monotonic(), _ALARM_GRAIN_S))

    def _first_due_s(self) -> float:
        return self._due_s if self._outer is None else min(self._due_s, self._outer._first_due_s())


class _Helper:
    """A thread that does one call after the other for its owner, and ends when the owner lets go of it."""

    def __init__(self) -> None:
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        threading.Thread(target=_work_off, args=(self._calls,), name="errand-verbs", daemon=True).start()

    def do(self, call: Callable[[], Any]) -> Future[Any]:
        """Have `call` done."""
        future: Future[Any] = Future()
        self._calls.put((call, future))
        return future

    def __del__(self) -> None:
        self._calls.put(None)


_Call = tuple[Callable[[], Any], Future[Any]]
_helpers = threading.local()


def _work_off(calls: SimpleQueue[_Call | None]) -> None:
    for call, future in iter(calls.get, None):
        try:
            future.set_result(call())
        except BaseException as defect:
            future.set_exception(defect)


def _helped(call: Callable[[], Any], verb: str, limit_s: float) -> Any:
    """The call's result, done by this thread's helper; a helper that hangs is left to itself."""
    if not hasattr(_helpers, "mine"):
        _helpers.mine = _Helper()
    future = _helpers.mine.do(call)
    try:
        return future.result(timeout=limit_s)
    except TimeoutError:
        if future.done():
            raise
        del _helpers.mine
        raise _hung(verb, limit_s) from None


def _hung(verb: str, limit_s: float) -> VerbHung:
    return VerbHung(f"the robot did not answer '{verb}' within {limit_s:g} s")
