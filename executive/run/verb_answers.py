"""What each verb of the Robot protocol may answer, looked at cheaply: types, finite numbers, stamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final, TypeVar

import numpy as np
from pydrake.math import RigidTransform

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


def _numbers(what: str, values: Iterable[float]) -> str | None:
    return None if all(map(math.isfinite, values)) else f"{what} is not finite"


def _stamp(stamp_s: float) -> str | None:
    return None if math.isfinite(stamp_s) and stamp_s >= 0.0 else f"a stamp of {stamp_s} s"


def _pose(what: str, X: RigidTransform) -> str | None:
    return None if np.isfinite(X.GetAsMatrix34()).all() else f"{what} is not finite"


def _three(what: str, values: tuple[float, float, float]) -> str | None:
    return _numbers(what, values) if len(values) == 3 else f"{what} has {len(values)} numbers, not 3"


def _odometry(it: Odometry) -> str | None:
    return _stamp(it.stamp_s) or _three("velocity", it.velocity) or _pose("X_OB", it.X_OB)


def _imu(it: Imu) -> str | None:
    turn, force = it.angular_velocity_B, it.linear_acceleration_B
    return _stamp(it.stamp_s) or _three("angular velocity", turn) or _three("acceleration", force)


def _scan(it: Scan) -> str | None:
    shape = (len(it.elevations_rad), len(it.azimuths_rad))
    if it.ranges_m.shape != shape:
        return f"ranges of shape {it.ranges_m.shape}, not {shape}"
    return _stamp(it.stamp_s) or _pose("X_BL", it.X_BL) or _pose("X_OB", it.X_OB)


def _image(it: Image) -> str | None:
    lens, depth = it.intrinsics, it.depth_intrinsics
    if it.grey.shape not in ((lens.height, lens.width), _EMPTY):
        return f"a picture of shape {it.grey.shape}, not {(lens.height, lens.width)}"
    if it.depth_m.shape not in ((depth.height, depth.width), _EMPTY):
        return f"depth of shape {it.depth_m.shape}, not {(depth.height, depth.width)}"
    return _stamp(it.stamp_s)


def _joints(it: Joints) -> str | None:
    parts = {"position": it.position_rad, "velocity": it.velocity_rad_s, "effort": it.effort_nm}
    wrong = (_numbers(f"joint {what}", values.values()) for what, values in parts.items())
    return _stamp(it.stamp_s) or next(filter(None, wrong), None)


def _gripper(it: Gripper) -> str | None:
    if not isinstance(it.holding, bool | np.bool_):
        return f"holding is {it.holding!r:.40}"
    return _stamp(it.stamp_s) or _numbers("opening or force", (it.opening_rad, it.force_n))


def _battery(it: Battery) -> str | None:
    charge = None if 0.0 <= it.charge <= 1.0 else f"a charge of {it.charge}"
    return _stamp(it.stamp_s) or charge


def _faults(it: tuple[Any, ...]) -> str | None:
    return None if all(isinstance(fault, str) for fault in it) else f"faults {it!r:.80}"


def _status(it: CommandStatus) -> str | None:
    return None if isinstance(it.state, CommandState) else f"a state of {it.state!r:.40}"


_COMMAND: Final = _of(int)
_LEASE: Final = _of(Lease)
_CHECKS: Final[Mapping[str, Check]] = MappingProxyType(
    {
        "capabilities": _of(Capabilities),
        "odometry": _of(Odometry, _odometry),
        "imu": _of(Imu, _imu),
        "scan": _or_none(_of(Scan, _scan)),
        "image": _of(Image, _image),
        "joints": _of(Joints, _joints),
        "gripper": _of(Gripper, _gripper),
        "battery": _of(Battery, _battery),
        "faults": _of(tuple, _faults),
        **dict.fromkeys(("drive", "stand", "sit", "move_arm", "set_gripper", "stop"), _COMMAND),
        "command_status": _of(CommandStatus, _status),
        "lease_holder": _or_none(_LEASE),
        "acquire_lease": _LEASE,
        "take_lease": _LEASE,
    }
)
