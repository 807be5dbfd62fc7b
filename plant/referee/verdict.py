"""What the referee says of a run."""

from __future__ import annotations

from dataclasses import dataclass


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
