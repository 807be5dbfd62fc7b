"""Where a robot's joints stand in the plant's state, and what their servos do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from skills.robot import FloatArray

Indices = NDArray[np.int64]


class ActuatedJoints:
    """The actuated joints of a model instance, in the order of its actuators; after Finalize.

    `positions` and `velocities` index the plant's state. In the actuators' desired state positions come first, then
    velocities: a joint's place there is its number here, and `rates_of` gives that of its velocity.
    Each kind of robot says which are the arm's, and their speed limits (rad/s).
    """

    arm: Indices
    fastest_arm_rad_s: FloatArray

    def __init__(self, plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
        actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices(instance)]
        joints = [actuator.joint() for actuator in actuators]
        self.names = tuple(joint.name() for joint in joints)
        self.positions = np.array([joint.position_start() for joint in joints])
        self.velocities = np.array([joint.velocity_start() for joint in joints])
        self.efforts = np.array([actuator.effort_limit() for actuator in actuators])
        self.lower = np.array([joint.position_lower_limits()[0] for joint in joints])
        self.upper = np.array([joint.position_upper_limits()[0] for joint in joints])
        gains = [actuator.get_controller_gains() for actuator in actuators]
        self.stiffness = np.array([each.p for each in gains])
        self._damping = np.array([each.d for each in gains])

    def numbers(self, names: Sequence[str]) -> Indices:
        """The joints' numbers, in the order of `names`."""
        return np.array([self.names.index(name) for name in names])

    def rates_of(self, numbers: Indices) -> Indices:
        """Where the velocities of joints stand in the desired state."""
        return len(self.names) + numbers

    def efforts_of(
        self, desired: FloatArray, feed_forward: FloatArray, positions: FloatArray, rates: FloatArray
    ) -> FloatArray:
        """Efforts of the actuators in a state, for a desired state and feed-forward efforts."""
        goals, goal_rates = desired[: len(self.names)], desired[len(self.names) :]
        wanted = self.stiffness * (goals - positions) + self._damping * (goal_rates - rates) + feed_forward
        efforts: FloatArray = np.minimum(np.maximum(wanted, -self.efforts), self.efforts)
        return efforts
