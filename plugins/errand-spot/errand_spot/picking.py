"""Picks up the object at a point with the grasp skill, for a server that commands a robot without a mission.

The frame `odom` serves as the world, without localisation, map or detector.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from executive.run.worker import LockStepWorker
from skills.api import (
    Cause,
    Detection,
    Detector,
    Failed,
    LocalisationEstimate,
    ObjectKind,
    ObjectObservation,
    Running,
    SkillContext,
)
from skills.class_forms import ANY_OBJECT
from skills.manipulation.grasp.candidates import GraspCandidate
from skills.manipulation.grasp.skill import Grasp, GraspInputs
from skills.robot import Clock, FloatArray, Lease, Robot, Scan
from skills.stack import default_stack
from skills.world_model import FLOOR

_LEVEL_M: Final = 0.015
"""Height of the slices in which a level surface is looked for."""
_AROUND_M: Final = 0.3
_LEAST_BREADTH_M: Final = 0.15
"""Least breadth of a slice that is a surface, and not an object."""
_FEWEST: Final = 12
_OWN_M: Final = 0.12
"""Distance from the point within which points above the surface are the object's."""
_ABOVE_M, _GAP_M = 0.01, 0.06
_LEAST_SIDE_M: Final = 0.02
_FLOOR_M: Final = 0.06


def observe(point: FloatArray, points: FloatArray, stamp_s: float) -> ObjectObservation:
    """Returns the object at a point of a cloud (N, 3): the points around it above the highest surface below it."""
    near = points[np.linalg.norm(points[:, :2] - point[:2], axis=1) < _AROUND_M]
    base_m = _surface_below(near, float(point[2]))
    own = near[(np.linalg.norm(near[:, :2] - point[:2], axis=1) < _OWN_M) & (near[:, 2] > base_m + _ABOVE_M)]
    own = np.vstack([own, point])
    levels_m = np.sort(own[own[:, 2] >= point[2], 2])  # a cabinet above is not the object
    own = own[own[:, 2] <= levels_m[np.append(np.diff(levels_m) > _GAP_M, True).argmax()]]
    low, high = own[:, :2].min(axis=0), own[:, :2].max(axis=0)
    height_m = max(float(own[:, 2].max()) - base_m, _LEAST_SIDE_M)
    (x, y), (dx, dy) = 0.5 * (low + high), np.maximum(high - low, _LEAST_SIDE_M)
    length_m, width_m, yaw_rad = (float(dx), float(dy), 0.0) if dx >= dy else (float(dy), float(dx), 0.5 * np.pi)
    place = (float(x), float(y), base_m + 0.5 * height_m)
    surface = FLOOR if abs(base_m) < _FLOOR_M else None
    return ObjectObservation(
        stamp_s, ObjectKind(ANY_OBJECT), place, (length_m, width_m, height_m), yaw_rad, 1.0, surface
    )


def _surface_below(near: FloatArray, top_m: float) -> float:
    """Height of the highest slice not above top_m that is broad in both directions; 0.0, the floor, without one."""
    for level_m in np.arange(top_m + 0.5 * _LEVEL_M, -_LEVEL_M, -_LEVEL_M):
        slice_ = near[np.abs(near[:, 2] - level_m) < 0.5 * _LEVEL_M]
        if len(slice_) < _FEWEST:
            continue
        _, axes = np.linalg.eigh(np.cov(slice_[:, :2].T))
        breadths = np.ptp(np.percentile(slice_[:, :2] @ axes, [5, 95], axis=0), axis=0)
        if breadths.min() > _LEAST_BREADTH_M:
            return float(np.median(slice_[:, 2]))
    return 0.0


class _OdomIsWorld:
    """Localiser for which the odometry frame is the world."""

    def estimate(self) -> LocalisationEstimate:
        """Returns no correction."""
        return LocalisationEstimate(0.0, RigidTransform(), np.eye(3) * 1e-4, True)

    def update(self, robot: Robot) -> None:
        """Does nothing."""

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> None:
        """Finds nothing."""


class _OpenFloor:
    """Costmap without obstacles: the skill does not drive."""

    def clearance_m(self, points_W: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns a wide clearance (N,) everywhere."""
        return np.full(len(points_W), 5.0)

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Does nothing."""

    def add_points(self, points_W: NDArray[np.float64], stamp_s: float) -> None:
        """Does nothing."""


class _KnowsNoClass(Detector):
    """Detector that knows no class: the object is found by its place alone."""

    class_names: tuple[str, ...] = ()

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """Returns no detections."""
        return [() for _ in pictures]


@dataclass(frozen=True)
class _Constrained:
    """Grasp planner that offers only grasps whose rotation is allowed."""

    planner: Any
    allows: Callable[[RigidTransform], bool]

    def candidates(self, *arguments: Any, **named: Any) -> list[GraspCandidate]:
        """Returns the allowed grasps, the best first."""
        return [each for each in self.planner.candidates(*arguments, **named) if self.allows(each.X_BH)]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.planner, name)


class PointPicker:
    """Picks up the object at a point: looks closely with the hand's camera, plans, grasps, lifts and carries."""

    def __init__(self, robot: Robot, clock: Clock) -> None:
        self._robot, self._clock, self._stack = robot, clock, default_stack()
        self._skill: Grasp | None = None
        self._worker: LockStepWorker | None = None
        self.no_plan = False

    def begin(
        self, lease: Lease, point_O: FloatArray, points_O: FloatArray, allows: Callable[[RotationMatrix], bool]
    ) -> None:
        """Starts to pick up the object at a point of a cloud (N, 3), both in `odom`, with an allowed hand rotation."""
        self.end()
        self.no_plan = False
        stack, robot = self._stack, self._robot
        fits = lambda X_BH: allows(robot.odometry().X_OB.rotation() @ X_BH.rotation())  # noqa: E731
        self._worker = LockStepWorker(self._clock)
        context = SkillContext(
            robot=robot,
            lease=lease,
            clock=self._clock,
            worker=self._worker,
            localiser=_OdomIsWorld(),
            costmap=_OpenFloor(),
            publish=lambda topic, message: None,
            seed=0,
            detector=_KnowsNoClass(),
            stack=replace(stack, grasp_planner=_Constrained(stack.grasp_planner, fits)),
        )
        self._skill = Grasp(context)
        self._skill.begin(GraspInputs(observe(point_O, points_O, self._clock.now())))

    def step(self) -> bool | None:
        """Goes on; returns None until the attempt is over, then whether the object is held."""
        assert self._skill is not None
        step = self._skill.step()
        if isinstance(step, Running):
            return None
        if isinstance(step, Failed) and not self._robot.gripper().holding:
            self.no_plan = step.cause is Cause.PLANNING
            return False
        return True  # also when no way was found to carry what is held

    def end(self) -> None:
        """Stops the pick."""
        if self._skill is not None and self._worker is not None:
            self._skill.end()
            self._worker.close()
            self._skill = self._worker = None
