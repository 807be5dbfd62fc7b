"""Collision-checked arm paths and their timing.

A path is an array (K, J) of joint angles. Joint motions are straight where that is free, else planned by a
bidirectional rapidly exploring random tree and shortened; straight lines of the hand go through the inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.api import PlanningError
from skills.arm.collision import ArmScene
from skills.arm.kinematics import ArmModel
from skills.quantities import Count, Duration, Length, Tries, Turn, TurnAcceleration, TurnRate
from skills.robot import ArmTrajectory, FloatArray

_FEWEST_POINTS = 9


@dataclass(frozen=True)
class RrtConnect:
    """Two rapidly exploring random trees that grow towards each other, then shortcuts; timed at trapezoidal speeds.

    The trees grow by `step_rad`, `iterations` times at most; `shortcuts` are tried on what they find. Straight lines of
    the hand are checked each `line_step_m`, at which no joint may turn by more than `line_jump_rad`. Trajectories keep
    `speed_rad_s`, or a slower one where a skill asks for it, and `acceleration_rad_s2`, in samples of `sample_s`, from
    points `dense_rad` apart.
    """

    step_rad: Turn = 0.25
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
        """A free path from start to goal. Raises PlanningError when an end is blocked or no path was found."""
        for name, q in (("starts", q_start_rad), ("ends", q_goal_rad)):
            if not scene.free(q):
                raise PlanningError(f"the arm's way {name} in contact of {_pairs(scene, q)}")
        if scene.edge_free(q_start_rad, q_goal_rad):
            return np.array([q_start_rad, q_goal_rad])
        return self._shortened(scene, self._connect(scene, q_start_rad, q_goal_rad, rng), rng)

    def line(
        self, model: ArmModel, q_start_rad: FloatArray, X_BH_to: RigidTransform, scene: ArmScene | None = None
    ) -> FloatArray:
        """Joint path along which the hand moves straight to X_BH_to, with its orientation.

        `scene` None leaves out the collision checks. Raises PlanningError when it leaves the reach, jumps or hits.
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

    def timed(
        self, path_rad: FloatArray, *, speed_rad_s: float | None = None, scene: ArmScene | None = None
    ) -> ArmTrajectory:
        """Time a path from rest to rest, at the usual speed unless said.

        Corners are rounded where the rounded path is free in `scene`; they are kept when `scene` is None.
        """
        dense = _resampled(path_rad, self.dense_rad)
        if scene is not None and len(path_rad) > 2:
            rounded = _rounded(dense)
            dense = rounded if scene.path_free(rounded[::3]) else dense
        times = _times(dense, speed_rad_s or self.speed_rad_s, self.acceleration_rad_s2)
        samples = (
            np.append(np.arange(0.0, times[-1], self.sample_s)[:-1], times[-1])
            if times[-1] > self.sample_s
            else times[-1:]
        )
        positions = np.stack([np.interp(samples, times, dense[:, j]) for j in range(dense.shape[1])], axis=1)
        return ArmTrajectory(np.asarray(samples, dtype=float), positions)

    def _connect(
        self, scene: ArmScene, q_start_rad: FloatArray, q_goal_rad: FloatArray, rng: np.random.Generator
    ) -> list[FloatArray]:
        """RRT-Connect. Raises PlanningError after a fixed number of iterations."""
        trees = [([q_start_rad], [-1]), ([q_goal_rad], [-1])]
        lower, upper = scene.model.lower_rad + 0.02, scene.model.upper_rad - 0.02
        for iteration in range(self.iterations):
            near, far = trees[iteration % 2], trees[1 - iteration % 2]
            tip = _extend(scene, near, rng.uniform(lower, upper), self.step_rad, greedy=False)
            if tip is None:
                continue
            meeting = _extend(scene, far, near[0][tip], self.step_rad, greedy=True)
            if meeting is not None and np.allclose(far[0][meeting], near[0][tip]):
                branches = _branch(near, tip), _branch(far, meeting)
                first, second = branches if iteration % 2 == 0 else branches[::-1]
                return first[::-1] + second[1:]
        raise PlanningError("no free way was found for the arm")

    def _shortened(self, scene: ArmScene, path: list[FloatArray], rng: np.random.Generator) -> FloatArray:
        """Replace detours by free straight pieces."""
        for _ in range(self.shortcuts):
            if len(path) <= 2:
                break
            first, last = sorted(rng.choice(len(path), size=2, replace=False))
            if last - first > 1 and scene.edge_free(path[first], path[last]):
                path = path[: first + 1] + path[last:]
        return np.array(path)


def _pairs(scene: ArmScene, q_rad: FloatArray) -> str:
    names = {
        tuple("what stands around" if name == "world" else name for name in pair) for pair in scene.contacts(q_rad)
    }
    return ", ".join(sorted(f"{a} with {b}" for a, b in names)) or "nothing"


def _extend(
    scene: ArmScene,
    tree: tuple[list[FloatArray], list[int]],
    q_target_rad: FloatArray,
    step_rad: float,
    *,
    greedy: bool,
) -> int | None:
    """Grow a tree by one step, or as far as it goes, towards a target; the index of the last new node or None."""
    nodes, parents = tree
    nearest = int(np.argmin(np.linalg.norm(np.array(nodes) - q_target_rad, axis=1)))
    added: int | None = None
    while True:
        offset = q_target_rad - nodes[nearest]
        distance = float(np.linalg.norm(offset))
        if distance < 1e-9:
            return nearest
        following = q_target_rad if distance <= step_rad else nodes[nearest] + offset * (step_rad / distance)
        if not scene.edge_free(nodes[nearest], following):
            return added
        nodes.append(following)
        parents.append(nearest)
        nearest = added = len(nodes) - 1
        if not greedy:
            return added


def _branch(tree: tuple[list[FloatArray], list[int]], index: int) -> list[FloatArray]:
    """Nodes from `index` back to the root."""
    nodes, parents = tree
    branch = []
    while index >= 0:
        branch.append(nodes[index])
        index = parents[index]
    return branch


def _resampled(path_rad: FloatArray, apart_rad: float) -> FloatArray:
    """The same path with points at most apart_rad apart."""
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
    """Moving average that keeps the ends."""
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
