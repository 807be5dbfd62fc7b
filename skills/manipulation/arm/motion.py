"""Collision-free arm paths and their timing.

A path is an array (K, J) of joint angles. A motion is straight in joint space if that is free; otherwise OMPL's
RRT-Connect plans it, and shortcuts shorten it. Straight lines of the hand come from the inverse kinematics.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from pydrake.math import RigidTransform

from skills.manipulation.arm.collision import AROUND, EDGE_STEP_RAD, ArmScene
from skills.manipulation.arm.kinematics import ArmModel
from skills.quantities import Count, Duration, Length, Tries, Turn, TurnAcceleration, TurnRate
from skills.robot import ArmTrajectory, FloatArray
from skills.world_model import PlanningError

_FEWEST_POINTS = 9
"""Least number of steps of a resampled path."""
_ESCAPE_TRIES = 40
"""Number of random turns that are tried at each growth of the turns."""
_ESCAPES = (1.0, 2.0, 4.0, 8.0)
"""Factors by which the turns out of contact grow."""
_PARTS_OF_ESCAPE = (0.25, 0.5, 0.75)
"""Parts of such a turn at which contact is checked."""
_GRIPPER_TURN_S = 1.6
"""Time in which the gripper has turned."""
_CHECKED_SAMPLE = 3
"""Number of samples of the arm's trajectory between two checks while the gripper turns."""
_ONE_AT_A_TIME: Final = threading.Lock()
"""Lock of OMPL's random generator, which all threads of the process share."""


class ArmPlanner(Protocol):
    """Plans and times motions of the arm. A path is an array (K, J) of joint angles."""

    def path(
        self, scene: ArmScene, q_start_rad: FloatArray, q_goal_rad: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Returns a free path from start to goal. Raises PlanningError when an end is blocked or no path was found."""

    def line(
        self, model: ArmModel, q_start_rad: FloatArray, X_BH_to: RigidTransform, scene: ArmScene | None = None
    ) -> FloatArray:
        """Returns the joint path of a straight motion of the hand to X_BH_to, with that rotation throughout.

        Raises PlanningError when the line is not feasible.
        """

    def trajectory(
        self, path_rad: FloatArray, *, speed_rad_s: float | None = None, scene: ArmScene | None = None
    ) -> ArmTrajectory:
        """Times a path from rest to rest; rounds corners where `scene` is given. Without `speed_rad_s`: usual speed."""


@dataclass(frozen=True)
class RrtConnect:
    """RRT-Connect: two rapidly exploring random trees grow towards each other, then shortcuts; trapezoidal speeds.

    `escape_rad`: the arm leaves a start in contact by rotations up to this, or up to eight times as much. `step_rad`
    and `iterations`: step and limit for the growth of the trees. `shortcuts`: attempts to shorten the path.
    `line_step_m` and `line_jump_rad`: distance between checks on a straight line of the hand, and largest joint
    rotation between them. `speed_rad_s` (unless a skill sets its own) and `acceleration_rad_s2`: limits of a
    trajectory. `sample_s` and `dense_rad`: its sampling time, and the spacing of the path's points before timing.
    """

    step_rad: Turn = 0.25
    escape_rad: Turn = 0.06
    iterations: Count = 1500
    shortcuts: Tries = 80
    line_step_m: Length = 0.01
    line_jump_rad: Turn = 0.35
    speed_rad_s: TurnRate = 1.2
    acceleration_rad_s2: TurnAcceleration = 3.0
    sample_s: Duration = 0.04
    dense_rad: Turn = 0.02

    def path(
        self, scene: ArmScene, q_start_rad: FloatArray, q_goal_rad: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Returns a free path from start to goal. Raises PlanningError when an end is blocked or no path was found.

        Continuous joints take the shorter turn. If the servo error puts the start in contact, the path begins with the
        smallest rotation that frees the arm.
        """
        q_goal_rad = scene.model.turned_near(q_goal_rad, q_start_rad)
        if not scene.free(q_goal_rad):
            raise PlanningError(f"the arm's path ends in contact of {_pairs(scene, q_goal_rad)}")
        if not scene.free(q_start_rad):
            q_freed_rad = self._freed(scene, q_start_rad, rng)
            return np.vstack([q_start_rad, self.path(scene, q_freed_rad, q_goal_rad, rng)])
        if scene.edge_free(q_start_rad, q_goal_rad):
            return np.array([q_start_rad, q_goal_rad])
        return self._connected(scene, q_start_rad, q_goal_rad, rng)

    def _freed(self, scene: ArmScene, q_rad: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Returns a free configuration near one in contact; the motion to it adds no further contact.

        Raises PlanningError when none is found.
        """
        touched = set(scene.contacts(q_rad))
        for growth in _ESCAPES:
            turns = rng.uniform(-1.0, 1.0, (_ESCAPE_TRIES, len(q_rad))) * growth * self.escape_rad
            for turn in sorted(turns, key=lambda turn: float(np.max(np.abs(turn)))):
                q_freed_rad = np.clip(q_rad + turn, scene.model.lower_rad, scene.model.upper_rad)
                between = (q_rad + part * (q_freed_rad - q_rad) for part in _PARTS_OF_ESCAPE)
                if scene.free(q_freed_rad) and all(set(scene.contacts(q)) <= touched for q in between):
                    return np.asarray(q_freed_rad)
        raise PlanningError(f"the arm's path starts in contact of {_pairs(scene, q_rad)}")

    def line(
        self, model: ArmModel, q_start_rad: FloatArray, X_BH_to: RigidTransform, scene: ArmScene | None = None
    ) -> FloatArray:
        """Returns the joint path of a straight motion of the hand to X_BH_to, with that rotation throughout.

        Without `scene` it ignores collisions. Raises PlanningError when the line leaves the reach, jumps or collides.
        """
        X_start = model.X_BH(q_start_rad)
        start, offset = X_start.translation(), X_BH_to.translation() - X_start.translation()
        count = max(2, int(np.ceil(np.linalg.norm(offset) / self.line_step_m)) + 1)
        path = [q_start_rad]
        for fraction in np.linspace(0.0, 1.0, count)[1:]:
            q = model.nearest_inverse(RigidTransform(X_BH_to.rotation(), start + fraction * offset), path[-1])
            if q is None or np.max(np.abs(q - path[-1])) > self.line_jump_rad:
                raise PlanningError("the hand cannot follow the straight line within the arm's reach")
            if scene is not None and not scene.free(q):
                raise PlanningError(f"the straight line of the hand meets {_pairs(scene, q)}")
            path.append(q)
        return np.array(path)

    def trajectory(
        self, path_rad: FloatArray, *, speed_rad_s: float | None = None, scene: ArmScene | None = None
    ) -> ArmTrajectory:
        """Times a path from rest to rest; without `speed_rad_s`, at the usual speed.

        Corners are rounded only where the rounded path is free in `scene`.
        """
        dense = _resampled(path_rad, self.dense_rad)
        if scene is not None and len(path_rad) > 2:
            rounded = _rounded(dense)
            dense = rounded if scene.path_free(rounded[::3]) else dense
        times = _times(dense, speed_rad_s or self.speed_rad_s, self.acceleration_rad_s2)
        samples = np.append(np.arange(0.0, times[-1], self.sample_s)[:-1], times[-1])
        positions = np.stack([np.interp(samples, times, dense[:, j]) for j in range(dense.shape[1])], axis=1)
        return ArmTrajectory(np.asarray(samples, dtype=float), positions)

    def _connected(
        self, scene: ArmScene, q_start_rad: FloatArray, q_goal_rad: FloatArray, rng: np.random.Generator
    ) -> FloatArray:
        """Plans with RRT-Connect (Kuffner and LaValle, ICRA 2000), then shortcuts. Raises PlanningError without a path.

        Limits count steps, not seconds, and the seed comes from `rng`: equal problems give equal paths.
        """
        from ompl import base, geometric, util

        space = base.RealVectorStateSpace(len(q_start_rad))
        bounds = base.RealVectorBounds(len(q_start_rad))
        for joint, (lower, upper) in enumerate(zip(scene.model.lower_rad, scene.model.upper_rad, strict=True)):
            ends = [q_start_rad[joint], q_goal_rad[joint]]
            endless = scene.model.endless[joint]
            ends += [min(ends) - math.pi, max(ends) + math.pi] if endless else [lower, upper]
            bounds.setLow(joint, min(ends))
            bounds.setHigh(joint, max(ends))
        space.setBounds(bounds)
        joints = range(len(q_start_rad))

        def free(state: base.State) -> bool:
            return scene.free(np.array([state[joint] for joint in joints]))

        with _ONE_AT_A_TIME:
            util.noOutputHandler()
            util.RNG.setSeed(int(rng.integers(1, 2**31)))
            setup = geometric.SimpleSetup(space)
            setup.setStateValidityChecker(free)
            setup.getSpaceInformation().setStateValidityCheckingResolution(EDGE_STEP_RAD / space.getMaximumExtent())
            start, goal = space.allocState(), space.allocState()
            for joint in joints:
                start[joint], goal[joint] = q_start_rad[joint], q_goal_rad[joint]
            setup.setStartAndGoalStates(start, goal)
            planner = geometric.RRTConnect(setup.getSpaceInformation())
            planner.setRange(self.step_rad)
            setup.setPlanner(planner)
            setup.solve(base.PlannerTerminationCondition(_after(self.iterations)))
            if not setup.haveExactSolutionPath():
                raise PlanningError("no free path was found for the arm")
            setup.simplifySolution(base.PlannerTerminationCondition(_after(self.shortcuts)))
            states = setup.getSolutionPath().getStates()
            return np.array([q_start_rad, *([state[j] for j in joints] for state in states[1:-1]), q_goal_rad])


def _after(count: int) -> Callable[[], bool]:
    """Returns a condition that is true from its `count`-th call on."""
    left = itertools.count(count, -1)
    return lambda: next(left) <= 0


def _pairs(scene: ArmScene, q_rad: FloatArray) -> str:
    names = {tuple("what stands around" if name == AROUND else name for name in pair) for pair in scene.contacts(q_rad)}
    return ", ".join(sorted(f"{a} with {b}" for a, b in names)) or "nothing"


def _resampled(path_rad: FloatArray, apart_rad: float) -> FloatArray:
    """Returns the path with points at most apart_rad apart."""
    lengths = np.linalg.norm(np.diff(path_rad, axis=0), axis=1)
    keep = np.concatenate([[True], lengths > 1e-9])
    path_rad = path_rad[keep]
    along = np.concatenate([[0.0], np.cumsum(lengths[lengths > 1e-9])])
    count = max(_FEWEST_POINTS, int(np.ceil(along[-1] / apart_rad)) + 1)
    if len(path_rad) < 2:
        return np.repeat(path_rad[:1], 2, axis=0)
    samples = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(samples, along, path_rad[:, j]) for j in range(path_rad.shape[1])], axis=1)


def _rounded(dense_rad: FloatArray, half_window: int = 8) -> FloatArray:
    """Moving average of a path; the ends stay."""
    if len(dense_rad) < 4 * half_window:
        return dense_rad
    padded = np.concatenate(
        [np.repeat(dense_rad[:1], half_window, axis=0), dense_rad, np.repeat(dense_rad[-1:], half_window, axis=0)]
    )
    kernel = np.ones(2 * half_window + 1) / (2 * half_window + 1)
    smooth = np.stack([np.convolve(padded[:, j], kernel, mode="valid") for j in range(dense_rad.shape[1])], axis=1)
    smooth[0], smooth[-1] = dense_rad[0], dense_rad[-1]
    return smooth


def _times(dense_rad: FloatArray, speed_rad_s: float, acceleration_rad_s2: float) -> FloatArray:
    """Arrival times (K,) at the points of a dense path, from rest to rest: a forward and a backward pass."""
    steps = np.max(np.abs(np.diff(dense_rad, axis=0)), axis=1)
    steps = np.maximum(steps, 1e-6)
    tangents = np.diff(dense_rad, axis=0) / steps[:, None]
    limit = np.full(len(dense_rad), speed_rad_s**2)
    turn = np.max(np.abs(np.diff(tangents, axis=0)), axis=1) / (0.5 * (steps[:-1] + steps[1:]))
    limit[1:-1] = np.minimum(limit[1:-1], 0.7 * acceleration_rad_s2 / np.maximum(turn, 1e-6))
    limit[0] = limit[-1] = 0.0
    for k in range(len(steps)):
        limit[k + 1] = min(limit[k + 1], limit[k] + 1.4 * acceleration_rad_s2 * steps[k])
    for k in range(len(steps) - 1, -1, -1):
        limit[k] = min(limit[k], limit[k + 1] + 1.4 * acceleration_rad_s2 * steps[k])
    speeds = np.sqrt(limit)
    durations = 2.0 * steps / np.maximum(speeds[:-1] + speeds[1:], 1e-3)
    return np.concatenate([[0.0], np.cumsum(durations)])


@dataclass(frozen=True)
class GripperTurn:
    """Motion of the gripper between two openings while the arm moves."""

    start: float
    end: float

    @property
    def closes(self) -> bool:
        """Returns whether the gripper ends narrower than it began."""
        return self.end < self.start

    @property
    def narrow(self) -> float:
        """The narrower opening, with which the arm's motion is planned."""
        return max(0.0, min(self.start, self.end))

    def begins_s(self, scene: ArmScene, trajectory: ArmTrajectory) -> float | None:
        """Time (s) on a trajectory from which on the wide gripper is free of contact; None when there is none."""
        scene.set_opening(max(self.start, self.end))
        times_s = trajectory.times_s
        if self.closes:
            wide = trajectory.positions_rad[times_s <= _GRIPPER_TURN_S]
            return 0.0 if scene.path_free(wide[::_CHECKED_SAMPLE]) else None
        begin_s = None
        for time_s, q_rad in zip(
            times_s[::-_CHECKED_SAMPLE], trajectory.positions_rad[::-_CHECKED_SAMPLE], strict=True
        ):
            if times_s[-1] - time_s > _GRIPPER_TURN_S or not scene.free(q_rad):
                break
            begin_s = float(time_s)
        return begin_s
