"""Things that lie still far from every robot are held where they lie, so that they cost no time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from plant.snapshot.values import State

NEAR_M = 2.0
"""A robot whose body is nearer than this to a thing may touch it (arm and step included)."""
STILL_M_S = 0.005
STILL_RAD_S = 0.05
STILL_LOOKS = 3


class RestingThings:
    """Locks the free joint of a thing that has lain still while no robot was near, and frees it when one comes near.

    What is locked has lain still at several looks in a row: its contact forces were in balance, so holding it changes
    nothing but the time that the contact solver takes.
    """

    def __init__(
        self, plant: MultibodyPlant, things: Mapping[str, ModelInstanceIndex], robots: Sequence[RigidBody]
    ) -> None:
        """`things` by name, those that are fixed left out by themselves; `robots` are the bodies of the robots."""
        self._plant, self._robots = plant, tuple(robots)
        self._joints = {name: joint for name, each in sorted(things.items()) if (joint := _free_joint(plant, each))}
        self._still = dict.fromkeys(self._joints, 0)

    def look(self, context: Context) -> None:
        """Lock and free; `context` is the plant's."""
        p_WB = [_place(self._plant, context, body) for body in self._robots]
        for name, joint in self._joints.items():
            p_WO = _place(self._plant, context, joint.child_body())
            near = any(np.linalg.norm(p_WO - p) < NEAR_M for p in p_WB)
            if near or not self._is_still(context, joint):
                self._still[name] = 0
                joint.Unlock(context)
                continue
            self._still[name] += 1
            if self._still[name] == STILL_LOOKS:
                joint.Lock(context)

    def state(self) -> State:
        """How many looks each thing has lain still."""
        return dict(self._still)

    def restore(self, state: State, context: Context) -> None:
        """Go on from such a state."""
        for name, joint in self._joints.items():
            self._still[name] = state[name]
            (joint.Lock if state[name] >= STILL_LOOKS else joint.Unlock)(context)

    def _is_still(self, context: Context, joint: Joint) -> bool:
        V_WO = self._plant.EvalBodySpatialVelocityInWorld(context, joint.child_body())
        slow = float(np.linalg.norm(V_WO.translational())) < STILL_M_S
        return slow and float(np.linalg.norm(V_WO.rotational())) < STILL_RAD_S


def _free_joint(plant: MultibodyPlant, instance: ModelInstanceIndex) -> Joint | None:
    """The joint with six degrees of freedom that a loose model of one body hangs on; None for what is fixed."""
    joints = (plant.get_joint(index) for index in plant.GetJointIndices())
    free = [
        joint for joint in joints if joint.num_velocities() == 6 and joint.child_body().model_instance() == instance
    ]
    return free[0] if len(free) == 1 else None


def _place(plant: MultibodyPlant, context: Context, body: RigidBody) -> NDArray[np.float64]:
    return np.asarray(plant.EvalBodyPoseInWorld(context, body).translation())
