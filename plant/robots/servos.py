"""The parts, joints and servos of a robot: goals, indices in the plant's state, and set points of arm and gripper."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from plant.saved_state import Stateful
from skills.robot import ArmTrajectory, FloatArray

Indices = NDArray[np.int64]


class Part(enum.Enum):
    """Part of a robot that a command moves; each part runs one command at a time."""

    VELOCITY = "velocity"
    POSTURE = "posture"
    ARM = "arm"
    GRIPPER = "gripper"
    HEAD = "head"


@dataclass(frozen=True)
class Velocity:
    """A planar velocity in the body frame: m/s, m/s, rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0


class ActuatedJoints:
    """Actuated joints of a model instance, in the order of its actuators; after Finalize.

    `positions` and `velocities` are indices in the plant's state. The desired state of the actuators has all positions
    first, then all velocities: a joint's number is the index of its position; `rates_of` returns the index of its
    velocity. Each kind of robot sets the numbers of the arm's joints and their speed limits (rad/s).
    """

    arm: Indices
    fastest_arm_rad_s: FloatArray

    def __init__(self, plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
        actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices(instance)]
        joints = [actuator.joint() for actuator in actuators]
        self.names = tuple(joint.name() for joint in joints)
        self.positions = np.array([joint.position_start() for joint in joints], dtype=np.int64)
        self.velocities = np.array([joint.velocity_start() for joint in joints], dtype=np.int64)
        self.efforts = np.array([actuator.effort_limit() for actuator in actuators])
        self.lower = np.array([joint.position_lower_limits()[0] for joint in joints])
        self.upper = np.array([joint.position_upper_limits()[0] for joint in joints])
        gains = [actuator.get_controller_gains() for actuator in actuators]
        self.stiffness = np.array([each.p for each in gains])
        self._damping = np.array([each.d for each in gains])

    def numbers(self, names: Sequence[str]) -> Indices:
        """Numbers of joints, in the order of `names`."""
        return np.array([self.names.index(name) for name in names], dtype=np.int64)

    def rates_of(self, numbers: Indices) -> Indices:
        """Indices of the joints' velocities in the desired state."""
        return len(self.names) + numbers

    def efforts_of(
        self, desired: FloatArray, feed_forward: FloatArray, positions: FloatArray, rates: FloatArray
    ) -> FloatArray:
        """Efforts of the actuators at positions and rates, for a desired state and feed-forward efforts."""
        goals, goal_rates = desired[: len(self.names)], desired[len(self.names) :]
        wanted = self.stiffness * (goals - positions) + self._damping * (goal_rates - rates) + feed_forward
        efforts: FloatArray = np.minimum(np.maximum(wanted, -self.efforts), self.efforts)
        return efforts


@dataclass(frozen=True)
class GripperGoal:
    """Target opening of a gripper (0 closed, in the unit of its kind) with at most `force_n` at the tip."""

    opening: float
    force_n: float


@dataclass(frozen=True)
class GripperTolerances:
    """Tolerances for a reached opening, and for fingers blocked by an object (units of the opening, s)."""

    arrived: float
    stall_rate: float
    stall_s: float = 0.25


class Closing(enum.Enum):
    """Progress of a gripper towards its goal."""

    MOVING = "moving"
    ARRIVED = "arrived"
    BLOCKED = "blocked"


class GripperServo(Stateful, saved=("goal", "_before", "_still_s")):
    """Servo of one gripper: its goal, and the previous goal."""

    def __init__(self, opening: float, tolerances: GripperTolerances) -> None:
        """Starts at this opening."""
        self._tolerances = tolerances
        self.goal = self._before = GripperGoal(opening, 20.0)
        self._still_s = 0.0

    def begin(self, goal: GripperGoal) -> None:
        """Sets a goal."""
        self._before, self.goal, self._still_s = self.goal, goal, 0.0

    def follow(self, opening: float, rate: float, dt_s: float) -> Closing:
        """Returns the progress after dt_s, at an opening that changes at `rate`."""
        self._still_s = self._still_s + dt_s if rate < self._tolerances.stall_rate else 0.0
        if abs(opening - self.goal.opening) < self._tolerances.arrived:
            return Closing.ARRIVED
        return Closing.BLOCKED if self._still_s > self._tolerances.stall_s else Closing.MOVING

    def halt(self, opening: float, rate: float) -> None:
        """Stops a moving gripper at its opening; a gripper with an object keeps its force, or its previous goal."""
        if rate >= self._tolerances.stall_rate:
            self.goal = GripperGoal(opening, self.goal.force_n)
        elif self.goal.opening > opening:
            self.goal = self._before


def clip(value: float, most: float) -> float:
    """Value, clipped to [-most, most]."""
    return min(max(value, -most), most)


def gripper_set_point(goal: float, now: float, lead: float) -> float:
    """Set point that limits a servo's force to its gain times `lead`."""
    return min(max(goal, now - lead), now + lead)


_ARRIVED_RAD = 0.03
_STILL_RAD_S = 0.06
_TRAJECTORY_START_RAD = 0.25


class ArmServos(Stateful, saved=("goal_rad",)):
    """Servos of one arm: the set points of its joints."""

    def __init__(self, joints: ActuatedJoints, now_rad: FloatArray) -> None:
        """Holds the arm; `now_rad` are the positions of all joints."""
        self._arm, self._fastest_rad_s = joints.arm, joints.fastest_arm_rad_s
        self._lower, self._upper = joints.lower[self._arm] - 1e-3, joints.upper[self._arm] + 1e-3
        self.hold(now_rad)

    def hold(self, joints_rad: FloatArray) -> None:
        """Holds the arm at its present position; `joints_rad` are the positions of all joints."""
        self.goal_rad, self.rate_rad_s = joints_rad[self._arm], np.zeros(len(self._arm))

    def refusal(self, trajectory: ArmTrajectory) -> str | None:
        """Reason why the arm cannot follow a trajectory from its set point; None when it can."""
        positions = trajectory.positions_rad
        if positions.shape[1] != len(self._arm):
            return f"move_arm: {positions.shape[1]} joints given, the arm has {len(self._arm)}"
        if np.any(positions < self._lower) or np.any(positions > self._upper):
            return "move_arm: the trajectory leaves the joint limits"
        if np.any(np.abs(positions[0] - self.goal_rad) > _TRAJECTORY_START_RAD):
            return "move_arm: the trajectory begins away from where the arm is"
        rates = np.abs(np.diff(positions, axis=0)) / np.diff(trajectory.times_s)[:, None]
        if rates.size and np.any(rates > self._fastest_rad_s):
            row, joint = np.unravel_index(int(np.argmax(rates / self._fastest_rad_s)), rates.shape)
            return (
                f"move_arm: a joint would move at {rates[row, joint]:.1f} rad/s; "
                f"at most {self._fastest_rad_s[joint]:.1f} is allowed"
            )
        return None

    def follow(
        self, trajectory: ArmTrajectory | None, elapsed_s: float, joints_rad: FloatArray, rates_rad_s: FloatArray
    ) -> bool:
        """Sets the set points for a time since the trajectory's start; returns True when the arm is at its end."""
        self.rate_rad_s = np.zeros(len(self._arm))
        if trajectory is None:
            return False
        self.goal_rad, self.rate_rad_s = arm_set_point(trajectory, elapsed_s)
        if elapsed_s < trajectory.times_s[-1]:
            return False
        off = np.abs(joints_rad[self._arm] - trajectory.positions_rad[-1]).max()
        return bool(off < _ARRIVED_RAD and np.abs(rates_rad_s[self._arm]).max() < _STILL_RAD_S)


def arm_set_point(trajectory: ArmTrajectory, elapsed_s: float) -> tuple[FloatArray, FloatArray]:
    """Positions (J,) and velocities (J,) on a trajectory at a time since its start; at rest outside its time range."""
    times, positions = trajectory.times_s, trajectory.positions_rad
    if len(times) == 1 or elapsed_s >= times[-1]:
        return positions[-1].copy(), np.zeros(positions.shape[1])
    if elapsed_s <= times[0]:
        return positions[0].copy(), np.zeros(positions.shape[1])
    k = int(np.searchsorted(times, elapsed_s, side="right")) - 1
    rate = (positions[k + 1] - positions[k]) / (times[k + 1] - times[k])
    return positions[k] + rate * (elapsed_s - times[k]), rate
