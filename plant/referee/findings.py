"""Findings of the referee, and the times, places and distances that all judges use."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from executive.words.goal import GoalCondition, Region, When
from plant.referee.object_history import Truth
from skills.inputs.errors import definite
from skills.robot import FloatArray

NAMED_REGIONS = 3


@dataclass(frozen=True)
class Finding:
    """Finding on one condition: whether it holds, and a sentence that says why."""

    holds: bool
    sentence: str


def step_end_s(condition: GoalCondition, truth: Truth) -> float:
    """Time when the step of a condition ended, or now."""
    return truth.now_s if condition.ended_s is None else min(condition.ended_s, truth.now_s)


def is_past(condition: GoalCondition) -> bool:
    """Returns whether a condition is about the past, not the end of the mission."""
    return condition.when is not When.END_OF_MISSION and condition.ended_s is not None


def region_at(regions: Sequence[Region], p_W: FloatArray) -> str | None:
    """Name, with its article, of the first region that contains a point."""
    return next((the(region.name) for region in regions if region.contains(p_W)), None)


def the(name: str) -> str:
    """Name of a place with its article; a pose or a proper name has none."""
    return name if name.startswith("(") or name[:1].isupper() else definite(name)


def distance_m(p: FloatArray, q: FloatArray) -> float:
    """Horizontal distance between two points (m)."""
    return float(np.hypot(p[0] - q[0], p[1] - q[1]))


def where(regions: Sequence[Region]) -> str:
    """Names of regions if there are few, else their number."""
    names = tuple(dict.fromkeys(the(region.name) for region in regions))
    return " or ".join(names) if len(names) <= NAMED_REGIONS else f"any of {len(names)} places"
