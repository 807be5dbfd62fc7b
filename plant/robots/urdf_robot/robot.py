"""A robot from a URDF in a MultibodyPlant, behind the Robot protocol; also a variant on a planar floating base."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, CollisionFilterManager, GeometrySet
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context

from plant.robots.commanded_robot import CommandedRobot
from plant.robots.robot_kind import PlacedRobot, RobotBody, SensorOptions
from plant.robots.sensor_suite import LidarMount, SensorSuite
from plant.robots.servos import ActuatedJoints, GripperTolerances, Part, Velocity, clip, gripper_set_point
from plant.robots.spot.floating_base import FloatingBase, FloatingBaseLimits
from plant.robots.urdf_robot.description import Description
from plant.robots.urdf_robot.urdf_file import PACKAGE
from plant.sensors.lidar import LidarSpec
from plant.sensors.proprioception import GripperNoise
from skills.robot import BaseKind, CommandCause, CommandId, CommandState, FloatArray, GripperKind, Lease, Pose2D

_GAIN_PER_EFFORT = 12.0
"""Stiffness of a joint's servo over its effort limit, per rad: the limit is reached at five degrees."""
_LEAST_GAIN, _MOST_GAIN = 50.0, 3000.0
_DAMPING_S = 0.05
"""Damping of a joint's servo over its stiffness."""
_SPOT_KG = 33.0
"""Mass for which the floating base's forces and gains hold."""
_PLANAR_SIGMA_M = 0.015
_LIFT_ARRIVED_M = 0.01
_SAME_HEIGHT_M = 1e-6
_HEAD_ARRIVED_RAD, _HEAD_STILL_RAD_S = 0.01, 0.05
_HEAD_SPEED_SHARE = 0.8
"""Fraction of the head's top speed that its weak motors can follow."""
_TOLERANCES = {
    GripperKind.PARALLEL: GripperTolerances(arrived=0.002, stall_rate=0.004),
    GripperKind.HINGED: GripperTolerances(arrived=0.03, stall_rate=0.03),
}
_NOISES = {
    GripperKind.PARALLEL: GripperNoise(opening=0.0003, closed=0.002, thin=0.0),
    GripperKind.HINGED: GripperNoise(),
}
_MOVES = {GripperKind.PARALLEL: 0.04, GripperKind.HINGED: 0.05}
"""Rates of an opening (m/s, rad/s) beyond which fingers feel no force; what they carry moves them by a tenth."""
_FINGER_GAINS = {GripperKind.PARALLEL: (2e4, 200.0), GripperKind.HINGED: (60.0, 0.8)}
"""Gains (p, d) of the fingers' servos."""


class UrdfBody(RobotBody):
    """Bodies and joints of a robot from a URDF; `base` is its link that stands on the floor."""

    def __init__(self, plant: MultibodyPlant, robot: PlacedRobot, description: Description) -> None:
        """Adds the robot to `plant` (before Finalize)."""
        self.description, assembly = description, description.assembly
        file, joints = description.file, assembly.urdf.joints
        fingers = {} if file.gripper is None else dict.fromkeys(file.gripper.joints, _FINGER_GAINS[file.gripper.kind])
        stiff = {name: min(max(_GAIN_PER_EFFORT * joints[name].effort, _LEAST_GAIN), _MOST_GAIN) for name in joints}
        gains = {name: (stiff[name], _DAMPING_S * stiff[name]) for name in file.moving} | fingers | file.gains
        super().__init__(plant, robot, assembly.text(), gains, {PACKAGE: assembly.urdf.path.parent})
        self.base = plant.GetBodyByName(assembly.root, self.instance)
        if file.gripper is not None and len(fingers) == 2:
            (one, share), (other, opposite) = file.gripper.joints.items()
            pair = (plant.GetJointByName(name, self.instance) for name in (one, other))
            plant.AddCouplerConstraint(*pair, share / opposite)

    def opening(self, context: Context) -> float:
        """Opening of the gripper; 0 when there is none."""
        gripper, q = self.description.file.gripper, self.plant.GetPositions(context)
        shares = {} if gripper is None else gripper.joints
        places = {name: self.plant.GetJointByName(name, self.instance).position_start() for name in shares}
        return float(np.mean([q[places[name]] / share for name, share in shares.items()])) if shares else 0.0

    def place(self, context: Context, pose: Pose2D | None = None) -> None:
        """Sets the robot standing with its arm stowed and its lift at the height for driving."""
        arm, lift = self.description.file.arm, self.description.file.lift
        joints = {} if arm is None else dict(zip(arm.joints, arm.stowed, strict=True))
        self.set_joints(context, joints if lift is None else {**joints, lift.joint: lift.travelling})
        self._place_base(context, pose or self.robot.start, self.description.assembly.base_height_m)

    @abstractmethod
    def _place_base(self, context: Context, pose: Pose2D, height_m: float) -> None:
        """Sets the pose of `base`, whose frame is at a height above the floor."""


class UrdfIndex(ActuatedJoints):
    """Joints of head, arm, fingers and lift; `shares` are the finger positions at an opening of 1."""

    def __init__(self, body: UrdfBody) -> None:
        super().__init__(body.plant, body.instance)
        can, joints = body.kind.capabilities(), body.description.assembly.urdf.joints
        fingers = () if can.gripper is None else can.gripper.finger_joints
        self.head = self.numbers(() if can.head is None else can.head.joint_names)
        self.arm = self.numbers(() if can.arm is None else can.arm.joint_names)
        self.fingers, self.shares = self.numbers([name for name, _ in fingers]), np.array([each for _, each in fingers])
        self.kind = GripperKind.PARALLEL if can.gripper is None else can.gripper.kind
        self.lever = 1.0 if can.gripper is None or self.kind is GripperKind.PARALLEL else can.gripper.depth_m
        self.lift = self.numbers(() if can.lift_joint is None else (can.lift_joint,))
        fastest = np.array([joints[name].velocity for name in self.names])
        self.fastest_arm_rad_s, self.head_rad_s = fastest[self.arm], _HEAD_SPEED_SHARE * fastest[self.head]
        self.finger_rates = fastest[self.fingers]

    def opening(self, joints: FloatArray) -> float:
        """Opening of the gripper from all joint positions, or its rate from all joint rates; 0 without a gripper."""
        return float(np.mean(joints[self.fingers] / self.shares)) if len(self.shares) else 0.0


class UrdfSensors(SensorSuite):
    """Sensors of a robot from a URDF, whose fingers slide or turn."""

    _index: UrdfIndex

    def __init__(self, body: UrdfBody, joints: UrdfIndex, options: SensorOptions) -> None:
        """Mounts the sensors on `body`."""
        self._file, self._X_BaseL = body.description.file, body.description.X_BaseL()
        super().__init__(
            body,
            joints,
            options,
            lidar=LidarMount(body.base, self._X_BaseL, lidar_spec(body.description), 1.0 / self._file.lidar.rate),
            cameras=body.description.cameras(),
            runtime_s=self._file.base.runtime,
            gripper_noise=_NOISES[joints.kind],
        )

    def _gripper_feels(self, positions: FloatArray, rates: FloatArray, efforts: FloatArray) -> tuple[float, float]:
        """Opening of the gripper, and the force that each finger exerts on an object."""
        index = self._index
        opening, fingers = index.opening(positions), index.fingers
        if not len(fingers) or abs(index.opening(rates)) > _MOVES[index.kind]:
            return opening, 0.0
        return opening, max(0.0, -float((efforts[fingers] * np.sign(index.shares)).mean())) / index.lever

    def _X_BL(self) -> RigidTransform:
        """Pose of the LiDAR, which stays with the base when the lift moves the body frame."""
        lift = self._file.lift
        if lift is None:
            return self._X_BaseL
        height_m = self._file.base.height + self.joints.position_rad[lift.joint]
        return RigidTransform(self._X_BaseL.rotation(), self._X_BaseL.translation() - [0.0, 0.0, height_m])


def lidar_spec(description: Description) -> LidarSpec:
    """Specification of the LiDAR in a robot's file."""
    lidar = description.file.lidar
    full = lidar.field_of_view > math.tau - 0.01
    step_rad = (math.tau if full else lidar.field_of_view) / lidar.points
    return LidarSpec(
        rings=lidar.rings,
        half_fov_rad=lidar.opening / 2.0,
        azimuth_step_rad=math.tau / round(math.tau / step_rad),
        min_range_m=lidar.range[0],
        max_range_m=lidar.range[1],
        sigma_m=_PLANAR_SIGMA_M if lidar.rings == 1 else LidarSpec().sigma_m,
        columns=None if full else lidar.points,
    )


@dataclass(frozen=True)
class _Height:
    """Posture goal: a height of the body frame above the floor."""

    height_m: float


class UrdfRobot(CommandedRobot, saved=("_finger_goals", "_head", "_head_goal", "_lift", "_lift_goal")):
    """Robot from a URDF: converts the commands of the lease holder to set points of the plant's servos.

    For a robot without a lift, the lift is a joint at 0 that does not move.
    """

    _index: UrdfIndex

    def __init__(self, body: UrdfBody, index: UrdfIndex, sensors: UrdfSensors, options: SensorOptions) -> None:
        """Takes control of the robot in the state of `options.context`, at time 0."""
        super().__init__(body, index, sensors, options.context, _TOLERANCES[index.kind])
        file, joints = body.description.file, self._joints()
        self._finger_goals = joints[index.fingers]
        self._head = self._head_goal = joints[index.head]
        self._lift_m_s = 0.0 if file.lift is None else body.description.assembly.urdf.joints[file.lift.joint].velocity
        self._lift = self._lift_goal = float(joints[index.lift].sum())
        self._height_m = file.base.height

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Raises the body frame to a height above the floor; ignores the pitch."""
        low, high = self._capabilities.height_range_m
        if not (low - _SAME_HEIGHT_M <= height_m <= high + _SAME_HEIGHT_M and pitch_rad == 0.0):
            return self._commands.refuse(
                f"stand: height {height_m:.2f} m must lie in [{low:.2f}, {high:.2f}] "
                f"and pitch {pitch_rad:.2f} rad must be 0"
            )
        return self._begin(Part.POSTURE, _Height(height_m), until_s, lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the lift; driving stops."""
        command = self._begin(Part.POSTURE, _Height(self._capabilities.height_range_m[0]), until_s, lease)
        if self._runs(command):
            reason = "the robot lowers its torso" if len(self._index.lift) else "the robot sits down"
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, reason, CommandCause.STOPPED)
        return command

    @abstractmethod
    def _drive(self, wanted: Velocity | None, joints: FloatArray, desired: FloatArray, dt_s: float) -> None:
        """Commands the base for the next dt_s; None stops it."""

    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        self._follow_head(joints, rates)
        self._follow_lift(joints)
        desired = np.zeros(2 * len(joints))
        self._set_fingers(desired, joints[self._index.fingers], dt_s)
        self._ramp_head(desired, dt_s)
        self._drive(self._goal(Part.VELOCITY, Velocity), joints, desired, dt_s)
        self._ramp_lift(desired, dt_s)
        return desired

    def _hold_still(self, part: Part) -> None:
        super()._hold_still(part)
        if part is Part.HEAD:
            self._head_goal = self._head
        if part is Part.POSTURE:
            self._lift_goal = self._lift

    def _follow_lift(self, joints: FloatArray) -> None:
        goal = self._goal(Part.POSTURE, _Height)
        if goal is None:
            return
        self._lift_goal = goal.height_m - self._height_m
        if np.all(np.abs(joints[self._index.lift] - self._lift_goal) < _LIFT_ARRIVED_M):
            self._commands.finish(Part.POSTURE, CommandState.DONE)

    def _ramp_lift(self, desired: FloatArray, dt_s: float) -> None:
        step_m = clip(self._lift_goal - self._lift, self._lift_m_s * dt_s)
        self._lift += step_m
        desired[self._index.lift], desired[self._index.rates_of(self._index.lift)] = self._lift, step_m / dt_s

    def _drive_refusal(self, velocity: Velocity) -> str | None:
        if velocity.vy == 0.0 or self._capabilities.base_kind is BaseKind.OMNIDIRECTIONAL:
            return None
        return f"drive: two wheels cannot drive sideways, as {velocity.vy:.2f} m/s asks for"

    def _follow_head(self, joints: FloatArray, rates: FloatArray) -> None:
        goal, head = self._goal(Part.HEAD, tuple), self._index.head
        if goal is None:
            return
        self._head_goal = np.array(goal)
        there = float(np.abs(joints[head] - self._head_goal).max()) < _HEAD_ARRIVED_RAD
        if there and float(np.abs(rates[head]).max()) < _HEAD_STILL_RAD_S:
            self._commands.finish(Part.HEAD, CommandState.DONE)

    def _set_fingers(self, desired: FloatArray, now: FloatArray, dt_s: float) -> None:
        """Sets the set points of the fingers, at their speed and with at most the goal's force."""
        goal, index = self._gripper.goal, self._index
        most = index.finger_rates * dt_s
        moved = self._finger_goals + np.clip(goal.opening * index.shares - self._finger_goals, -most, most)
        leads = goal.force_n * index.lever / index.stiffness[index.fingers]
        each = zip(moved.tolist(), now.tolist(), leads.tolist(), strict=True)
        self._finger_goals = np.array([gripper_set_point(*one) for one in each])
        desired[index.fingers] = self._finger_goals

    def _ramp_head(self, desired: FloatArray, dt_s: float) -> None:
        index = self._index
        most_rad = index.head_rad_s * dt_s
        step_rad = np.clip(self._head_goal - self._head, -most_rad, most_rad)
        self._head = self._head + step_rad
        desired[index.head], desired[index.rates_of(index.head)] = self._head, step_rad / dt_s

    def _fingers_at(self, joints: FloatArray, rates: FloatArray) -> tuple[float, float]:
        index = self._index
        return index.opening(joints), abs(index.opening(rates))


class FloatingBody(UrdfBody):
    """Bodies and joints of a robot on a floating base, which does not touch the floor."""

    def __init__(self, plant: MultibodyPlant, robot: PlacedRobot, description: Description) -> None:
        """Adds the robot to `plant` (before Finalize)."""
        super().__init__(plant, robot, description)
        can = description.capabilities
        limits = robot.locomotion if isinstance(robot.locomotion, FloatingBaseLimits) else FloatingBaseLimits()
        own = replace(
            limits,
            speed_m_s=min(limits.speed_m_s, can.max_speed_m_s),
            turn_rate_rad_s=min(limits.turn_rate_rad_s, can.max_turn_rate_rad_s),
        )
        heavier = max(1.0, description.assembly.mass_kg / _SPOT_KG)
        self.floating_base = FloatingBase(plant, robot.name, self.base, own, heavier=heavier)

    def instances(self) -> tuple[ModelInstanceIndex, ...]:
        """Model instances of the robot and its floating base."""
        return (self.instance, self.floating_base.instance)

    def filter_collisions(self, filters: CollisionFilterManager, floor: GeometrySet) -> None:
        """Disables collisions between links of this robot, and between its base and the floor."""
        super().filter_collisions(filters, floor)
        base = GeometrySet(self.plant.GetCollisionGeometriesForBody(self.base))
        filters.Apply(CollisionFilterDeclaration().ExcludeBetween(base, floor))

    def _place_base(self, context: Context, pose: Pose2D, height_m: float) -> None:
        self.floating_base.place(context, pose, height_m)


class FloatingRobot(UrdfRobot, saved=("_floating_base",)):
    """Robot driven by a floating base."""

    def __init__(self, body: FloatingBody, options: SensorOptions) -> None:
        """Takes control of the robot in the state of `options.context`, at time 0."""
        index = UrdfIndex(body)
        super().__init__(body, index, UrdfSensors(body, index, options), options)
        self._floating_base = body.floating_base
        self._posture = (body.description.assembly.base_height_m, 0.0)

    def _drive(self, wanted: Velocity | None, joints: FloatArray, desired: FloatArray, dt_s: float) -> None:
        base = self._floating_base
        pose = base.pose(self._plant.GetPositions(self._context))
        base.control(self._context, pose, wanted or Velocity(), self._posture, dt_s, stopping=wanted is None)
