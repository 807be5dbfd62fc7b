"""What robots hold out: a loose object in a gripper before the robot's outline, clear of everything, and still."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.kept import Kept
from plant.sensors.ray_shapes import ShapeKind, shape_row
from skills.robot import FloatArray

LEAST_HEIGHT_M = 0.5
STILL_M_S, MOVES_M_S = 0.03, 0.15
BEYOND_OUTLINE_M = 0.05
_AT_HAND_M = 0.5


@dataclass(frozen=True)
class Offer:
    """An object that a robot holds."""

    robot: str
    thing: str


class Offers(Kept, keeps=("_still_since_s",)):
    """What the robots of one plant hold out; call `look` regularly."""

    def __init__(self, world: WorldDiagram, context: Context) -> None:
        plant = world.plant
        self._plant, self._context, self._query = plant, context, plant.get_geometry_query_input_port()
        self._inspector = world.scene_graph.model_inspector()
        self._robots = world.robots
        outlines = {name: np.array(robot.kind.capabilities().footprint_m) for name, robot in world.robots.items()}
        self._outlines_B = {name: (corners.min(axis=0), corners.max(axis=0)) for name, corners in outlines.items()}
        self._bodies = {name: robot.body for name, robot in world.robots.items()}
        self._links = {
            name: [plant.GetBodyByName(link, robot.instance) for link in robot.kind.gripper_links]
            for name, robot in world.robots.items()
        }
        grippers = {name: robot.kind.capabilities().gripper for name, robot in world.robots.items()}
        self._p_HT = {
            name: np.array([0.0 if gripper is None else gripper.grip_x_m, 0.0, 0.0])
            for name, gripper in grippers.items()
        }
        models = ((name, plant.get_body(plant.GetBodyIndices(model)[0])) for name, model in world.models.items())
        self.loose = {name: body for name, body in models if body.is_floating_base_body()}
        self._shapes = {
            int(body.index()): [
                shape_row(self._inspector, shape) for shape in plant.GetCollisionGeometriesForBody(body)
            ]
            for body in (*self.loose.values(), *(link for links in self._links.values() for link in links))
        }
        bodies = (*self.loose.values(), *(link for links in self._links.values() for link in links))
        self._owners: Mapping[GeometryId, int] = {
            shape: int(body.index()) for body in bodies for shape in plant.GetCollisionGeometriesForBody(body)
        }
        self._still_since_s: dict[str, float] = {}

    def look(self, now_s: float, holding: Sequence[str]) -> None:
        """Note which robots hold something out, and since when."""
        out = [name for name in holding if self._holds_out(name)]
        self._still_since_s = {name: self._still_since_s.get(name, now_s) for name in out}

    def near(self, p_WP: FloatArray, reach_m: float, since_s: float) -> Offer | None:
        """What has been held out since a time within reach of somebody at p_WP, free of all else."""
        for name, still_s in self._still_since_s.items():
            away_m = math.dist(self.grip_W(name)[:2], p_WP[:2])
            if still_s <= since_s and away_m <= reach_m and (thing := self._free_in(name)) is not None:
                return Offer(name, thing)
        return None

    def holds(self, offer: Offer) -> bool:
        """Whether an object is still held out, be it that the arm gives way to a pull; what is moved faster is not."""
        p_WO = self._plant.EvalBodyPoseInWorld(self._context, self.loose[offer.thing]).translation()
        at_hand = float(np.linalg.norm(p_WO - self.grip_W(offer.robot))) < _AT_HAND_M
        return at_hand and self._before_outline(offer.robot) and self._hand_m_s(offer.robot) < MOVES_M_S

    def grips(self, offer: Offer) -> bool:
        """Whether the gripper still touches an object that touches nothing else."""
        return self._free_in(offer.robot) == offer.thing

    def grip_W(self, robot: str) -> FloatArray:
        """Where a robot's fingers grip."""
        return np.asarray(self._plant.EvalBodyPoseInWorld(self._context, self._links[robot][0]) @ self._p_HT[robot])

    def in_hand(self, offer: Offer) -> FloatArray:
        """Where an object is in the hand (3,), m."""
        X_WH = self._plant.EvalBodyPoseInWorld(self._context, self._links[offer.robot][0])
        return np.asarray(X_WH.inverse() @ self.place_W(offer))

    def opening(self, robot: str) -> float:
        """How far a robot's gripper is open, in its own unit."""
        return self._robots[robot].opening(self._context)

    def lowest_m(self, offer: Offer) -> float:
        """The height of the lowest point of an object and of the gripper that holds it."""
        bodies = (self.loose[offer.thing], *self._links[offer.robot])
        return min(z for body in bodies for z in self._lows_m(body))

    def place_W(self, offer: Offer) -> FloatArray:
        """The object's centre of mass."""
        body = self.loose[offer.thing]
        return np.asarray(self._plant.EvalBodyPoseInWorld(self._context, body) @ body.default_com())

    def _lows_m(self, body: RigidBody) -> Iterator[float]:
        """The lowest height of each shape of a body."""
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, body)
        for kind, half_m, X_BG in self._shapes[int(body.index())]:
            X_WG = X_WB @ X_BG
            down = np.abs(X_WG.rotation().matrix()[2])
            yield float(X_WG.translation()[2]) - _reach_m(kind, half_m, down)

    def _holds_out(self, robot: str) -> bool:
        """Whether a robot that holds something keeps its hand still before itself, high enough."""
        if self._hand_m_s(robot) > STILL_M_S:
            return False
        return self.grip_W(robot)[2] >= LEAST_HEIGHT_M and self._before_outline(robot)

    def _hand_m_s(self, robot: str) -> float:
        V_WH = self._plant.EvalBodySpatialVelocityInWorld(self._context, self._links[robot][0])
        return float(np.linalg.norm(V_WH.translational()))

    def _before_outline(self, robot: str) -> bool:
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, self._bodies[robot])
        p_BG = X_WB.inverse() @ self.grip_W(robot)
        low, high = self._outlines_B[robot]
        return bool(np.any((p_BG[:2] < low - BEYOND_OUTLINE_M) | (p_BG[:2] > high + BEYOND_OUTLINE_M)))

    def _free_in(self, robot: str) -> str | None:
        """The object that a gripper touches and that touches nothing else; None where there is not just one."""
        of_shape = self._owners
        links = {int(link.index()) for link in self._links[robot]}
        touching: dict[int, set[int]] = {}
        for each in self._query.Eval(self._context).ComputePointPairPenetration():
            a, b = of_shape.get(each.id_A, -1), of_shape.get(each.id_B, -1)
            touching.setdefault(a, set()).add(b)
            touching.setdefault(b, set()).add(a)
        held = [n for n, body in self.loose.items() if touching.get(int(body.index()), set()) & links]
        if len(held) != 1 or touching[int(self.loose[held[0]].index())] - links:
            return None
        return held[0]


def _reach_m(kind: ShapeKind, half_m: FloatArray, down: FloatArray) -> float:
    """How far below its middle a shape reaches; `down` (3,) are the sizes of the vertical's parts along its axes."""
    if kind is ShapeKind.BOX:
        return float(half_m @ down)
    if kind is ShapeKind.ELLIPSOID:
        return float(np.linalg.norm(half_m * down))
    if kind is ShapeKind.CAPSULE:
        return float(half_m[0] + (half_m[2] - half_m[0]) * down[2])
    return float(half_m[0] * math.hypot(down[0], down[1]) + half_m[2] * down[2])
