"""Fetch in a MultibodyPlant: its model on its own wheels, the gains of its servos, and the indices of its joints."""

from __future__ import annotations

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from plant.robots.fetch.description import (
    BASE_LINK,
    FINGERS,
    HEAD_JOINTS,
    LIFT_JOINT,
    WHEELS,
    fetch_facts,
    fetch_urdf,
)
from plant.robots.fetch.wheels import WheelLimits
from plant.robots.jointed_robot import FINGER_GAINS, JointIndex
from plant.robots.robot_kind import PlacedRobot, RobotBody
from skills.robot import GripperKind, Pose2D

_GAINS = {
    **dict.fromkeys(WHEELS, (20.0, 15.0)),
    LIFT_JOINT: (4e4, 3e3),
    **dict.fromkeys(HEAD_JOINTS, (20.0, 1.5)),
    "shoulder_pan": (900.0, 45.0),
    "shoulder_lift": (1500.0, 75.0),
    "upperarm_roll": (900.0, 45.0),
    "elbow_flex": (900.0, 45.0),
    "forearm_roll": (300.0, 12.0),
    "wrist_flex": (300.0, 12.0),
    "wrist_roll": (100.0, 4.0),
    **dict.fromkeys(FINGERS, FINGER_GAINS[GripperKind.PARALLEL]),
}


class FetchModel(RobotBody):
    """Bodies and joints of Fetch in a plant; it stands on wheels and casters, and its fingers are coupled."""

    def __init__(self, plant: MultibodyPlant, robot: PlacedRobot) -> None:
        """Adds the robot to `plant` (before Finalize)."""
        super().__init__(plant, robot, fetch_urdf(), _GAINS)
        self.limits = robot.locomotion if isinstance(robot.locomotion, WheelLimits) else WheelLimits()
        self.base = plant.GetBodyByName(BASE_LINK, self.instance)
        left, right = (plant.GetJointByName(finger, self.instance) for finger in FINGERS)
        plant.AddCouplerConstraint(left, right, 1.0)

    def opening(self, context: Context) -> float:
        """Distance between the fingers (m)."""
        positions = self.plant.GetPositions(context)
        joints = (self.plant.GetJointByName(finger, self.instance) for finger in FINGERS)
        return sum(float(positions[joint.position_start()]) for joint in joints)

    def place(self, context: Context, pose: Pose2D | None = None) -> None:
        """Sets the robot on its wheels, the torso at its height for travelling and the arm stowed."""
        facts = fetch_facts()
        self.set_joints(context, {**facts["stowed"], LIFT_JOINT: facts["capabilities"]["travelling_lift"]})
        self.plant.SetFreeBodyPose(context, self.base, (pose or self.robot.start).transform())


class FetchJoints(JointIndex):
    """Joints of Fetch: those of head, arm and fingers, the wheels, and the lift."""

    def __init__(self, body: RobotBody) -> None:
        facts = fetch_facts()
        speeds = {part["link"]: part["velocity"] for part in (*facts["arm"], *facts["head"])}
        super().__init__(body, {**speeds, **dict.fromkeys(FINGERS, facts["finger"]["velocity"])})
        self.wheels, self.lift = self.numbers(WHEELS), self.names.index(LIFT_JOINT)
