"""Hand frame and geometry of a gripper, measured at the shapes of its fingers, and working distances of its arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from errand_make.robots.parts import Arm
from errand_make.robots.tree import KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfJoint
from skills.robot import FloatArray

_OVER_TABLES_M: Final = (0.82, 0.9)
"""Heights of a hand that carries over a table."""
_APART_M: Final = 0.05
_NEAR_M: Final = 0.03


def why_no_gripper(tree: KinematicTree, arm: Arm) -> str:
    """Reason why an arm's fingers are no gripper of a known kind; "" when they are one."""
    names = ", ".join(each.name for each in arm.fingers[:4]) + ("..." if len(arm.fingers) > 4 else "")
    if not arm.fingers:
        return "nothing moves on the arm's tip"
    sliding = [each for each in arm.fingers if each.kind == "prismatic"]
    if len(sliding) < len(arm.fingers):
        return f"its fingers turn ({names}), and Errand measures fingers that slide"
    if len(sliding) > 2:
        return f"it has {len(sliding)} fingers ({names}), and a gripper has one or two"
    if any(not len(tree.points(tree.links_below(each))) for each in sliding):
        return f"{names} moves no shape: it is a joint of the description, not a finger"
    loose = [
        each.name for each in sliding if not (each.lower < each.upper and each.effort > 0.0 and each.velocity > 0.0)
    ]
    return f"{loose[0]} has no limits of lower, upper, effort and velocity" if loose else ""


def measure_gripper(
    tree: KinematicTree, last: UrdfJoint, fingers: Sequence[UrdfJoint]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Hand frame and gripper of one or two fingers that slide; F is the frame of the first finger's link."""
    link = fingers[0].child
    X_FB = tree.X_BL[link].inverse()
    X_FA = X_FB @ tree.frame(last)

    def points(links: Sequence[str]) -> FloatArray:
        return np.asarray((X_FB @ tree.points(links).T).T)

    shapes = [points(tree.links_below(each)) for each in fingers]
    axes_F = [(X_FB @ tree.frame(each)).rotation() @ each.axis for each in fingers]
    closing = int(np.argmax(np.abs(axes_F[0])))
    apart = float((shapes[0].mean(axis=0) - shapes[-1].mean(axis=0))[closing]) or float(axes_F[0][closing])
    ahead = np.concatenate(shapes).mean(axis=0) - X_FA.translation()
    ahead[closing] = 0.0
    along = int(np.argmax(np.abs(ahead)))
    x_F, z_F = np.sign(ahead[along]) * np.eye(3)[along], np.sign(apart) * np.eye(3)[closing]
    ways = [float(np.sign(side * axis @ z_F)) for side, axis in zip((1.0, -1.0), axes_F, strict=False)]
    closed = [each.lower if way > 0.0 else each.upper for each, way in zip(fingers, ways, strict=True)]
    R_HF = np.stack([x_F, np.cross(z_F, x_F), z_F])
    moves = [(at - each.clipped(0.0)) * axis for at, each, axis in zip(closed, fingers, axes_F, strict=True)]
    shut = [(each + move - X_FA.translation()) @ R_HF.T for each, move in zip(shapes, moves, strict=True)]
    tip_m = min(float(each[:, 0].max()) for each in shut)
    palm = ((points(tree.links_of[last.child]) - X_FA.translation()) @ R_HF.T)[:, 0]
    behind = palm[palm < tip_m - _NEAR_M / 3.0]
    tip = shut[0][shut[0][:, 0] > tip_m - _NEAR_M]
    widest = len(fingers) * min(each.upper - each.lower for each in fingers)
    gripper = {
        "joints": {each.name: way / len(fingers) for each, way in zip(fingers, ways, strict=True)},
        "closed": {each.name: round(at, 5) for each, at in zip(fingers, closed, strict=True)},
        "widest": rounded(widest),
        "max_opening": rounded(widest),
        "max_force": rounded(min(max(min(each.effort for each in fingers), 5.0), 200.0)),
        "palm_x": rounded(max(behind, default=min(float(each[:, 0].min()) for each in shut))),
        "tip_x": rounded(tip_m),
        "closing_z": rounded(tip[:, 2].min()),
        "half_breadth": rounded(max(0.003, float(np.ptp(tip[:, 1])) / 2.0)),
        "tip_thickness": rounded(max(0.003, float(np.ptp(tip[:, 2])))),
    }
    names = [("-" if sign < 0 else "") + "xyz"[k] for k, sign in ((along, ahead[along]), (closing, apart))]
    return {"link": link, "along": names[0], "closing": names[1]}, gripper


def hand_axes(tree: KinematicTree, last: UrdfJoint) -> dict[str, str]:
    """Guess of a hand's axes: along what is behind the last joint, and across it."""
    points = tree.body_points(last.child)
    X_LB = tree.X_BL[last.child].inverse()
    ahead = X_LB.rotation() @ tree.axis(last)
    if len(points):
        middle = X_LB @ points.mean(axis=0)
        ahead = middle if float(np.linalg.norm(middle)) > 0.01 else ahead
    k = int(np.argmax(np.abs(ahead)))
    return {"link": last.child, "along": ("-" if ahead[k] < 0.0 else "") + "xyz"[k], "closing": "zxy"[k]}


def arm_places(x_m: float, z_m: float, reach_m: float, tip_m: float, front_m: float) -> dict[str, Any]:
    """Working distances of an arm with its shoulder at x_m and z_m of the body, as parts of its length.

    They are those of Spot and Fetch: stands, nearer stands, carrying positions, and positions close to the body. An
    arm whose shoulder is low also carries over the tables before which it stands.
    """
    whole = reach_m + tip_m
    heights = [z_m + each for each in (0.07, 0.13, 0.19, 0.25, 0.31, 0.39, 0.47)]

    def ahead(shares: Sequence[float]) -> list[float]:
        return [rounded(max(front_m + 0.1, x_m + share * whole)) for share in shares]

    return {
        "max_reach": rounded(reach_m),
        "max_payload": 2.0,
        "standing": ahead((0.64, 0.675, 0.605, 0.71, 0.57, 0.535, 0.745, 0.78)),
        "nearer": ahead((0.53, 0.495, 0.46, 0.425)),
        "carry_x": [rounded(x_m + share * whole) for share in (0.42, 0.375, 0.33, 0.465, 0.51)],
        "carry_z": [rounded(z) for z in (*heights, *(z for z in _OVER_TABLES_M if z > heights[-1] + _APART_M))],
        "tuck_x": [rounded(front_m + each) for each in (0.02, 0.07)],
    }


def rounded(value: float) -> float:
    """Rounds to a tenth of a millimetre."""
    return round(float(value), 4) + 0.0
