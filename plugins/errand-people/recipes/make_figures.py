"""SDF files of figures of people: standing, sitting and lying, of ellipsoids and capsules.

`python plugins/errand-people/recipes/make_figures.py` writes them into `plant/models/person`. The
arms lie in their own frames, which the renderer poses.
"""

from typing import Final, get_args

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from plant.models.catalogue import MODELS_FOLDER
from plant.models.person_arms import LOWER_M, UPPER_M
from plant.models.person_figure import HIP_M, SEAT_M, Figure, Posture
from skills.robot import FloatArray

Rgb = tuple[float, float, float]
_SKIN: Final = (0.80, 0.62, 0.50)
_HAIR: Final = (0.24, 0.17, 0.12)
_SHOE: Final = (0.24, 0.22, 0.21)
_CLOTHES: Final = (0.58, 0.48, 0.60)
_TROUSERS: Final = (0.22, 0.24, 0.30)
_THIGH_M: Final = 0.42


def _along(length_m: float) -> RigidTransform:
    return RigidTransform(np.array([0.0, 0.0, -length_m]))


_ARM: Final = (
    ("upper_arm", _along(UPPER_M / 2), f"<capsule><radius>0.052</radius><length>{UPPER_M}</length></capsule>"),
    ("lower_arm", _along(0.125), "<capsule><radius>0.043</radius><length>0.25</length></capsule>"),
    ("lower_arm_hand", _along(LOWER_M), "<ellipsoid><radii>0.038 0.024 0.085</radii></ellipsoid>"),
)
"""Parts of an arm along -z from their joints: the name behind that of the side, the pose, and the shape."""


def figure_sdf(posture: Posture) -> str:
    """SDF model of one link, with visual shapes and few collision shapes."""
    X_PT, visuals, solids, sits = Figure(posture).X_PT, list[str](), list[str](), posture == "sitting"
    down_m = -float(X_PT.translation()[2])

    def ball(name: str, rgb: Rgb, centre: FloatArray | tuple[float, ...], radii: tuple[float, float, float]) -> None:
        shape = f"<ellipsoid><radii>{' '.join(map(str, radii))}</radii></ellipsoid>"
        visuals.append(_visual(name, X_PT @ RigidTransform(np.array(centre)), shape, rgb))

    def limb(name: str, rgb: Rgb, low: FloatArray, high: FloatArray, radius: float) -> None:
        shape = f"<capsule><radius>{radius}</radius><length>{np.linalg.norm(high - low):.4f}</length></capsule>"
        visuals.append(_visual(name, X_PT @ _between(low, high), shape, rgb))

    def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> None:
        shape = f"<box><size>{' '.join(map(str, size))}</size></box>"
        pose = _pose(X_PT @ RigidTransform(np.array(centre)))
        name = f"box_{len(solids)}"
        solids.append(f'<collision name="{name}">{pose}<geometry>{shape}</geometry></collision>')

    ball("shoulders", _CLOTHES, (0.0, 0.0, 1.39), (0.085, 0.215, 0.075))
    ball("chest", _CLOTHES, (0.0, 0.0, 1.26), (0.112, 0.188, 0.21))
    ball("belly", _CLOTHES, (0.0, 0.0, 1.06), (0.108, 0.168, 0.21))
    ball("hips", _TROUSERS, (0.0, 0.0, 0.885), (0.110, 0.172, 0.115))
    limb("neck", _SKIN, np.array([0.0, 0.0, 1.44]), np.array([0.0, 0.0, 1.54]), 0.05)
    ball("face", _SKIN, (0.015, 0.0, 1.625), (0.095, 0.078, 0.120))
    ball("hair", _HAIR, (-0.022, 0.0, 1.668), (0.098, 0.087, 0.095))
    ball("nose", _SKIN, (0.112, 0.0, 1.610), (0.018, 0.013, 0.022))
    for side, name in ((1.0, "left"), (-1.0, "right")):
        ball(f"{name}_eye", (0.12, 0.10, 0.09), (0.100, 0.032 * side, 1.642), (0.010, 0.012, 0.008))
        ball(f"{name}_ear", _SKIN, (0.005, 0.080 * side, 1.615), (0.020, 0.010, 0.030))
        hip = np.array([0.0, 0.085 * side, HIP_M])
        knee = hip + ([_THIGH_M, 0.05 * side, 0.0] if sits else [0.0, 0.01 * side, -_THIGH_M])
        ankle = np.array([knee[0] + 0.02, knee[1], 0.07 + (down_m if sits else 0.0)])
        limb(f"{name}_thigh", _TROUSERS, knee, hip, 0.078)
        limb(f"{name}_shin", _TROUSERS, ankle, knee, 0.058)
        ball(f"{name}_shoe", _SHOE, ankle + [0.055, 0.0, -0.015], (0.135, 0.050, 0.050))
        for part, X, shape in _ARM:
            visuals.append(_visual(f"{name}_{part}", X, shape, _SKIN if part == "lower_arm_hand" else _CLOTHES))
    if sits:
        box((0.55, 0.36, 0.16), (0.2, 0.0, HIP_M))
        box((0.14, 0.36, SEAT_M), (0.42, 0.0, down_m + 0.5 * SEAT_M))
    else:
        box((0.18, 0.30, 0.84), (0.0, 0.0, 0.42))
    box((0.22, 0.50, 0.60), (0.0, 0.0, 1.14))
    box((0.20, 0.18, 0.31), (0.01, 0.0, 1.595))
    parts = "\n".join(visuals + solids)
    head = '<?xml version="1.0"?>\n<!-- a figure of a person; made by make_figures.py -->'
    return f'{head}\n<sdf version="1.9"><model name="person"><link name="person">\n{parts}\n</link></model></sdf>\n'


def _visual(name: str, X: RigidTransform, shape: str, rgb: Rgb) -> str:
    material = f"<material><diffuse>{' '.join(f'{each:g}' for each in rgb)} 1</diffuse></material>"
    return f'<visual name="{name}">{_pose(X)}<geometry>{shape}</geometry>{material}</visual>'


def _pose(X: RigidTransform) -> str:
    rpy = RollPitchYaw(X.rotation()).vector()
    return f"<pose>{' '.join(f'{each:.5f}' for each in (*X.translation(), *rpy))}</pose>"


def _between(low: FloatArray, high: FloatArray) -> RigidTransform:
    """Pose midway between two points, its z axis from the first to the second."""
    z = (high - low) / np.linalg.norm(high - low)
    x = np.cross([0.0, 1.0, 0.0], z)
    x = x / np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.column_stack([x, np.cross(z, x), z])), 0.5 * (low + high))


if __name__ == "__main__":
    for each in get_args(Posture):
        (MODELS_FOLDER / "person" / f"{each}.figure.sdf").write_text(figure_sdf(each), encoding="utf-8")
