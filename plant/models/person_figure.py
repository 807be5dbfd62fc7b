"""Figures of people: postures, gestures that move, and colours of clothes.

The trunk frame T has the axes of a standing person: z to the head, x ahead, the origin 0.86 m below the hips. Head and
trunk keep their places in it; only the legs differ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from pydantic import Field

from executive.words.knowledge import Pose
from skills.robot import FloatArray, quantities

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

Posture = Literal["standing", "sitting", "lying"]
Gesture = Literal["none", "waving", "raising_left_arm", "raising_right_arm", "pointing_left", "pointing_right"]
Clothes = Literal["red", "orange", "yellow", "green", "blue", "white", "grey", "black"]
Rgb = tuple[float, float, float]
CLOTHES: Final[dict[Clothes, Rgb]] = {
    "red": (0.72, 0.10, 0.12),
    "orange": (0.90, 0.42, 0.08),
    "yellow": (0.90, 0.76, 0.14),
    "green": (0.14, 0.50, 0.22),
    "blue": (0.14, 0.26, 0.66),
    "white": (0.90, 0.90, 0.88),
    "grey": (0.46, 0.46, 0.47),
    "black": (0.07, 0.07, 0.08),
}
HIP_M, SEAT_M = 0.86, 0.45
"""Height of the hips of a person who stands, and of the seat of one who sits."""
SITS_ABOVE_M, LIES_ABOVE_M = 0.09, 0.115
"""Height of the hips' centre above a seat, and of the spine above what a person lies on."""
_FOLDER: Final = Path(__file__).with_name("person")
_UNDYED: Final = "0.58 0.48 0.6 1"
_WAVES_HZ, _WAVE_M = 0.8, 0.20


class Spot(Pose):
    """A pose of a person on the floor, on a seat or on a bed; a person with a route stands.

    Who lies has the feet ahead, and makes no gesture.
    """

    posture: Posture = Field(default="standing", description="standing, sitting or lying")
    top: quantities.Margin | None = Field(default=None, description="height of the seat or bed, m")

    @property
    def z_m(self) -> float:
        """Height of the person's origin: that of a bed, or what a seat is higher than the usual one."""
        usual_m = SEAT_M if self.posture == "sitting" else 0.0
        return 0.0 if self.top is None else self.top - usual_m


@dataclass(frozen=True)
class Figure:
    """Posture, gesture, colour of the clothes (None: undyed), and phase of the waving."""

    posture: Posture = "standing"
    gesture: Gesture = "none"
    clothes: Rgb | None = None
    phase_rad: float = 0.0

    @property
    def X_PT(self) -> RigidTransform:
        """Pose of the trunk frame in the person's: the origin is on the floor or bed, or `SEAT_M` below the seat."""
        from pydrake.math import RigidTransform, RollPitchYaw

        if self.posture == "lying":
            return RigidTransform(RollPitchYaw(0.0, -math.pi / 2, 0.0), np.array([HIP_M, 0.0, LIES_ABOVE_M]))
        down_m = HIP_M - SEAT_M - SITS_ABOVE_M if self.posture == "sitting" else 0.0
        return RigidTransform(np.array([0.0, 0.0, -down_m]))

    def hand(self, side: float, time_s: float) -> FloatArray:
        """Position (3,) of a hand in the trunk frame; `side` is 1 for the left one, -1 for the right one."""
        name = "left" if side > 0 else "right"
        if self.gesture == f"raising_{name}_arm":
            return np.array([0.06, 0.27 * side, 1.98])
        if self.gesture == f"pointing_{name}":
            return np.array([0.16, 0.78 * side, 1.40])
        if self.gesture == "waving" and side < 0:
            swing_m = _WAVE_M * math.sin(math.tau * _WAVES_HZ * time_s + self.phase_rad)
            return np.array([0.12, -0.40 - swing_m, 1.78 - 0.3 * abs(swing_m)])
        if self.posture == "sitting":
            return np.array([0.33, 0.13 * side, HIP_M + 0.13])
        return np.array([0.062, 0.25 * side, 0.805])

    def sdf(self) -> str:
        """SDF model of one link, in the colour of the clothes."""
        text = (_FOLDER / f"{self.posture}.figure.sdf").read_text(encoding="utf-8")
        return text if self.clothes is None else text.replace(_UNDYED, "{:.3f} {:.3f} {:.3f} 1".format(*self.clothes))


def shade(colour: Clothes, rng: np.random.Generator) -> Rgb:
    """Shade of a colour of clothes: a little brighter or darker, and a little to another hue."""
    red, green, blue = np.clip(np.array(CLOTHES[colour]) * rng.uniform(0.85, 1.1) + rng.uniform(-0.02, 0.02, 3), 0, 1)
    return float(red), float(green), float(blue)
