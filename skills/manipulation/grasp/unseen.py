"""A look where the arm would go on its way to an object, and where no picture has looked yet.

The hand camera looks down at objects, so that the board above a shelf is in no picture, and the arm would meet it.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from skills.api import Cause, ObjectObservation
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.solid_cells import never_seen
from skills.robot import FloatArray
from skills.routine import Routine, SkillFailure

_NEAR_M, _FURTHEST_M, _NEAREST_M = 0.3, 1.6, 0.4
_FEWEST = 3


def look_into_unseen(skill: LookingSkill[Any], seen: ObjectObservation, arm_W: FloatArray) -> Routine[bool]:
    """Looks once at where the arm (points, world) would be near an object and no picture has looked; whether it did.

    It is not done where the object is too far to see what is about it, and where the arm finds no way to look.
    """
    if not skill.object_camera.on_hand:  # it sees from above what the arm would meet
        return False
    offsets = arm_W - np.array(seen.position_W)
    near_W = arm_W[np.linalg.norm(offsets[:, :2], axis=1) < _NEAR_M]
    unseen_W = near_W[never_seen(near_W, skill.context.solid.views)]
    if len(unseen_W) < _FEWEST:
        return False
    p_BT = skill.X_WB().inverse() @ unseen_W.mean(axis=0)
    if np.linalg.norm(p_BT - skill.model.p_BS) > _FURTHEST_M:
        return False
    message = f"looking above the {seen.kind}"
    try:
        yield from skill.look_at(p_BT, level_viewpoints(skill.model, p_BT), message)
    except SkillFailure as failure:
        if failure.cause is not Cause.PLANNING:
            raise
        return False
    yield from skill.picture(message)
    return True


def level_viewpoints(model: ArmModel, p_BT: FloatArray) -> list[FloatArray]:
    """Camera places on the shoulder's side of p_BT and about as high; lower ones first, which see boards from below."""
    ahead = (p_BT - model.p_BS) * [1.0, 1.0, 0.0]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-6)
    places = (
        [*(model.p_BS + radius * ahead)[:2], p_BT[2] + up_m]
        for up_m, radius in product((-0.1, -0.2, 0.0, -0.3, 0.1), (0.25, 0.35, 0.15))
    )
    return [np.array(place) for place in places if np.linalg.norm(np.array(place) - p_BT) > _NEAREST_M]
