"""Model-predictive path integral control: a path follower that selects its velocity by sampled rollouts.

Williams, Aldrich and Theodorou, "Model Predictive Path Integral Control", 2017.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from skills.api import FreeSpace
from skills.compiled import compiled
from skills.footprint import ClearanceField, Footprint, clearance_at, clearance_on_grid, footprint_clearance_m
from skills.geometry import wrap
from skills.navigate.follower import FollowerOptions, PathFollower
from skills.path import Drive, Path
from skills.quantities import Count, Duration, Factor, Margin, Speed, TurnRate
from skills.robot import FloatArray, Pose2D

_CELL_M = 0.08
_HALF_M = 2.8
"""Half the width of the sampled clearance."""
_NOISES = 8
"""Sets of noise, used in turn."""
_NEAR_GOAL_M = 0.3
_CORNER_M_S = 0.15
"""Speed below which a base that cannot go sideways is at a corner of its path."""


@dataclass(frozen=True)
class MppiOptions(FollowerOptions):
    """Model-predictive path integral control: follows a path by sampled rollouts, within the path follower's limits.

    `samples`, `steps` and `step_s`: number of rollouts, and their length. `temperature`: the lower, the more steeply
    the weight of a rollout falls with its cost. The cost is the squared distance from the path's pose at that time
    (`yaw_m`: metres for a radian), plus `clearance_weight` for a clearance below `near_m`, plus `change_weight` for
    changes of velocity. The path follower itself drives near the goal, while an obstacle blocks the path, and at the
    corners of a base that cannot move sideways.
    """

    samples: Count = 200
    steps: Count = 14
    step_s: Duration = 0.1
    temperature: Factor = 0.02
    spread_m_s: Speed = 0.25
    spread_rad_s: TurnRate = 0.5
    yaw_m: Margin = 0.5
    clearance_weight: Factor = 30.0
    change_weight: Factor = 0.02

    def build(self, path: Path, footprint: Footprint, *, max_speed_m_s: float) -> MppiController:
        """Creates a controller for one path with a speed limit."""
        return MppiController(path, footprint, replace(self, max_speed_m_s=min(self.max_speed_m_s, max_speed_m_s)))


class MppiController(PathFollower):
    """Controller that follows one path. Equal inputs give equal velocities, because the noise has a fixed seed."""

    def __init__(self, path: Path, footprint: Footprint, options: MppiOptions | None = None) -> None:
        self._mppi = options or MppiOptions()
        super().__init__(path, footprint, self._mppi)
        self._noise, self._tick = _noise(self._mppi), 0
        self._plan: FloatArray | None = None

    def command(
        self,
        pose: Pose2D,
        velocity: tuple[float, float, float],
        last: FloatArray,
        costmap: FreeSpace,
        most_m_s: float = math.inf,
    ) -> Drive:
        """Returns the command as `PathFollower.command`; on a free path the weighted rollouts give the velocity."""
        plain = super().command(pose, velocity, last, costmap, most_m_s)
        if plain.remaining_m < _NEAR_GOAL_M or plain.blocked_at is not None or not any(plain.velocity):
            self._plan = None
            return plain
        here = np.array([pose.x_m, pose.y_m, pose.yaw_rad])
        reference, feed = self._reference(here, most_m_s)
        if not self._sideways and float(np.min(np.abs(feed[:3, 0]))) < _CORNER_M_S:
            self._plan = None
            return plain
        nominal = feed if self._plan is None else self._shifted(self._plan)
        self._tick += 1
        field, noise = self._sampled(costmap, pose), self._noise[self._tick % _NOISES]
        self._plan = _improved(field, self._rollout(), here, last, nominal, feed, noise, reference)
        wanted = self._slew(self._clip(self._plan[0]), last)
        now_m = float(footprint_clearance_m(costmap, self._footprint, here[None, :])[0])
        wanted = wanted if now_m > 0.0 else np.array(plain.velocity)
        safe = self._brake(wanted, here, costmap)
        return replace(plain, velocity=(float(safe[0]), float(safe[1]), float(safe[2])))

    def _reference(self, here: FloatArray, most_m_s: float) -> tuple[FloatArray, FloatArray]:
        """The path's poses at each step (steps, 3), and the body-frame velocities that lead there."""
        options, along = self._mppi, float(self._progress[self._index])
        poses = np.empty((options.steps + 1, 3))
        poses[0] = self._at(along)
        for n in range(options.steps):
            speed = min(float(np.interp(along, self._progress, self._limits)), most_m_s)
            along = min(along + max(speed, options.creep_m_s) * options.step_s, self.length_m)
            poses[n + 1] = self._at(along)
        steps = np.diff(poses, axis=0) / options.step_s
        c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
        feed = np.column_stack([c * steps[:, 0] + s * steps[:, 1], c * steps[:, 1] - s * steps[:, 0], steps[:, 2]])
        poses[:, 2] += here[2] - poses[0, 2] + wrap(poses[0, 2] - here[2])
        return np.ascontiguousarray(poses[1:]), np.ascontiguousarray(feed)

    def _sampled(self, costmap: FreeSpace, pose: Pose2D) -> ClearanceField:
        """Clearance sampled on a grid about the robot."""
        offsets = np.arange(-_HALF_M, _HALF_M + _CELL_M, _CELL_M)
        values = clearance_on_grid(costmap, pose.x_m + offsets, pose.y_m + offsets).astype(np.float32)
        return ClearanceField(values, _CELL_M, pose.x_m - _HALF_M, pose.y_m - _HALF_M, self._footprint.discs)

    def _rollout(self) -> _Rollout:
        """The options in the form of the compiled loop."""
        options = self._mppi
        lateral_m_s = options.lateral_m_s if self._sideways else 0.0
        limits = np.array([options.max_speed_m_s, options.backward_m_s, lateral_m_s, options.turn_rad_s])
        rates = np.array([options.acceleration_m_s2, options.acceleration_m_s2, options.turn_acceleration_rad_s2])
        weights = (options.yaw_m, options.clearance_weight, options.change_weight)
        return _Rollout(limits, rates * options.step_s, *weights, options.near_m, options.step_s, options.temperature)

    def _shifted(self, plan: FloatArray) -> FloatArray:
        """The last plan, shifted by one control period."""
        share = min(1.0, self._mppi.period_s / self._mppi.step_s)
        return np.ascontiguousarray((1.0 - share) * plan + share * np.vstack([plan[1:], plan[-1:]]))


def _noise(options: MppiOptions) -> FloatArray:
    """Velocity perturbations (sets, samples, steps, 3), smooth in time; the first sample of each set is zero."""
    rng = np.random.default_rng(0)
    white = rng.standard_normal((_NOISES, options.samples, options.steps, 3))
    for n in range(1, options.steps):
        white[:, :, n] = 0.8 * white[:, :, n - 1] + 0.6 * white[:, :, n]
    white *= (options.spread_m_s, 0.5 * options.spread_m_s, options.spread_rad_s)
    white[:, 0] = 0.0
    return np.ascontiguousarray(white)


class _Rollout(NamedTuple):
    """Speed limits (forward, backward, sideways, turning), largest change per step, and weights: see `MppiOptions`."""

    limits: FloatArray
    rates: FloatArray
    yaw_m: float
    clearance_weight: float
    change_weight: float
    near_m: float
    step_s: float
    temperature: float


@compiled
def _improved(
    field: ClearanceField,
    rollout: _Rollout,
    here: FloatArray,
    last: FloatArray,
    nominal: FloatArray,
    feed: FloatArray,
    noise: FloatArray,
    reference: FloatArray,
) -> FloatArray:
    """Plan (steps, 3) of body-frame velocities after one sampling round about `nominal`; `feed` is one extra sample."""
    limits, rates, step_s = rollout.limits, rollout.rates, rollout.step_s
    samples, steps = noise.shape[0], noise.shape[1]
    plans = np.empty((samples, steps, 3))
    costs = np.zeros(samples)
    for k in range(samples):
        x, y, yaw = here[0], here[1], here[2]
        before = last.copy()
        for n in range(steps):
            for axis in range(3):
                middle = feed[n, axis] if k == 1 else nominal[n, axis] + noise[k, n, axis]
                most = limits[0] if axis == 0 else limits[axis + 1]
                least = -limits[1] if axis == 0 else -most
                value = min(max(middle, least), most)
                plans[k, n, axis] = min(max(value, before[axis] - 2.0 * rates[axis]), before[axis] + rates[axis])
            v = plans[k, n]
            middle_yaw = yaw + 0.5 * step_s * v[2]
            c, s = math.cos(middle_yaw), math.sin(middle_yaw)
            x += step_s * (c * v[0] - s * v[1])
            y += step_s * (s * v[0] + c * v[1])
            yaw += step_s * v[2]
            dx, dy, turn = x - reference[n, 0], y - reference[n, 1], yaw - reference[n, 2]
            cost = dx * dx + dy * dy + (rollout.yaw_m * turn) ** 2
            clear = clearance_at(field, x, y, yaw)
            if clear < rollout.near_m:
                cost += rollout.clearance_weight * (rollout.near_m - clear) ** 2
            if clear < 0.0:
                cost += 1.0
            for axis in range(3):
                cost += rollout.change_weight * (v[axis] - before[axis]) ** 2
            costs[k] += cost / steps
            before[:] = v
    shares = np.exp((costs.min() - costs) / rollout.temperature)
    shares /= shares.sum()
    plan = np.zeros((steps, 3))
    for k in range(samples):
        if shares[k] > 1e-6:
            plan += shares[k] * plans[k]
    return plan
