"""Teleoperation of body, arm and gripper by keys and sticks, within the limits of the skills.

Dead-man's switch: a key is valid for `life_s` on the robot's clock. By then every command has expired or ends at rest.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from errand_teleop.poses import SavedPose
from skills.api import SkillContext
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import arm_model
from skills.navigate.base import Base
from skills.navigate.follower import FollowerOptions
from skills.quantities import Delay, Duration, Force, Speed, Turn, TurnAcceleration, TurnRate
from skills.robot import ArmTrajectory, Capabilities, CommandId, CommandState, FloatArray

_TAIL_POINTS = 5
"""Points of a trajectory while the arm brakes."""
_STILL_RAD_S = 1e-6
BASE: Final = ("forward", "left", "turn")
HAND: Final = ("hand_x", "hand_y", "hand_z", "roll", "pitch", "yaw")
POSTURE: Final = ("height", "tilt")
GRIPPER: Final = "open"
MOST_JOINTS: Final = 7
JOINTS: Final = tuple(f"joint_{number}" for number in range(1, MOST_JOINTS + 1))
AXES: Final = frozenset((*BASE, *HAND, *POSTURE, GRIPPER, *JOINTS))

_PAIRS: Final[Mapping[str, str]] = {
    "forward": "ws",
    "turn": "ad",
    "left": "qe",
    "hand_x": "ik",
    "hand_y": "jl",
    "hand_z": "uo",
    "roll": "rf",
    "pitch": "tg",
    "yaw": "yh",
    "open": "vc",
    "height": "+-",
    "tilt": "><",
    **{axis: "1234567"[number] + "QWERTYU"[number] for number, axis in enumerate(JOINTS)},
}
KEYS: Final[Mapping[str, tuple[str, float]]] = {
    key: (axis, sign) for axis, pair in _PAIRS.items() for key, sign in zip(pair, (1.0, -1.0), strict=True)
}
"""Axis and sign of each key."""


def axis_values(keys: Iterable[str], sticks: Mapping[str, float] | None = None) -> dict[str, float]:
    """Axis values from held keys and sticks together, each within [-1, 1]; ignores keys without a meaning."""
    asked = dict(sticks or {})
    for axis, sign in (KEYS[key] for key in keys if key in KEYS):
        asked[axis] = asked.get(axis, 0.0) + sign
    return {axis: max(-1.0, min(1.0, value)) for axis, value in asked.items() if value}


def read_axis_values(values: Mapping[str, Any]) -> dict[str, float]:
    """Reads axis values from a page's `keys` (texts) and `axes` (names to numbers). Raises ValueError for others."""
    keys, sticks = values.get("keys", []), values.get("axes", {})
    if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
        raise ValueError("keys must be a list of texts")
    if not isinstance(sticks, dict):
        raise ValueError("axes must be names with numbers")
    for axis, value in sticks.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if axis not in AXES or not number or not math.isfinite(value):
            raise ValueError(f"axis '{str(axis)[:40]}' must be a known one with a finite number")
    return axis_values(keys, {axis: float(value) for axis, value in sticks.items()})


@dataclass(frozen=True)
class ArmOptions:
    """Speeds of the hand and of each joint; a step that would turn a joint by more than `jump_rad` is refused."""

    hand_m_s: Speed = 0.2
    hand_rad_s: TurnRate = 0.6
    joint_rad_s: TurnRate = 0.6
    joint_rad_s2: TurnAcceleration = 3.0
    jump_rad: Turn = 0.35
    period_s: Duration = 0.1


@dataclass(frozen=True)
class ArmMotion:
    """Joint angles and rates at the time `at_s`, after which the arm brakes for `braking_s`."""

    at_s: float
    q_rad: FloatArray
    rate_rad_s: FloatArray
    braking_s: float

    def state(self, now_s: float) -> tuple[FloatArray, FloatArray]:
        """Joint angles and rates at a time not before `at_s`."""
        if self.braking_s <= 0.0:
            return self.q_rad, np.zeros(len(self.q_rad))
        s = float(np.clip(now_s - self.at_s, 0.0, self.braking_s))
        angles = self.q_rad + self.rate_rad_s * (s - 0.5 * s * s / self.braking_s)
        return angles, self.rate_rad_s * (1.0 - s / self.braking_s)


class HandControl:
    """Converts axis values to arm trajectories, each of which continues the previous one."""

    def __init__(self, capabilities: Capabilities, options: ArmOptions) -> None:
        self._model, self._options = arm_model(capabilities), options
        self._motion: ArmMotion | None = None
        self.note = ""

    def next(
        self, asked: Mapping[str, float], now_s: float, q_measured_rad: FloatArray, scene: ArmScene
    ) -> ArmTrajectory | None:
        """The trajectory from now on; None while the arm rests. `note` is the reason why the arm stops."""
        options = self._options
        q, rate = (q_measured_rad, np.zeros(len(q_measured_rad)))
        if self._motion is not None:
            q, rate = self._motion.state(now_s)
        if np.max(np.abs(rate)) < _STILL_RAD_S and np.max(np.abs(q - q_measured_rad)) > 0.1:
            q = q_measured_rad
        self.note = ""
        wanted = _slewed(rate, self._wanted(asked, q), options.joint_rad_s2 * options.period_s)
        motion = self._moved(q, rate, wanted, now_s)
        if not self._free(q, motion, scene):
            self.note = self.note or "the arm would touch the robot or pass a joint's limit"
            motion = self._moved(q, rate, _slewed(rate, 0.0 * rate, options.joint_rad_s2 * options.period_s), now_s)
        self._motion = motion
        moves = max(np.max(np.abs(rate)), np.max(np.abs(motion.rate_rad_s))) > _STILL_RAD_S
        return _trajectory(q, motion, options.period_s) if moves else None

    def _wanted(self, asked: Mapping[str, float], q: FloatArray) -> FloatArray:
        """Joint rates for the axis values."""
        joints = np.array([asked.get(axis, 0.0) for axis in JOINTS[: len(q)]])
        hand = np.array([asked.get(axis, 0.0) for axis in HAND])
        if np.any(joints) or not np.any(hand):
            return self._options.joint_rad_s * joints
        options = self._options
        X_BH = self._model.X_BH(q)
        turn = RotationMatrix(RollPitchYaw(hand[3:] * options.hand_rad_s * options.period_s))
        place = X_BH.translation() + hand[:3] * options.hand_m_s * options.period_s
        # No margin, so that joints at their limit, as in a stowed arm, can leave it.
        solution = self._model.nearest_inverse(RigidTransform(X_BH.rotation() @ turn, place), q, margin_rad=0.0)
        if solution is None or np.max(np.abs(solution - q)) > options.jump_rad:
            self.note = "the hand is at the end of the arm's reach"
            return np.zeros(len(q))
        rates = (solution - q) / options.period_s
        return np.asarray(rates * min(1.0, options.joint_rad_s / max(float(np.max(np.abs(rates))), 1e-9)))

    def _moved(self, q: FloatArray, before: FloatArray, after: FloatArray, now_s: float) -> ArmMotion:
        period_s = self._options.period_s
        braking_s = float(np.max(np.abs(after))) / self._options.joint_rad_s2
        return ArmMotion(now_s + period_s, q + 0.5 * (before + after) * period_s, after, braking_s)

    def _free(self, q: FloatArray, motion: ArmMotion, scene: ArmScene) -> bool:
        end, _ = motion.state(motion.at_s + motion.braking_s)
        for point in (motion.q_rad, end):
            beyond = np.maximum(self._model.lower_rad - point, point - self._model.upper_rad)
            before = np.maximum(self._model.lower_rad - q, q - self._model.upper_rad)
            if np.any(beyond > np.maximum(before, 0.0) + 1e-9):
                return False
        return scene.edge_free(q, motion.q_rad) and scene.edge_free(motion.q_rad, end)


def _slewed(rate: FloatArray, wanted: FloatArray, most: float) -> FloatArray:
    """The rate nearest to the wanted one that differs from `rate` by at most `most`."""
    change = wanted - rate
    return np.asarray(rate + change * min(1.0, most / max(float(np.max(np.abs(change))), 1e-9)))


def _trajectory(q: FloatArray, motion: ArmMotion, period_s: float) -> ArmTrajectory:
    times, points = [0.0, period_s], [q, motion.q_rad]
    if motion.braking_s > 1e-3:
        for fraction in np.linspace(0.0, 1.0, _TAIL_POINTS)[1:]:
            times.append(period_s + fraction * motion.braking_s)
            points.append(motion.state(motion.at_s + fraction * motion.braking_s)[0])
    return ArmTrajectory(np.array(times), np.array(points))


_ARM: frozenset[str] = frozenset((*HAND, *JOINTS))


@dataclass(frozen=True)
class TeleopOptions:
    """Limits of teleoperation; speeds and accelerations of the base are those of the path follower."""

    life_s: Delay = 0.3
    period_s: Duration = 0.1
    base: FollowerOptions = field(default_factory=FollowerOptions)
    arm: ArmOptions = field(default_factory=ArmOptions)
    gripper_rad_s: TurnRate = 1.0
    gripper_n: Force = 20.0
    height_m_s: Speed = 0.1
    tilt_rad_s: TurnRate = 0.2


class Teleop:
    """Teleoperation of one robot. Call `ask` when keys arrive, from any thread, and `tick` once each `period_s`."""

    def __init__(self, context: SkillContext, options: TeleopOptions | None = None) -> None:
        """Moves the robot under the context's lease. Raises ValueError when the arm's kinematics are not supported."""
        self._context, self._options = context, options or TeleopOptions()
        capabilities = context.robot.capabilities()
        self._base = Base(context)
        self._model = None if capabilities.arm is None else arm_model(capabilities)
        self._hand = None if self._model is None else HandControl(capabilities, self._options.arm)
        self._scene: ArmScene | None = None
        self._asked: tuple[Mapping[str, float], float] = ({}, -math.inf)
        self._opening: float | None = None
        self._opening_sign = 0.0
        self._posture = (capabilities.standing_height_m, 0.0)
        self._commands: list[CommandId] = []
        self.note = ""

    def ask(self, asked: Mapping[str, float]) -> None:
        """Sets the values of the axes, each from -1 to 1; an empty mapping stops the robot."""
        self._asked = (dict(asked), self._context.clock.now())

    def pose(self) -> SavedPose:
        """The robot's present pose, to be saved."""
        return SavedPose(
            self._context.pose(), tuple(self._q_rad().tolist()), max(0.0, self._context.robot.gripper().opening)
        )

    def tick(self) -> None:
        """Sends the commands for the next period; `note` is the reason when the robot does not obey, else empty."""
        asked, at_s = self._asked
        now_s, until_s = self._context.clock.now(), at_s + self._options.life_s
        alive = now_s + self._options.period_s <= until_s + 1e-9
        asked = asked if alive else {}
        self.note, self._commands = "", []
        if alive:
            self._stand(asked, until_s)  # before the drive, which keeps the posture
        self._drive(asked, now_s)
        self._move_arm(asked, now_s)
        if alive:
            self._move_gripper(asked, until_s)
        self.note = self._refusal() or self.note

    # -- inside ---------------------------------------------------------------------------------------------------

    def _drive(self, asked: Mapping[str, float], now_s: float) -> None:
        direction = np.array([asked.get(axis, 0.0) for axis in BASE])
        if not np.any(direction):
            self._base.stop()
            return
        base, capabilities = self._options.base, self._context.robot.capabilities()
        ahead = base.max_speed_m_s if direction[0] > 0 else base.backward_m_s
        wanted = direction * (ahead, base.lateral_m_s, base.turn_rad_s)
        wanted *= min(1.0, capabilities.max_speed_m_s / max(float(np.hypot(*wanted[:2])), 1e-9))
        most = self._options.period_s * np.array([base.acceleration_m_s2] * 2 + [base.turn_acceleration_rad_s2])
        if not self._base.drive_clear(wanted, most):
            self.note = "an obstacle blocks the body"

    def _move_arm(self, asked: Mapping[str, float], now_s: float) -> None:
        if self._hand is None or self._model is None or (self._scene is None and not _ARM & asked.keys()):
            return
        robot = self._context.robot
        if self._scene is None:
            self._scene = ArmScene(robot.capabilities(), self._model, robot.joints().position_rad)
        self._scene.set_opening(max(0.0, robot.gripper().opening))
        trajectory = self._hand.next({a: v for a, v in asked.items() if a in _ARM}, now_s, self._q_rad(), self._scene)
        self.note = self._hand.note or self.note
        if trajectory is not None:
            until_s = now_s + float(trajectory.times_s[-1]) + 0.5
            self._commands.append(robot.move_arm(trajectory, until_s=until_s, lease=self._context.lease))

    def _move_gripper(self, asked: Mapping[str, float], until_s: float) -> None:
        sign, gripper = asked.get(GRIPPER, 0.0), self._context.robot.capabilities().gripper
        if gripper is None or not sign:
            self._opening, self._opening_sign = None, 0.0
            return
        if self._opening is None or sign * self._opening_sign < 0.0:
            self._opening = self._context.robot.gripper().opening
        self._opening_sign = sign
        step = sign * self._options.gripper_rad_s * self._options.period_s
        self._opening = min(gripper.widest, max(0.0, self._opening + step))
        force_n = min(self._options.gripper_n, gripper.max_force_n)
        lease = self._context.lease
        self._commands.append(self._context.robot.set_gripper(self._opening, force_n, until_s=until_s, lease=lease))

    def _stand(self, asked: Mapping[str, float], until_s: float) -> None:
        rates = (self._options.height_m_s, self._options.tilt_rad_s)
        steps = [
            asked.get(axis, 0.0) * rate * self._options.period_s for axis, rate in zip(POSTURE, rates, strict=True)
        ]
        if not any(steps):
            return
        capabilities = self._context.robot.capabilities()
        (low, high), (least, most) = capabilities.height_range_m, capabilities.pitch_range_rad
        height, pitch = (before + step for before, step in zip(self._posture, steps, strict=True))
        self._posture = (min(high, max(low, height)), min(most, max(least, pitch)))
        lease = self._context.lease
        self._commands.append(self._context.robot.stand(*self._posture, until_s=until_s, lease=lease))

    def _refusal(self) -> str:
        """Reason why the robot refused one of the commands; empty when it accepted all of them."""
        statuses = [self._context.robot.command_status(command) for command in self._commands]
        refused = next((one.reason for one in statuses if one.state is CommandState.REFUSED), "")
        return self._base.refusal() or refused

    def _q_rad(self) -> FloatArray:
        if self._model is None:
            return np.zeros(0)
        positions = self._context.robot.joints().position_rad
        return np.array([positions[name] for name in self._model.names])
