"""What a hand carries follows it to second order, where the plant's steps are of first order.

A step moves a free body along its velocity, but a robot's joints along their arcs. A body that is held at a distance r
of an axis about which the robot turns at w would creep outwards by w^2 r dt^2 / 2 a step, that is 3 mm/s at 0.75 rad/s,
and leave the gripper within a minute of walking. What moves with a hand is therefore moved by a dt^2 / 2 after each
step, where a is how the hand's point there accelerates at the present rates of all joints: only what turns bends a
path, so a hand that moves straight on while its wrist turns bends that of its own middle not at all. Taken as w x v of
the hand it was off by 6 mm/s in an arm's motion and pressed what was held into one finger, until the other lost touch.
Forces, velocities and contacts stay those of the plant.

Nor do such steps follow a body that spins fast: its gyroscopic torque, taken at the step's beginning, makes a flat
wrench that flies out of the fingers spin ever faster, until nothing is finite. And what turns by radians in a step
comes to lie deep in what it touches: a can that is wrung out of the fingers at 600 rad/s leaves a table at 90 m/s
within three steps. Free bodies therefore spin no faster, after any step, than the next one can follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, RigidBody
from pydrake.systems.framework import Context

from skills.robot import FloatArray

WITH_HAND_M_S: Final = 0.02
"""What moves against the hand by less than this moves with it."""
FASTEST_SPIN_RAD_S: Final = 25.0
"""A third of a radian in a step of 12.5 ms."""
_FASTEST_ALONG_RAD_S: Final = FASTEST_SPIN_RAD_S / 3.0**0.5
"""What spins no faster about any axis cannot be too fast."""
_AT_HAND_M: Final = 0.5


class Carried:
    """Corrects the free bodies among `loose` that a hand carries; call `after_step` after each step of the plant."""

    def __init__(self, plant: MultibodyPlant, context: Context, loose: Sequence[RigidBody]) -> None:
        self._plant, self._context = plant, context
        self._loose = [body for body in loose if body.is_floating_base_body()]
        starts = [body.floating_velocities_start_in_v() for body in self._loose]
        places = [body.floating_positions_start() + 4 for body in self._loose]
        self._places = np.array([range(start, start + 3) for start in places], dtype=np.int64).reshape(-1, 3)
        self._spins = np.array([range(start, start + 3) for start in starts], dtype=np.int64).reshape(-1, 3)

    def after_step(self, hand: RigidBody, dt_s: float) -> None:
        """Moves what the hand carries along its arc; dt_s is the length of the step."""
        plant, context = self._plant, self._context
        p_WH = plant.EvalBodyPoseInWorld(context, hand).translation()
        places_W = plant.GetPositions(context)[self._places]
        near = np.flatnonzero(np.abs(places_W - p_WH).max(axis=1) <= _AT_HAND_M)
        if len(near) == 0:
            return
        V_WH = plant.EvalBodySpatialVelocityInWorld(context, hand)
        for number in near:
            body, p_WO = self._loose[number], places_W[number]
            v_WO = plant.EvalBodySpatialVelocityInWorld(context, body).translational()
            with_hand = V_WH.translational() + _cross(V_WH.rotational(), p_WO - p_WH)
            if np.linalg.norm(v_WO - with_hand) < WITH_HAND_M_S:
                self._shift(body, arc_m(self._bias_m_s2(hand, p_WO), dt_s))

    def _bias_m_s2(self, hand: RigidBody, p_WO: FloatArray) -> FloatArray:
        """How the hand's point at p_WO accelerates while no joint's rate changes (m/s^2)."""
        plant, context, world = self._plant, self._context, self._plant.world_frame()
        p_HO = plant.EvalBodyPoseInWorld(context, hand).inverse() @ p_WO
        rates = JacobianWrtVariable.kV
        bias = plant.CalcBiasSpatialAcceleration(context, rates, hand.body_frame(), p_HO, world, world)
        return np.asarray(bias.translational())

    def limit_spin(self) -> None:
        """Slows down the free bodies that spin faster than `FASTEST_SPIN_RAD_S`."""
        velocities = self._plant.GetVelocities(self._context)
        spins = velocities[self._spins]
        if spins.size and np.abs(spins).max() > _FASTEST_ALONG_RAD_S:
            rates = np.linalg.norm(spins, axis=1, keepdims=True)
            velocities[self._spins] = spins * np.minimum(1.0, FASTEST_SPIN_RAD_S / np.maximum(rates, 1e-9))
            self._plant.SetVelocities(self._context, velocities)

    def _shift(self, body: RigidBody, offset_W: FloatArray) -> None:
        q = self._plant.GetPositions(self._context)
        start = body.floating_positions_start() + 4
        q[start : start + 3] += offset_W
        self._plant.SetPositions(self._context, q)


def arc_m(acceleration_W: FloatArray, dt_s: float) -> FloatArray:
    """How far (m) a point that accelerates (m/s^2) is off its tangent after dt_s."""
    return np.asarray(0.5 * dt_s**2 * acceleration_W)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """The product a x b of two vectors (3,)."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
