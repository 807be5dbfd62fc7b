"""Events that no robot causes: sliding doors close and open, and people move objects.

The panel of a door slides on a planar joint, like a walking person: its pose and velocity are set before each step. It
touches robots and loose objects, passes through the scenery, and waits while a robot or a person is in the doorway. A
moved object jumps from one step to the next, because no hand is simulated.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, ModelInstanceIndex, PlanarJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import Context

from plant.saved_state import Stateful
from plant.worlds.seeding import ATTEMPTS, Placement, candidates, outline_W, polygon_distance
from plant.worlds.world import DoorRule, MoveRule, Point, SurfaceTop, World
from skills.inputs.errors import definite
from skills.robot import FloatArray

HEIGHT_M = 2.0
THICKNESS_M = 0.04
ABOVE_FLOOR_M = 0.02
SPEED_M_S = 0.6
CLEAR_M = 0.12
"""A panel waits while a robot or a person is nearer than this to the doorway's middle line."""
AJAR = 0.05
"""A door that is closed to more than this fraction stops people."""
_KG = 40.0
_COLOUR = np.array([0.55, 0.42, 0.30, 1.0])
_FRICTION = CoulombFriction(0.6, 0.5)
_MOVED = 1e-9

Outlines = Callable[[], Iterator[FloatArray]]
"""Iterates over the outlines (K, 2) of robots and people."""


def add_panel(plant: MultibodyPlant, door: DoorRule) -> ModelInstanceIndex:
    """Adds the panel of a door to a plant (before Finalize), as a model instance with the door's name."""
    instance = plant.AddModelInstance(door.name)
    size_m = (door.width, THICKNESS_M, HEIGHT_M)
    inertia = UnitInertia.SolidBox(*size_m)
    body = plant.AddRigidBody("panel", instance, SpatialInertia(_KG, np.zeros(3), inertia))
    plant.RegisterCollisionGeometry(body, RigidTransform(), Box(*size_m), "panel", _FRICTION)
    plant.RegisterVisualGeometry(body, RigidTransform(), Box(*size_m), "panel", _COLOUR)
    level = RigidTransform(np.array([0.0, 0.0, ABOVE_FLOOR_M + HEIGHT_M / 2]))
    floor = plant.AddFrame(FixedOffsetFrame(f"{door.name}_floor", plant.world_frame(), level))
    joint = plant.AddJoint(PlanarJoint(f"{door.name}_slides", floor, body.body_frame()))
    x, y, yaw = _pose(door, float(_closed_at(door, 0.0)))
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


def _pose(door: DoorRule, share: float) -> FloatArray:
    """Pose (x, y, yaw) of the panel's centre at a closed fraction (0 to 1)."""
    open_m = (1.0 - share) * door.width
    x, y = door.at
    return np.array([x + open_m * math.cos(door.yaw), y + open_m * math.sin(door.yaw), door.yaw])


def _doorway(door: DoorRule) -> tuple[Point, Point]:
    """Ends (x, y) of a doorway's centre line."""
    x, y, dx, dy = *door.at, 0.5 * door.width * math.cos(door.yaw), 0.5 * door.width * math.sin(door.yaw)
    return (x - dx, y - dy), (x + dx, y + dy)


def slide(
    plant: MultibodyPlant, context: Context, instance: ModelInstanceIndex, pose: FloatArray, velocity: FloatArray
) -> None:
    """Sets the pose (x, y, yaw) and the velocity of a model on a planar joint, if they differ from the present ones."""
    if np.abs(plant.GetPositions(context, instance) - pose).max() > _MOVED:
        plant.SetPositions(context, instance, pose)
    if np.abs(plant.GetVelocities(context, instance) - velocity).max() > _MOVED:
        plant.SetVelocities(context, instance, velocity)


@dataclass
class _Panel(Stateful):
    """Panel of a door: the closed fraction of the doorway (0 to 1), and whether the panel `closes` now.

    A door that is `called` opens, and stays open. The history has the time (s) of each change and the new state: 0
    (open), 1 (closed) or 0.5 (moving).
    """

    share: float
    closes: bool
    history: list[tuple[float, float]]
    called: bool = False

    def move_to(self, share: float, now_s: float) -> None:
        """Closes the door to a fraction (0 to 1), and records when it becomes open, closed or moving."""
        self.share = share
        state = share if share in (0.0, 1.0) else 0.5
        if state != self.history[-1][1]:
            self.history.append((now_s, state))


class Doors(Stateful, saved=("_panels",)):
    """Doors in one plant; call `before_step` before each step. A door waits while an outline is in its doorway."""

    def __init__(
        self,
        plant: MultibodyPlant,
        context: Context,
        doors: Sequence[DoorRule],
        outlines: Outlines,
        tell: Callable[[str], None],
    ) -> None:
        """`tell` is called with a sentence when a door begins to move."""
        self._plant, self._context, self._outlines, self._tell = plant, context, outlines, tell
        self._doors = {door.name: door for door in doors}
        self._instances = {name: plant.GetModelInstanceByName(name) for name in self._doors}
        shares = {name: float(_closed_at(door, 0.0)) for name, door in self._doors.items()}
        self._panels = {name: _Panel(share, share == 1.0, [(0.0, share)]) for name, share in shares.items()}

    @property
    def still(self) -> bool:
        """Returns whether the plant has no door that could move."""
        return not self._doors

    def history(self) -> Mapping[tuple[float, float], Sequence[tuple[float, float]]]:
        """Changes of each door by its position (x, y): time (s) and state, 0 open, 1 closed, 0.5 moving."""
        return {door.at: tuple(self._panels[name].history) for name, door in self._doors.items()}

    @property
    def barriers(self) -> Sequence[tuple[Point, Point]]:
        """Ends (x, y) of the doorways that nobody should enter now, because the door is not open."""
        ajar = (door for name, door in self._doors.items() if self._panels[name].share > AJAR)
        return [_doorway(door) for door in ajar]

    def call(self, at_W: tuple[float, float]) -> None:
        """Opens the door nearest to a position (x, y) from the next step on, like its motor; from any thread."""
        name = min(self._doors, key=lambda name: math.dist(self._doors[name].at, at_W))
        self._panels[name].called = True

    def before_step(self, now_s: float, dt_s: float) -> None:
        """Sets the pose of each panel, and the velocity that brings it to its next pose within dt_s."""
        for name, door in self._doors.items():
            panel = self._panels[name]
            closes = _closed_at(door, now_s) and not panel.called
            if closes != panel.closes:
                panel.closes = closes
                self._tell(f"the {name} {'closes' if closes else 'opens'}")
            before, after = panel.share, self._next(door, panel, dt_s)
            panel.move_to(after, now_s)
            pose = _pose(door, before)
            slide(self._plant, self._context, self._instances[name], pose, (_pose(door, after) - pose) / dt_s)

    def _next(self, door: DoorRule, panel: _Panel, dt_s: float) -> float:
        """Closed fraction of a door after dt_s."""
        share, step = panel.share, SPEED_M_S * dt_s / door.width
        if not panel.closes:
            return max(0.0, share - step)
        return share if share < 1.0 and self._occupied(door) else min(1.0, share + step)

    def _occupied(self, door: DoorRule) -> bool:
        """Returns whether a robot or a person is in the doorway."""
        line = shapely.LineString(_doorway(door))
        return any(shapely.distance(line, shapely.Polygon(each)) < CLEAR_M for each in self._outlines())


FROM_HAND_M: Final = 0.25
"""No object is put nearer than this to a robot's hand, or taken while a holding hand is nearer."""
_STREAM: Final = 5

Hands = Mapping[str, FloatArray]
"""Position (3,) of each robot's hand in the world, by the robot's name."""


class Moves(Stateful, saved=("_done",)):
    """Moves of objects by people in one plant, at their times; call `before_step` before each step."""

    def __init__(
        self,
        plant: MultibodyPlant,
        context: Context,
        world: World,
        placed: Sequence[Placement],
        *,
        seed: int,
        tell: Callable[[str], None],
    ) -> None:
        """`placed` are the loose objects; `tell` is called with a sentence on each move, or why it is not made."""
        self._plant, self._context, self._world, self._seed, self._tell = plant, context, world, seed, tell
        self._forms = {each.name: each.form for each in placed}
        self._bodies = {
            name: plant.get_body(plant.GetBodyIndices(plant.GetModelInstanceByName(name))[0]) for name in self._forms
        }
        self._done: frozenset[int] = frozenset()
        self._listeners: list[Callable[[str], None]] = []

    def listen(self, listener: Callable[[str], None]) -> None:
        """Calls `listener` with the name of each moved object."""
        self._listeners.append(listener)

    def before_step(self, now_s: float, hands_W: Callable[[], Hands], holding: Sequence[str]) -> None:
        """Moves the objects that are due; `holding` names the robots that hold an object, `hands_W` are hand poses."""
        for number, move in enumerate(self._world.moves):
            if number not in self._done and now_s >= move.at:
                self._done |= {number}
                self._do(number, move, hands_W(), holding)

    def _do(self, number: int, move: MoveRule, hands_W: Hands, holding: Sequence[str]) -> None:
        body = self._bodies[move.name]
        here_W = self._plant.EvalBodyPoseInWorld(self._context, body).translation()
        holder = next((name for name in holding if float(np.linalg.norm(hands_W[name] - here_W)) < FROM_HAND_M), None)
        if holder is not None:
            self._tell(f"nobody moves {definite(move.name)}, which {holder} holds")
            return
        X_WO = self._goal(number, move, hands_W)
        if X_WO is None:
            self._tell(f"nobody moves {definite(move.name)}, because the {move.to} has no free spot")
            return
        self._plant.SetFreeBodyPose(self._context, body, X_WO)
        self._plant.SetFreeBodySpatialVelocity(context=self._context, body=body, V_JpJc=SpatialVelocity.Zero())
        goal = f"the {move.to}" if isinstance(move.to, str) else "({:g}, {:g}, {:g})".format(*move.to)
        self._tell(f"somebody moves {definite(move.name)} to {goal}")
        for listener in self._listeners:
            listener(move.name)

    def _goal(self, number: int, move: MoveRule, hands_W: Hands) -> RigidTransform | None:
        """Goal pose of the object; None when the surface has no free spot."""
        form, rules = self._forms[move.name], self._world.seed_rules.rules
        if not isinstance(move.to, str):
            x, y, z = move.to
            return RigidTransform(np.array([x, y, z + form.rest_height_m + rules.drop_m]))
        surface = self._world.surfaces[move.to]
        rng = np.random.default_rng([self._seed, _STREAM, number])
        taken = [*self._outlines_W(move.name), *(np.array(polygon) for polygon in self._world.seed_rules.keep_clear)]
        inner = shapely.Polygon(surface.polygon_W).buffer(-rules.rim_m)
        for centre, yaw in self._candidates(surface, rng):
            outline = outline_W(form, centre, yaw)
            far = all(float(np.hypot(*(p_W[:2] - centre))) > FROM_HAND_M for p_W in hands_W.values())
            clear = far and all(polygon_distance(outline, other) >= max(rules.clear_m, 0.02) for other in taken)
            if clear and inner.covers(shapely.Polygon(outline)):
                z = surface.height_m + form.rest_height_m + rules.drop_m
                return RigidTransform(RollPitchYaw(0.0, 0.0, yaw), np.array([*centre, z]))
        return None

    def _candidates(self, surface: SurfaceTop, rng: np.random.Generator) -> Iterator[tuple[Point, float]]:
        """Yields random centres and yaws: along the fronts of the surface if it has fronts, else anywhere on it."""
        if self._world.seed_rules.fronts.get(surface.name):
            yield from candidates(self._world, surface, rng)
            return
        low, high = np.min(surface.polygon_W, axis=0), np.max(surface.polygon_W, axis=0)
        for _ in range(ATTEMPTS):
            x, y = rng.uniform(low, high)
            yield (float(x), float(y)), float(rng.uniform(-np.pi, np.pi))

    def _outlines_W(self, without: str) -> Iterator[FloatArray]:
        """Present outlines (K, 2), from above, of all objects except `without`."""
        for name, body in self._bodies.items():
            if name != without:
                X_WO = self._plant.EvalBodyPoseInWorld(self._context, body)
                x, y, _ = X_WO.translation()
                yield outline_W(self._forms[name], (float(x), float(y)), RollPitchYaw(X_WO.rotation()).yaw_angle())
