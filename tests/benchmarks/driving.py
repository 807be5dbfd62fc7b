"""A robot in the plant that goes from pose to pose by the skill `navigate`, without detector; what it did is measured.

Shared by the benchmarks of navigation: tick by tick as the runner does it, with the truth at hand to judge by.
"""

import math
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from executive.run.worker import LockStepWorker
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import spot_capabilities
from plant.simulation import Simulation
from skills.api import Failed, PlanningError, Running, SkillContext
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint, footprint_clear
from skills.geometry import relative_pose
from skills.grid_map import GridMap, load_grid_map
from skills.navigate.planner import plan_path
from skills.navigate.sensor_watch import WatchOptions
from skills.navigate.skill import Navigate
from skills.navigate.surroundings import NavigateOptions
from skills.robot import Pose2D

TICK_S, ROBOT = 0.05, "Alice"
SPOT = Footprint.of(spot_capabilities())
Maps = tuple[GridMap, GridMap]
"""Scan and keep-out grid."""


def maps_of(world):
    return load_grid_map(world.scan_map_path), load_grid_map(world.keepout_map_path).with_unknown_blocked()


def free_poses(grid, footprint, seed, accept=lambda pose: True):
    """Random poses that the footprint fits at with 8 cm around it."""
    rng, costmap = np.random.default_rng([seed, 27]), LayeredCostmap(grid)
    free = grid.centres(np.argwhere(grid.distance > footprint.inscribed_m))
    while True:
        x, y = (float(value) for value in free[rng.integers(len(free))])
        pose = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        if footprint_clear(costmap, footprint, pose, 0.08) and accept(pose):
            yield pose


def within(goal, pose, limits):
    """True if a pose is that near (m, rad) to a goal."""
    off = relative_pose(goal, pose)
    return math.hypot(off.x_m, off.y_m) <= limits[0] and abs(off.yaw_rad) <= limits[1]


@dataclass
class Timed:
    """A planner, controller or follower whose plans or commands are timed (ms)."""

    component: Any
    took_ms: list[float] = field(default_factory=list)

    def __getattr__(self, name):
        return getattr(self.component, name)

    def problem(self, *arguments, **named):
        begun = time.perf_counter()
        plan = self.component.problem(*arguments, **named)
        return self._timed(plan, time.perf_counter() - begun)

    def build(self, *arguments, **named):
        return Timed(self.component.build(*arguments, **named), self.took_ms)

    def command(self, *arguments, **named):
        return self._timed(lambda: self.component.command(*arguments, **named), 0.0)()

    def _timed(self, work, before_s):
        def timed():
            begun = time.perf_counter()
            try:
                return work()
            finally:
                self.took_ms.append(1000.0 * (before_s + time.perf_counter() - begun))

        return timed


class Driver:
    """One Spot at the start of a world, which is given maps."""

    def __init__(self, world, stack, maps, *, seed):
        robots = [PlacedRobot(ROBOT, "spot", world.start, world.dock)]
        self.simulation = Simulation(world, seed=seed, visuals=False, robots=robots)
        self.planner, self.controller = Timed(stack.planner), Timed(stack.controller)
        options = stack.skills.get("navigate") or NavigateOptions()
        blind = {**stack.skills, "navigate": replace(options, low_obstacles=WatchOptions(period_s=86_400.0))}
        stack = replace(stack, planner=self.planner, controller=self.controller, skills=blind)
        robot = self.simulation.robots[ROBOT]
        self.context = SkillContext(
            robot,
            robot.take_lease("benchmark"),
            self.simulation.clock,
            LockStepWorker(self.simulation.clock),
            stack.localiser.build(maps[0], self.simulation.starts[ROBOT], surely=True),
            stack.costmap.build(maps[1]),
            lambda topic, message: None,
            seed=seed,
            stack=stack,
        )
        for _ in range(8):
            self.tick()
        with suppress(PlanningError):
            plan_path(self.context.costmap, SPOT, self.context.pose(), self.context.pose())

    def tick(self):
        self.simulation.clock.advance(TICK_S)
        self.context.localiser.update(self.context.robot)
        self.context.costmap.update(self.context.robot, self.context.localiser.estimate())

    def go(self, inputs, *, limit_s=120.0, cancel_at_s=math.inf):
        """Goes to a pose; `cancel_at_s` ends the skill so long after its begin, and the trip once the robot stands.

        Returns the end as the skill reports it, when the robot stood (s), the true poses (N, 3) a tick apart with the
        last pose and their length, what it hit, and the wall times of single plans and control steps (ms).
        """
        clock, collisions = self.simulation.clock, len(self.simulation.referee.collisions)
        planned, controlled = len(self.planner.took_ms), len(self.controller.took_ms)
        skill, begun_s, poses = Navigate(self.context), clock.now(), [self.simulation.true_pose(ROBOT)]
        skill.begin(inputs)
        step = Running("begins")
        while isinstance(step, Running) and clock.now() - begun_s < min(limit_s, cancel_at_s):
            self.tick()
            poses.append(self.simulation.true_pose(ROBOT))
            step = skill.step()
        skill.end()
        ended_s = clock.now()
        while cancel_at_s < math.inf and clock.now() - ended_s < 3.0:
            if within(poses[-2], poses[-1], (0.02 * TICK_S, 0.03 * TICK_S)):
                break
            self.tick()
            poses.append(self.simulation.true_pose(ROBOT))
        path = np.array([(p.x_m, p.y_m, p.yaw_rad) for p in poses])
        return SimpleNamespace(
            message=getattr(step, "message", "") or str(step),
            succeeded=not isinstance(step, Running | Failed),
            time_s=clock.now() - begun_s,
            poses=path,
            pose=poses[-1],
            path_m=float(np.sum(np.hypot(*np.diff(path[:, :2], axis=0).T))),
            estimate=self.context.pose(),
            hits=tuple(bump.sentence for bump in self.simulation.referee.collisions[collisions:]),
            planning_ms=tuple(self.planner.took_ms[planned:]),
            control_ms=tuple(self.controller.took_ms[controlled:]),
        )
