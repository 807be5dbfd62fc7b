"""A robot from a URDF in a MultibodyPlant, borne by a planar floating base, behind the Robot protocol."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, CollisionFilterManager, GeometrySet
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context

from plant.robots.command_table import Part, Velocity
from plant.robots.jointed_robot import FINGER_GAINS, JointedRobot, JointedSensors, JointIndex, gripper_noise
from plant.robots.robot_kind import PlacedRobot, RobotBody, SensorOptions
from plant.robots.sensor_suite import LidarMount
from plant.robots.spot.floating_base import FloatingBase, FloatingBaseLimits
from plant.robots.urdf_robot.description import Description
from plant.robots.urdf_robot.urdf_file import PACKAGE
from plant.sensors.lidar import LidarSpec
from skills.robot import CommandCause, CommandId, CommandState, FloatArray, Lease, Pose2D

_GAIN_PER_EFFORT = 12.0
"""Stiffness of a joint's servo over its effort limit, per rad: the limit is reached at five degrees."""
_LEAST_GAIN, _MOST_GAIN = 50.0, 3000.0
_DAMPING_S = 0.05
"""Damping of a joint's servo over its stiffness."""
_SPOT_KG = 33.0
"""Mass for which the floating base's forces and gains hold."""
_PLANAR_SIGMA_M = 0.015


class UrdfBody(RobotBody):
    """Bodies and joints of a robot from a URDF. The floating base bears it, so its wheels touch nothing."""

    def __init__(self, plant: MultibodyPlant, robot: PlacedRobot, description: Description) -> None:
        """Adds the robot to `plant` (before Finalize)."""
        self.description, assembly = description, description.assembly
        joints, gripper = assembly.urdf.joints, description.file.gripper
        fingers = {} if gripper is None else dict.fromkeys(gripper.joints, FINGER_GAINS[gripper.kind])
        stiff = {name: min(max(_GAIN_PER_EFFORT * joints[name].effort, _LEAST_GAIN), _MOST_GAIN) for name in joints}
        gains = {name: (stiff[name], _DAMPING_S * stiff[name]) for name in description.file.moving} | fingers
        packages = {PACKAGE: assembly.urdf.path.parent}
        super().__init__(plant, robot, assembly.text(pads=True), gains, packages)
        can = description.capabilities
        limits = robot.locomotion if isinstance(robot.locomotion, FloatingBaseLimits) else FloatingBaseLimits()
        own = replace(
            limits,
            speed_m_s=min(limits.speed_m_s, can.max_speed_m_s),
            turn_rate_rad_s=min(limits.turn_rate_rad_s, can.max_turn_rate_rad_s),
        )
        heavier = max(1.0, assembly.mass_kg / _SPOT_KG)
        self.floating_base = FloatingBase(plant, robot.name, self.body, own, heavier=heavier)
        if len(fingers) == 2 and gripper is not None:
            (one, share), (other, opposite) = gripper.joints.items()
            pair = (plant.GetJointByName(name, self.instance) for name in (one, other))
            plant.AddCouplerConstraint(*pair, share / opposite)

    def opening(self, context: Context) -> float:
        """Opening of the gripper, 0 without one."""
        gripper, q = self.description.file.gripper, self.plant.GetPositions(context)
        shares = {} if gripper is None else gripper.joints
        places = {name: self.plant.GetJointByName(name, self.instance).position_start() for name in shares}
        return float(np.mean([q[places[name]] / share for name, share in shares.items()])) if shares else 0.0

    def instances(self) -> tuple[ModelInstanceIndex, ...]:
        """Model instances of the robot and its floating base."""
        return (self.instance, self.floating_base.instance)

    def filter_collisions(self, filters: CollisionFilterManager, floor: GeometrySet) -> None:
        """Lets links of this robot pass each other, and its body pass the floor."""
        super().filter_collisions(filters, floor)
        body = GeometrySet(self.plant.GetCollisionGeometriesForBody(self.body))
        filters.Apply(CollisionFilterDeclaration().ExcludeBetween(body, floor))

    def place(self, context: Context, pose: Pose2D | None = None) -> None:
        """Sets the robot standing with its arm stowed: at a pose, else at its start."""
        arm = self.description.file.arm
        self.set_joints(context, {} if arm is None else dict(zip(arm.joints, arm.stowed, strict=True)))
        self.floating_base.place(context, pose or self.robot.start, self.description.file.base.height)


class UrdfSensors(JointedSensors):
    """Sensors of a robot from a URDF."""

    def __init__(self, body: UrdfBody, joints: JointIndex, options: SensorOptions) -> None:
        """Mounts the sensors on `body`."""
        file, self._X_BL_mounted = body.description.file, body.description.X_BL()
        lidar = file.lidar
        full = lidar.field_of_view > math.tau - 0.01
        step_rad = (math.tau if full else lidar.field_of_view) / lidar.points
        spec = LidarSpec(
            rings=lidar.rings,
            half_fov_rad=lidar.opening / 2.0,
            azimuth_step_rad=math.tau / round(math.tau / step_rad),
            min_range_m=lidar.range[0],
            max_range_m=lidar.range[1],
            sigma_m=_PLANAR_SIGMA_M if lidar.rings == 1 else LidarSpec().sigma_m,
            columns=None if full else lidar.points,
        )
        super().__init__(
            body,
            joints,
            options,
            lidar=LidarMount(body.body, self._X_BL_mounted, spec, 1.0 / lidar.rate),
            cameras=body.description.cameras(),
            runtime_s=file.base.runtime,
            gripper_noise=gripper_noise(body),
        )

    def _X_BL(self) -> RigidTransform:
        return self._X_BL_mounted


class UrdfRobot(JointedRobot, saved=("_floating_base",)):
    """Robot from a URDF: turns the commands of the lease's holder into set points of the plant's servos."""

    def __init__(self, body: UrdfBody, options: SensorOptions) -> None:
        """Takes over the robot at the state of `options.context`, at time 0."""
        joints = body.description.assembly.urdf.joints
        index = JointIndex(body, {name: joint.velocity for name, joint in joints.items()})
        super().__init__(body, index, UrdfSensors(body, index, options), options.context)
        self._floating_base, self._height_m = body.floating_base, body.description.file.base.height

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Stands at its only height; it does not pitch."""
        if abs(height_m - self._height_m) > 1e-6 or pitch_rad != 0.0:
            what = f"height {height_m:.2f} m must be {self._height_m:.2f} and pitch {pitch_rad:.2f} rad 0"
            return self._commands.refuse(f"stand: {what}")
        return self._begin(Part.POSTURE, self._height_m, until_s, lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Stops to drive, since the base cannot be lowered."""
        command = self._begin(Part.POSTURE, self._height_m, until_s, lease)
        if self._runs(command):
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, "the robot sits down", CommandCause.STOPPED)
        return command

    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        self._commands.finish(Part.POSTURE, CommandState.DONE)
        wanted, base = self._goal(Part.VELOCITY, Velocity), self._floating_base
        pose = base.pose(self._plant.GetPositions(self._context))
        posture = (self._height_m, 0.0)
        base.control(self._context, pose, wanted or Velocity(), posture, dt_s, stopping=wanted is None)
        return super()._desired(joints, rates, dt_s)
