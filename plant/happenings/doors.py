"""Sliding doors: a panel in the wall beside a doorway, which closes it and opens it again at its times.

A panel slides on a planar joint, as people who walk do: its place and velocity are set before each step, whatever
pushes it. It touches robots and loose objects, and passes through the scenery. It waits for whoever is in the doorway.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import shapely
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, ModelInstanceIndex, PlanarJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context

from plant.kept import State
from plant.worlds.world import DoorRule
from skills.robot import FloatArray

HEIGHT_M, THICKNESS_M, ABOVE_FLOOR_M = 2.0, 0.04, 0.02
SPEED_M_S = 0.6
CLEAR_M = 0.12
"""A panel waits while something is nearer than this to the doorway's middle line."""
_KG = 40.0
_COLOUR = np.array([0.55, 0.42, 0.30, 1.0])
_FRICTION = CoulombFriction(0.6, 0.5)
_MOVED = 1e-9

Outlines = Callable[[], Iterator[FloatArray]]
"""The outlines (K, 2) of robots and people."""


def add_panel(plant: MultibodyPlant, door: DoorRule) -> ModelInstanceIndex:
    """Add a door's panel to a plant (before Finalize), as a model instance of the door's name."""
    instance = plant.AddModelInstance(door.name)
    size_m = (door.width, THICKNESS_M, HEIGHT_M)
    inertia = UnitInertia.SolidBox(*size_m)
    body = plant.AddRigidBody("panel", instance, SpatialInertia(_KG, np.zeros(3), inertia))
    plant.RegisterCollisionGeometry(body, RigidTransform(), Box(*size_m), "panel", _FRICTION)
    plant.RegisterVisualGeometry(body, RigidTransform(), Box(*size_m), "panel", _COLOUR)
    level = RigidTransform(np.array([0.0, 0.0, ABOVE_FLOOR_M + HEIGHT_M / 2]))
    floor = plant.AddFrame(FixedOffsetFrame(f"{door.name}_floor", plant.world_frame(), level))
    joint = plant.AddJoint(PlanarJoint(f"{door.name}_slides", floor, body.body_frame()))
    x, y, yaw = _pose(door, _share_closed(door, 0.0))
    joint.set_default_translation(np.array([x, y]))
    joint.set_default_rotation(yaw)
    return instance


def _closed_at(door: DoorRule, now_s: float) -> bool:
    """Whether a door should be closed at a time."""
    closes_s = math.inf if door.closes is None else door.closes
    opens_s = math.inf if door.opens is None else door.opens
    if closes_s <= opens_s:
        return closes_s <= now_s < opens_s
    return now_s < opens_s or now_s >= closes_s


def _share_closed(door: DoorRule, now_s: float) -> float:
    return 1.0 if _closed_at(door, now_s) else 0.0


def _pose(door: DoorRule, share: float) -> FloatArray:
    """x, y and yaw of the panel's middle when the door is closed to a share (0 to 1)."""
    way_m = (1.0 - share) * door.width
    x, y = door.at
    return np.array([x + way_m * math.cos(door.yaw), y + way_m * math.sin(door.yaw), door.yaw])


class Doors:
    """The doors of one plant; `before_step` is to be called before each step. `outlines` may stand in a doorway."""

    def __init__(
        self,
        plant: MultibodyPlant,
        context: Context,
        doors: Sequence[DoorRule],
        outlines: Outlines,
        tell: Callable[[str], None],
    ) -> None:
        """`tell` takes one sentence for each door that begins to move."""
        self._plant, self._context, self._outlines, self._tell = plant, context, outlines, tell
        self._doors = {door.name: door for door in doors}
        self._instances = {name: plant.GetModelInstanceByName(name) for name in self._doors}
        self._shares = {name: _share_closed(door, 0.0) for name, door in self._doors.items()}
        self._closing = {name: share == 1.0 for name, share in self._shares.items()}
        self._history: dict[str, list[tuple[float, float]]] = {name: [(0.0, s)] for name, s in self._shares.items()}

    @property
    def still(self) -> bool:
        """Whether there is no door that moves."""
        return not self._doors

    def history(self) -> Mapping[tuple[float, float], Sequence[tuple[float, float]]]:
        """Changes of each door by its position (x, y): time (s) and closed share, 0 open, 1 closed, 0.5 moving."""
        return {door.at: tuple(self._history[name]) for name, door in self._doors.items()}

    def before_step(self, now_s: float, dt_s: float) -> None:
        """Put each panel where it is, with the velocity that leads to where it will be after dt_s."""
        for name, door in self._doors.items():
            closes = _closed_at(door, now_s)
            if closes != self._closing[name]:
                self._closing[name] = closes
                self._tell(f"the {name} {'closes' if closes else 'opens'}")
            before, after = self._shares[name], self._next(door, closes, dt_s)
            self._shares[name] = after
            self._note(name, now_s)
            pose = _pose(door, before)
            self._set(self._instances[name], pose, (_pose(door, after) - pose) / dt_s)

    def _note(self, name: str, now_s: float) -> None:
        """Record a change between open, closed and moving."""
        share = self._shares[name] if self._shares[name] in (0.0, 1.0) else 0.5
        if share != self._history[name][-1][1]:
            self._history[name].append((now_s, share))

    def _next(self, door: DoorRule, closes: bool, dt_s: float) -> float:
        """To which share a door is closed after dt_s."""
        share, step = self._shares[door.name], SPEED_M_S * dt_s / door.width
        if not closes:
            return max(0.0, share - step)
        return share if share < 1.0 and self._occupied(door) else min(1.0, share + step)

    def _occupied(self, door: DoorRule) -> bool:
        """Whether somebody is in the doorway."""
        half = 0.5 * door.width * np.array([math.cos(door.yaw), math.sin(door.yaw)])
        line = shapely.LineString([np.array(door.at) - half, np.array(door.at) + half])
        return any(shapely.distance(line, shapely.Polygon(each)) < CLEAR_M for each in self._outlines())

    def _set(self, instance: ModelInstanceIndex, pose: FloatArray, velocity: FloatArray) -> None:
        """Set a panel's (x, y, yaw) and their rates where they are others."""
        plant, context = self._plant, self._context
        if np.abs(plant.GetPositions(context, instance) - pose).max() > _MOVED:
            plant.SetPositions(context, instance, pose)
        if np.abs(plant.GetVelocities(context, instance) - velocity).max() > _MOVED:
            plant.SetVelocities(context, instance, velocity)

    def state(self) -> State:
        """How far each door is closed, whether it closes, and how it was before."""
        return {
            name: [self._shares[name], self._closing[name], [list(each) for each in self._history[name]]]
            for name in self._doors
        }

    def restore(self, state: State) -> None:
        """Go on from such a state. Raises KeyError: a door is not in it."""
        for name in self._doors:
            self._shares[name], self._closing[name], history = state[name]
            self._history[name] = [(begun_s, share) for begun_s, share in history]
