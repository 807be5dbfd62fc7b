"""Reads the numeric code from its cache, or lets it be compiled, before the clock runs."""

from __future__ import annotations

import gc
from contextlib import suppress

from executive.run.visitor import RunEntry
from skills.api import PlanningError
from skills.navigate.footprint import Footprint
from skills.navigate.planner import plan_path
from skills.robot import Pose2D


def preload(entry: RunEntry) -> None:
    """Take in the robot's first scan and plan a short way; the first time on a machine this takes some seconds."""
    robot, localiser, costmap = entry.robot, entry.localiser, entry.costmap
    localiser.update(robot)
    estimate = localiser.estimate()
    costmap.update(robot, estimate)
    here = Pose2D.from_transform(estimate.X_WO @ robot.odometry().X_OB)
    there = Pose2D(here.x_m, here.y_m, here.yaw_rad + 0.5)
    with suppress(PlanningError):
        plan_path(costmap, Footprint.of(robot.capabilities()), here, there)
    _spare_the_collector()


def _spare_the_collector() -> None:
    """Keep what lives as long as the run out of garbage collections; what an earlier run left is collected first."""
    if gc.get_freeze_count():
        gc.unfreeze()
        gc.collect()
    gc.freeze()
