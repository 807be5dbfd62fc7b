"""Keys and sticks of teleoperation: values from -1 to 1 by the name of an axis."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

BASE: Final = ("forward", "left", "turn")
HAND: Final = ("hand_x", "hand_y", "hand_z", "roll", "pitch", "yaw")
POSTURE: Final = ("height", "tilt")
GRIPPER: Final = "open"
MOST_JOINTS: Final = 7
JOINTS: Final = tuple(f"joint_{number}" for number in range(1, MOST_JOINTS + 1))
AXES: Final = frozenset((*BASE, *HAND, *POSTURE, GRIPPER, *JOINTS))

_PAIRS: Final[Mapping[str, str]] = {
    "forward": "ws",
    "turn": "ad",
    "left": "qe",
    "hand_x": "ik",
    "hand_y": "jl",
    "hand_z": "uo",
    "roll": "rf",
    "pitch": "tg",
    "yaw": "yh",
    "open": "vc",
    "height": "+-",
    "tilt": "><",
    **{axis: "1234567"[number] + "QWERTYU"[number] for number, axis in enumerate(JOINTS)},
}
KEYS: Final[Mapping[str, tuple[str, float]]] = {
    key: (axis, sign) for axis, pair in _PAIRS.items() for key, sign in zip(pair, (1.0, -1.0), strict=True)
}
"""Axis and sign of each key."""


def axis_values(keys: Iterable[str], sticks: Mapping[str, float] | None = None) -> dict[str, float]:
    """Axis values of held keys and sticks together, each within [-1, 1]; keys without a meaning count as none."""
    asked = dict(sticks or {})
    for axis, sign in (KEYS[key] for key in keys if key in KEYS):
        asked[axis] = asked.get(axis, 0.0) + sign
    return {axis: max(-1.0, min(1.0, value)) for axis, value in asked.items() if value}


def read_axis_values(values: Mapping[str, Any]) -> dict[str, float]:
    """Reads axis values from a page's `keys` (texts) and `axes` (names to numbers). Raises ValueError for others."""
    keys, sticks = values.get("keys", []), values.get("axes", {})
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise ValueError("keys must be a list of texts")
    if not isinstance(sticks, dict):
        raise ValueError("axes must be names with numbers")
    for axis, value in sticks.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if axis not in AXES or not number or not math.isfinite(value):
            raise ValueError(f"axis '{str(axis)[:40]}' must be a known one with a finite number")
    return axis_values(keys, {axis: float(value) for axis, value in sticks.items()})
