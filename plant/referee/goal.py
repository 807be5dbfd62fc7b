"""Goal conditions and the verdict on them: plain data, so that the plant needs to know nothing of missions."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass

import shapely


class GoalKind(enum.Enum):
    """What is to have happened, or to be so at the end."""

    GRASPED = "grasped"  # taken from a source region and lifted, at some time
    HANDED_OVER = "handed over"  # on the tray of a person, let go
    PLACED = "placed"  # resting in a goal region, let go
    WENT = "went"  # the robot's body in a goal region
    ANSWERED = "answered"  # the answer is what is true of the source regions
    CLEARED = "cleared"  # nothing rests in the source regions; with goal regions, all that did rests there, let go


@dataclass(frozen=True)
class Region:
    """A part of the world: an outline seen from above, (x, y) corners in order, and a range of heights (m).

    For an object its body origin counts, for a robot the origin of its body: a table of 0.75 m whose objects have their
    origin between base and 0.25 m above it is the range 0.70 to 1.00.
    """

    name: str
    polygon_W: tuple[tuple[float, float], ...]
    z_min_m: float = -0.1
    z_max_m: float = 3.0

    def __post_init__(self) -> None:
        if len(self.polygon_W) < 3 or not self.z_min_m < self.z_max_m:
            raise ValueError(f"region {self.name!r} needs three corners or more and z_min_m below z_max_m")

    def contains(self, p_W: Iterable[float]) -> bool:
        """Whether a point (x, y, z) in the world lies inside."""
        x, y, z = p_W
        return self.z_min_m <= z <= self.z_max_m and bool(shapely.contains_xy(shapely.Polygon(self.polygon_W), x, y))


@dataclass(frozen=True)
class GoalCondition:
    """One goal condition.

    `classes` are the object classes that fulfil it, `wanted` what they are called together (empty: the classes) and
    `count` how many objects (0 counts as 1); `source` is where they were to be taken from (empty: anywhere) or, for an
    answer, where was to be looked; `goal` where they or the robot were to go (any of the regions); `person` the one to
    be handed to or, where the class is "person", asked for (None: anyone); `answer` what was said, and `answered_s`
    when (None: now; where people are counts now); `robot` who was to do it (None: any); with `passing` it is enough
    that it was so at some time, since later steps may undo it. What happened before `since_s` (simulated time) does not
    count: it was another mission's doing.
    """

    kind: GoalKind
    classes: tuple[str, ...] = ()
    count: int = 1
    source: tuple[Region, ...] = ()
    goal: tuple[Region, ...] = ()
    person: str | None = None
    answer: bool | None = None
    answered_s: float | None = None
    robot: str | None = None
    wanted: str = ""
    passing: bool = False
    since_s: float = 0.0

    @property
    def needed(self) -> int:
        """How many objects fulfil it."""
        return max(1, self.count)


@dataclass(frozen=True)
class Verdict:
    """What the referee saw: whether all goal conditions hold (None: that was not judged), a sentence on each, and the
    counts of the whole run, or since the conditions count.

    `collisions` are the robots' own, `people_hit` those of them with people, `robots_hit` those between two robots;
    `hit_by_people` counts who walked into a robot that stood. `holds` tells of a run that failed whether its goal
    conditions hold nevertheless.
    """

    success: bool | None
    why: str
    collisions: int
    drops: int
    people_hit: int = 0
    hit_by_people: int = 0
    robots_hit: int = 0
    holds: bool | None = None
