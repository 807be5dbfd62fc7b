"""The robot as a run sees it: every verb under the watchdog, under the lease that counts, its answer checked."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, cast

from executive.run.verb_answers import garbage
from executive.run.watchdog import IMAGE_LIMIT_S, VERB_LIMIT_S, watched
from skills.robot import Lease, Robot

LeaseBehind = Callable[[Lease], Lease]


class GarbageError(RuntimeError):
    """A verb of the Robot protocol gave back what the protocol does not allow."""


class _Guarded:
    """Passes every verb on; each is wrapped once, when it is first asked for."""

    def __init__(self, robot: Robot, limit_s: float, image_limit_s: float) -> None:
        self._robot = robot
        self._watched = watched(robot, limit_s=limit_s, image_limit_s=image_limit_s)
        self._lease_behind: LeaseBehind = lambda lease: lease

    def __getattr__(self, verb: str) -> Any:
        value = getattr(self._watched, verb)
        if verb.startswith("_") or not callable(value):
            return value
        wrapped = self._wrap(verb, value)
        self.__dict__[verb] = wrapped
        return wrapped

    def _wrap(self, verb: str, call: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(call)
        def guarded_call(*arguments: Any, **options: Any) -> Any:
            if "lease" in options:
                options["lease"] = self._lease_behind(options["lease"])
            answer = call(*arguments, **options)
            wrong = garbage(verb, answer)
            if wrong is not None:
                raise GarbageError(f"the robot answered '{verb}' with garbage: {wrong}")
            return answer

        return guarded_call


def guarded(robot: Robot, *, limit_s: float = VERB_LIMIT_S, image_limit_s: float = IMAGE_LIMIT_S) -> Robot:
    """The robot with every verb watched (see `watchdog.watched`) and its answer checked.

    A verb raises `VerbHung` when it takes too long, and `GarbageError` when its answer has the wrong type, numbers
    that are not finite, or a stamp before the clock's beginning.
    """
    return cast(Robot, _Guarded(robot, limit_s, image_limit_s))


def show_lease_behind(robot: Robot, lease_behind: LeaseBehind) -> None:
    """From now on, a robot that came from `guarded` is shown `lease_behind(lease)` wherever a lease is given."""
    cast(_Guarded, robot)._lease_behind = lease_behind
