"""Sliding doors: a panel in the wall beside a doorway, which closes it and opens it again at its times.

A panel slides on a planar joint, as people who walk do: its place and velocity are set before each step, whatever
pushes it. It touches robots and loose objects, and passes through the scenery. It waits for whoever is in the doorway.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, ModelInstanceIndex, PlanarJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context

from plant.kept import Kept
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
    """Adds a door's panel to a plant (before Finalize), as a model instance of the door's name."""
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
    """Returns whether a door should be closed at a time."""
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


def slide(
    plant: MultibodyPlant, context: Context, instance: ModelInstanceIndex, pose: FloatArray, velocity: FloatArray
) -> None:
    """Sets (x, y, yaw) and their rates, where they are others, of a model that slides on a planar joint."""
    if np.abs(plant.GetPositions(context, instance) - pose).max() > _MOVED:
        plant.SetPositions(context, instance, pose)
    if np.abs(plant.GetVelocities(context, instance) - velocity).max() > _MOVED:
        plant.SetVelocities(context, instance, velocity)


@dataclass
class _Panel(Kept):
    """The panel of a door: to which share it closes it, whether it `closes` now, and each share with its time (s).

    The history only tells 0 (open), 1 (closed) and 0.5 (moving).
    """

    share: float
    closes: bool
    history: list[tuple[float, float]]

    def move_to(self, share: float, now_s: float) -> None:
        """Opens the door by `share` (0 to 1), and records when it becomes open, closed or moving."""
        self.share = share
        told = share if share in (0.0, 1.0) else 0.5
        if told != self.history[-1][1]:
            self.history.append((now_s, told))


class Doors(Kept, keeps=("_panels",)):
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
        shares = {name: _share_closed(door, 0.0) for name, door in self._doors.items()}
        self._panels = {name: _Panel(share, share == 1.0, [(0.0, share)]) for name, share in shares.items()}

    @property
    def still(self) -> bool:
        """Returns whether there is no door that moves."""
        return not self._doors

    def history(self) -> Mapping[tuple[float, float], Sequence[tuple[float, float]]]:
        """Changes of each door by its position (x, y): time (s) and closed share, 0 open, 1 closed, 0.5 moving."""
        return {door.at: tuple(self._panels[name].history) for name, door in self._doors.items()}

    def before_step(self, now_s: float, dt_s: float) -> None:
        """Puts each panel where it is, with the velocity that leads to where it will be after dt_s."""
        for name, door in self._doors.items():
            panel, closes = self._panels[name], _closed_at(door, now_s)
            if closes != panel.closes:
                panel.closes = closes
                self._tell(f"the {name} {'closes' if closes else 'opens'}")
            before, after = panel.share, self._next(door, panel, dt_s)
            panel.move_to(after, now_s)
            pose = _pose(door, before)
            slide(self._plant, self._context, self._instances[name], pose, (_pose(door, after) - pose) / dt_s)

    def _next(self, door: DoorRule, panel: _Panel, dt_s: float) -> float:
        """To which share a door is closed after dt_s."""
        share, step = panel.share, SPEED_M_S * dt_s / door.width
        if not panel.closes:
            return max(0.0, share - step)
        return share if share < 1.0 and self._occupied(door) else min(1.0, share + step)

    def _occupied(self, door: DoorRule) -> bool:
        """Returns whether somebody is in the doorway."""
        half = 0.5 * door.width * np.array([math.cos(door.yaw), math.sin(door.yaw)])
        line = shapely.LineString([np.array(door.at) - half, np.array(door.at) + half])
        return any(shapely.distance(line, shapely.Polygon(each)) < CLEAR_M for each in self._outlines())
