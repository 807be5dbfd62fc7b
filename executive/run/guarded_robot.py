"""Robot whose verbs are guarded by the watchdog and the lease, and whose answers are checked."""

import functools
import math
import reprlib
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any, Final

import numpy as np

from executive.run.watchdog import IMAGE_LIMIT_S, VERB_LIMIT_S, Watchdog, call_aside, hung_message
from executive.run.worker import in_lock_step_job
from skills.robot import (
    Battery,
    Capabilities,
    CommandCause,
    CommandState,
    CommandStatus,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    LeaseError,
    Odometry,
    OwnLocalisation,
    Robot,
    Scan,
)
from skills.robot_wrapper import VERBS, AnswerT, RobotWrapper

Check = Callable[[Any], str | None]
_EMPTY: Final = (0, 0)


class GarbageError(RuntimeError):
    """Answer of a verb that the Robot protocol does not allow."""


_NOTHING_YET: Final = object()


class GuardedRobot(RobotWrapper):
    """Robot whose verbs are guarded.

    A verb raises `VerbHung` when it takes too long (see `Watchdog`), and `GarbageError` when its answer has the wrong
    type, numbers that are not finite, or a stamp before the clock's beginning.

    After `claim`, skills use `token` as their lease for the whole run, even if the robot's real lease is renewed.
    """

    def __init__(
        self, robot: Robot, watchdog: Watchdog, *, limit_s: float = VERB_LIMIT_S, image_limit_s: float = IMAGE_LIMIT_S
    ) -> None:
        super().__init__(robot)
        self._watchdog, self._limit_s, self._image_limit_s = watchdog, limit_s, image_limit_s
        self._hung = {verb: hung_message(verb, image_limit_s if verb == "image" else limit_s) for verb in VERBS}
        self._good: dict[str, object] = {}
        self._main = threading.main_thread().ident
        self._holder = ""
        self.token: Lease | None = None
        self._lease: Lease | None = None

    def claim(self, holder: str) -> Lease:
        """Acquires the robot's lease; returns the token that stands for the lease. Raises LeaseError if it is taken."""
        self._holder = holder
        self.token = self._lease = self.acquire_lease(holder)
        return self.token

    def lease_lost(self) -> str | None:
        """Reason why the robot would refuse to move for this run; None while the run has the lease."""
        counts = self.lease_holder()
        if counts == self._lease:
            return None
        return f"{counts.holder} holds the lease of {self.name}" if counts else "the lease was given back"

    def regain_lease(self) -> bool:
        """Acquires the lease again if it is free; returns whether the run has the lease now."""
        if self.lease_holder() is not None:
            return False
        try:
            self._lease = self.acquire_lease(self._holder)
        except LeaseError:
            return False
        return True

    def give_lease_back(self) -> None:
        """Returns the lease; the robot stops."""
        if self._lease is not None:
            self.return_lease(self._lease)

    def _call(self, verb: str, call: Callable[..., AnswerT], *arguments: Any, **options: Any) -> AnswerT:
        """Calls a verb under the watchdog and the present lease, and checks its answer."""
        if "lease" in options and options["lease"] == self.token:
            options["lease"] = self._lease
        limit_s = self._image_limit_s if verb == "image" else self._limit_s
        if threading.get_ident() != self._main:
            answer = self._elsewhere(verb, functools.partial(call, *arguments, **options), limit_s)
        else:
            self._watchdog.verb = (time.monotonic() + limit_s, self._hung[verb])
            try:
                answer = call(*arguments, **options)
            finally:
                self._watchdog.verb = None
        if answer is not self._good.get(verb, _NOTHING_YET) and (check := CHECKS.get(verb)) is not None:
            wrong = check(answer)  # sensors give one snapshot many times
            if wrong is not None:
                raise GarbageError(f"the robot answered '{verb}' with garbage: {wrong}")
            self._good[verb] = answer
        return answer

    def _elsewhere(self, verb: str, call: Callable[[], AnswerT], limit_s: float) -> AnswerT:
        """Calls a verb outside the main thread; `image` has no time limit, since a renderer is tied to its thread."""
        if in_lock_step_job():
            if verb == "capabilities":
                return call()  # its answer never changes
            raise RuntimeError(f"'{verb}' was called inside a job: read the robot before, or by `Worker.sense`")
        return call() if verb == "image" else call_aside(call, verb, limit_s)


def _typed(kind: type[AnswerT], check: Callable[[AnswerT], str | None] = lambda answer: None) -> Check:
    """Checks the type and then the contents of an answer; an exception of `check` counts as a defect of the answer."""

    def whole(answer: Any) -> str | None:
        if not isinstance(answer, kind) or (kind is int and isinstance(answer, bool)):
            return f"{answer!r:.80} is no {kind.__name__}"
        try:
            return check(answer)
        except (TypeError, ValueError, AttributeError) as error:
            return f"{kind.__name__} with wrong contents ({error})"

    return whole


def _or_none(check: Check) -> Check:
    return lambda answer: None if answer is None else check(answer)


def _reading(kind: type[Any], more: Check = lambda reading: None) -> Check:
    """Checks the type and stamp of an answer, that its numeric fields are finite, and what `more` checks."""
    numbers = [(each.name, _GOOD[str(each.type)]) for each in fields(kind) if str(each.type) in _GOOD]

    def check(reading: Any) -> str | None:
        """Returns the defect of a reading, or None if the reading is valid."""
        if not reading.stamp_s >= 0.0:
            return f"a stamp of {reading.stamp_s} s"
        bad = next((name for name, good in numbers if not good(getattr(reading, name))), None)
        return more(reading) if bad is None else f"{bad} is not finite: {reprlib.repr(getattr(reading, bad))}"

    return _typed(kind, check)


def _finite(values: Iterable[float]) -> bool:
    return all(map(math.isfinite, values))


_GOOD: Final[Mapping[str, Callable[[Any], bool]]] = {
    "float": math.isfinite,
    "bool": lambda value: isinstance(value, bool | np.bool_),
    "tuple[float, float, float]": lambda values: len(values) == 3 and _finite(values),
    "Mapping[str, float]": lambda values: _finite(values.values()),
    "RigidTransform": lambda X: bool(np.isfinite(X.GetAsMatrix34()).all()),
}
"""Checks of values by the annotations of their fields."""


def _scan(it: Scan) -> str | None:
    shape = (len(it.elevations_rad), len(it.azimuths_rad))
    if it.ranges_m.shape != shape:
        return f"ranges of shape {it.ranges_m.shape}, not {shape}"
    return None


def _image(it: Image) -> str | None:
    lens, depth = it.intrinsics, it.depth_intrinsics
    if it.grey.shape not in ((lens.height, lens.width), _EMPTY):
        return f"a picture of shape {it.grey.shape}, not {(lens.height, lens.width)}"
    if it.depth_m.shape not in ((depth.height, depth.width), _EMPTY):
        return f"depth of shape {it.depth_m.shape}, not {(depth.height, depth.width)}"
    return None


def _status(it: CommandStatus) -> str | None:
    if not isinstance(it.state, CommandState):
        return f"a state of {it.state!r:.40}"
    return None if isinstance(it.cause, CommandCause) else f"a cause of {it.cause!r:.40}"


_COMMAND: Final = _typed(int)
_LEASE: Final = _typed(Lease)
CHECKS: Final[Mapping[str, Check]] = {
    "capabilities": _typed(Capabilities),
    "odometry": _reading(Odometry),
    "own_localisation": _or_none(_reading(OwnLocalisation)),
    "imu": _or_none(_reading(Imu)),
    "scan": _or_none(_reading(Scan, _scan)),
    "image": _reading(Image, _image),
    "joints": _reading(Joints),
    "gripper": _reading(Gripper),
    "battery": _reading(Battery, lambda it: None if 0.0 <= it.charge <= 1.0 else f"a charge of {it.charge}"),
    "faults": _typed(tuple, lambda it: None if all(isinstance(one, str) for one in it) else f"faults {it!r:.80}"),
    **dict.fromkeys(
        ("drive", "stand", "sit", "dock", "undock", "open_door", "move_arm", "point_head", "set_gripper", "stop"),
        _COMMAND,
    ),
    "command_status": _typed(CommandStatus, _status),
    "lease_holder": _or_none(_LEASE),
    "acquire_lease": _LEASE,
    "take_lease": _LEASE,
}
