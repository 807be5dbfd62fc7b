"""Search for tags with the robot's body cameras, as a part of a skill's routine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from skills.perception.fiducials import SeenTag, find_tags
from skills.routine import Routine, RoutineSkill

FIND_LATENCY_S: Final = 0.2
MOST_AMBIGUITY: Final = 0.3
"""Ambiguity of a tag's pose beyond which its picture does not count."""


def look_for_tags(
    skill: RoutineSkill[Any], source: str, sizes_m: Mapping[int, float], message: str
) -> Routine[list[SeenTag]]:
    """Takes a picture with a camera; returns the tags of these sizes (m) by id in it whose poses are sure.

    Raises SkillFailure when the camera gives no picture.
    """
    robot = skill.context.robot
    image = yield from skill.sense(lambda: robot.image(source), latency_s=0.0, name="picture", message=message)
    found = yield from skill.compute(
        lambda: find_tags(image, sizes_m), latency_s=FIND_LATENCY_S, name="find tags", message=message
    )
    return [each for each in found if each.ambiguity <= MOST_AMBIGUITY]
