"""What each verb of the Robot protocol may answer, looked at cheaply: types, finite numbers, stamps."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, TypeVar

import numpy as np

from skills.robot import (
    Battery,
    Capabilities,
    CommandState,
    CommandStatus,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    Odometry,
    Scan,
)

Check = Callable[[Any], str | None]
_EMPTY: Final = (0, 0)
AnswerT = TypeVar("AnswerT")


def garbage_check(verb: str) -> Check | None:
    """Says what is wrong with a verb's answer, None when nothing is seen to be; None for verbs unknown here."""
    return _CHECKS.get(verb)


def _of(kind: type[AnswerT], check: Callable[[AnswerT], str | None] = lambda answer: None) -> Check:
    """The type, then the check of what is in it; what the check itself trips over is garbage, too."""

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


def _nothing_more(reading: Any) -> str | None:
    return None


def _reading(kind: type[Any], more: Check = _nothing_more) -> Check:
    """The type, a stamp, finite numbers in all fields that are annotated as numbers, and what `more` looks at."""
    fields = [(each.name, _GOOD[str(each.type)]) for each in dataclasses.fields(kind) if str(each.type) in _GOOD]

    def check(reading: Any) -> str | None:
        """What is wrong with a reading."""
        if not reading.stamp_s >= 0.0:
            return f"a stamp of {reading.stamp_s} s"
        bad = next((name for name, good in fields if not good(getattr(reading, name))), None)
        return more(reading) if bad is None else f"{bad} is not finite: {getattr(reading, bad)!r:.60}"

    return _of(kind, check)


def _finite(values: Iterable[float]) -> bool:
    return all(map(math.isfinite, values))


_GOOD: Final[Mapping[str, Callable[[Any], bool]]] = {
    "float": math.isfinite,
    "bool": lambda value: isinstance(value, bool | np.bool_),
    "tuple[float, float, float]": lambda values: len(values) == 3 and _finite(values),
    "Mapping[str, float]": lambda values: _finite(values.values()),
    "RigidTransform": lambda X: bool(np.isfinite(X.GetAsMatrix34()).all()),
}
"""Whether a value is as it should be, by the annotation of its field."""


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


def _battery(it: Battery) -> str | None:
    return None if 0.0 <= it.charge <= 1.0 else f"a charge of {it.charge}"


def _faults(it: tuple[Any, ...]) -> str | None:
    return None if all(isinstance(fault, str) for fault in it) else f"faults {it!r:.80}"


def _status(it: CommandStatus) -> str | None:
    return None if isinstance(it.state, CommandState) else f"a state of {it.state!r:.40}"


_COMMAND: Final = _of(int)
_LEASE: Final = _of(Lease)
_CHECKS: Final[Mapping[str, Check]] = {
    "capabilities": _of(Capabilities),
    "odometry": _reading(Odometry),
    "imu": _reading(Imu),
    "scan": _or_none(_reading(Scan, _scan)),
    "image": _reading(Image, _image),
    "joints": _reading(Joints),
    "gripper": _reading(Gripper),
    "battery": _reading(Battery, _battery),
    "faults": _of(tuple, _faults),
    **dict.fromkeys(("drive", "stand", "sit", "move_arm", "point_head", "set_gripper", "stop"), _COMMAND),
    "command_status": _of(CommandStatus, _status),
    "lease_holder": _or_none(_LEASE),
    "acquire_lease": _LEASE,
    "take_lease": _LEASE,
}
