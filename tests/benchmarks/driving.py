"""A robot in the plant that goes from pose to pose by the skill `navigate`, without detector; what it did is measured.

Shared by the benchmarks of navigation: tick by tick as the runner does it, with the truth at hand to judge by.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from executive.run.worker import LockStepWorker
from plant.robots.robot_kind import PlacedRobot
from plant.simulation import Simulation
from plant.worlds.world import World
from skills.api import Failed, PlanningError, Running, SkillContext
from skills.estimate.grid_map import GridMap
from skills.geometry import relative_pose
from skills.navigate.footprint import Footprint
from skills.navigate.planner import plan_path
from skills.navigate.sensor_watch import WatchOptions
from skills.navigate.skill import Navigate, NavigateInputs
from skills.navigate.surroundings import NavigateOptions
from skills.robot import Pose2D
from skills.stack import RobotStack

TICK_S = 0.05
ROBOT = "Alice"


@dataclass(frozen=True)
class Trip:
    """One drive: its end as the skill tells it, when (s) it stood, the true poses (N, 3) a tick apart, what it hit.

    `planning_ms` and `control_ms` are wall times of single plans and control steps.
    """

    message: str
    succeeded: bool
    time_s: float
    poses: np.ndarray
    estimate: Pose2D
    hits: tuple[str, ...]
    planning_ms: tuple[float, ...]
    control_ms: tuple[float, ...]

    @property
    def path_m(self) -> float:
        """The way really gone."""
        return float(np.sum(np.hypot(*np.diff(self.poses[:, :2], axis=0).T)))

    @property
    def pose(self) -> Pose2D:
        """Where it really stands."""
        return Pose2D(*self.poses[-1].tolist())


@dataclass
class Clocked:
    """Times the calls that it passes on."""

    component: Any
    name: str
    took_ms: list[float] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.component, name)
        if name not in ("problem", "build", "command"):
            return value

        def timed(*arguments: Any, **named: Any) -> Any:
            begun = time.perf_counter()
            answer = value(*arguments, **named)
            took = 1000.0 * (time.perf_counter() - begun)
            if name == "command":
                self.took_ms.append(took)
                return answer
            if name == "build":
                return Clocked(answer, "command", self.took_ms)
            return lambda: self._second(answer, took)

        return timed

    def _second(self, plan: Any, took: float) -> Any:
        """Time the planning that follows the sampling."""
        begun = time.perf_counter()
        try:
            return plan()
        finally:
            self.took_ms.append(took + 1000.0 * (time.perf_counter() - begun))


class Driver:
    """One Spot at the start of a world. `maps` are the scan and the keep-out grid that it is given."""

    def __init__(self, world: World, stack: RobotStack, maps: tuple[GridMap, GridMap], *, seed: int) -> None:
        robots = [PlacedRobot(ROBOT, "spot", world.start, world.dock)]
        self.simulation = Simulation(world, seed=seed, visuals=False, robots=robots)
        self.planner, self.controller = Clocked(stack.planner, "problem"), Clocked(stack.controller, "build")
        options = stack.skills.get("navigate") or NavigateOptions()
        blind = replace(options, low_obstacles=WatchOptions(period_s=86_400.0))
        stack = replace(
            stack, planner=self.planner, controller=self.controller, skills={**stack.skills, "navigate": blind}
        )
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
        here = self.context.pose()
        with suppress(PlanningError):
            plan_path(self.context.costmap, Footprint.of(robot.capabilities()), here, here)

    def tick(self) -> None:
        """A tick's time passes, and the estimators see."""
        self.simulation.clock.advance(TICK_S)
        self.context.localiser.update(self.context.robot)
        self.context.costmap.update(self.context.robot, self.context.localiser.estimate())

    def true_pose(self) -> Pose2D:
        """Where the robot really is."""
        engine = self.simulation.engine
        body = engine.world.robots[ROBOT].body
        return Pose2D.from_transform(engine.world.plant.EvalBodyPoseInWorld(engine.context, body))

    def go(self, inputs: NavigateInputs, *, limit_s: float = 120.0, cancel_at_s: float = math.inf) -> Trip:
        """Go to a pose; `cancel_at_s` ends the skill so long after its begin, and the trip once the robot stands."""
        clock, collisions = self.simulation.clock, len(self.simulation.referee.collisions)
        planned, controlled = len(self.planner.took_ms), len(self.controller.took_ms)
        skill, begun_s, poses = Navigate(self.context), clock.now(), [self.true_pose()]
        skill.begin(inputs)
        step: Any = Running("begins")
        while isinstance(step, Running) and clock.now() - begun_s < min(limit_s, cancel_at_s):
            self.tick()
            poses.append(self.true_pose())
            step = skill.step()
        skill.end()
        ended_s = clock.now()
        while cancel_at_s < math.inf and clock.now() - ended_s < 3.0:
            off = relative_pose(poses[-2], poses[-1])
            if math.hypot(off.x_m, off.y_m) < 0.02 * TICK_S and abs(off.yaw_rad) < 0.03 * TICK_S:
                break
            self.tick()
            poses.append(self.true_pose())
        bumps = self.simulation.referee.collisions[collisions:]
        return Trip(
            message=getattr(step, "message", "") or str(step),
            succeeded=not isinstance(step, Running | Failed),
            time_s=clock.now() - begun_s,
            poses=np.array([(p.x_m, p.y_m, p.yaw_rad) for p in poses]),
            estimate=self.context.pose(),
            hits=tuple(bump.sentence for bump in bumps),
            planning_ms=tuple(self.planner.took_ms[planned:]),
            control_ms=tuple(self.controller.took_ms[controlled:]),
        )
