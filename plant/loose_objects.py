"""Loose objects between two steps of the plant: objects at rest sleep, and a carried object follows the hand.

**Sleep.** A sleeping object floats in place without weight and contacts. Its shapes have no proximity role, so it costs
neither the solver nor the search for contacts any time. It wakes when a link or a moving object is about to reach it,
when it is moved, and when an object close by wakes, since it may lie on that object. A person's tray wakes no object.
Sleep depends on positions alone, so equal runs sleep and wake at equal times. The joints stay unlocked: next to a
locked joint, Drake's SAP crashes on the contact of any other body with the world body. A hand far from all objects has
no proximity role either: its rubber is a grid of spheres, which overlap each other and the jaws.

**Carrying.** The plant steps a free body along its velocity, but the joints of a robot along their arcs. While a robot
turns at w, a body at a distance r from the axis would creep outwards by w^2 r dt^2 / 2 in each step: 3 mm/s at 0.75
rad/s, out of the gripper within a minute of walking. So for each step an object that moves with a hand is shifted by
a dt^2 / 2, where a is the acceleration of the hand's point there at the present rates of all joints. The approximation
w x v of the hand was off by 6 mm/s in an arm's motion: it pressed the object into one finger, and the other finger lost
contact. Forces, velocities and contacts stay those of the plant.

**Spin.** The plant's steps cannot follow a fast spin: the gyroscopic torque at the beginning of a step makes a flat
wrench spin ever faster, and a can that turns by radians in a step penetrates a table and leaves it at 90 m/s. So the
spin of free bodies is limited to a rate that the next step can follow. So is their speed: where a box swallows a thin
cylinder or a convex mesh, Drake returns depths that are wrong by decimetres, and the contact throws the object away.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Role,
    SceneGraphInspector,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, JacobianWrtVariable, ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.robots.robot_kind import RobotBody
from plant.sensors.ray_shapes import ShapeArrays, shape_row
from skills.robot import FloatArray

_EXACT = 1e-9
_REACH_M = 2.0
"""Reach of a robot's links from its body, margins included."""


@dataclass(frozen=True)
class SleepLimits:
    """Limits at which objects fall asleep and wake.

    `still` and `still_s`: an object falls asleep once its pose (metres, quaternion) has changed by less than `still`
    per second for this time. `margin_m`: it wakes when a bounding sphere comes closer, a distance that no link covers
    between two updates; a hand falls asleep at twice this. `beside_m`: objects with spheres closer than this sleep and
    wake together.
    """

    still: float = 0.004
    still_s: float = 0.5
    margin_m: float = 0.12
    beside_m: float = 0.01


@dataclass(frozen=True)
class _Object:
    """A loose object with one body: its collision shapes with their properties, and its slice of the velocities."""

    name: str
    body: RigidBody
    shapes: Mapping[GeometryId, ProximityProperties]
    velocities: slice


class _Spheres:
    """Bounding spheres of bodies, one around the collision shapes of each body; bodies without shapes have none."""

    def __init__(self, plant: MultibodyPlant, inspector: SceneGraphInspector, bodies: Sequence[RigidBody]) -> None:
        self._plant = plant
        found = [(body, _bound(inspector, plant.GetCollisionGeometriesForBody(body))) for body in bodies]
        bounds = [(body, bound) for body, bound in found if bound is not None]
        self._bodies = [body for body, _ in bounds]
        self._centres_B = np.array([[*centre, 1.0] for _, (centre, _) in bounds]).reshape(-1, 4)
        self.radii_m = np.array([radius for _, (_, radius) in bounds])

    def centres_W(self, context: Context) -> FloatArray:
        """Centres (N, 3) of the spheres in the world."""
        X_WB = [self._plant.EvalBodyPoseInWorld(context, body).GetAsMatrix34() for body in self._bodies]
        centres: FloatArray = np.einsum("nij,nj->ni", np.array(X_WB).reshape(-1, 3, 4), self._centres_B)
        return centres


class _Hand:
    """Hand of one robot: its collision shapes with their properties, and the objects and shapes that it may touch."""

    def __init__(
        self, robot: RobotBody, inspector: SceneGraphInspector, fixed: ShapeArrays, objects: Collection[int]
    ) -> None:
        """`fixed` are the immobile shapes, `objects` the loose objects whose positions `is_near` receives."""
        plant, own = robot.plant, set(map(int, robot.instances()))
        links = [plant.GetBodyByName(link, robot.instance) for link in robot.kind.gripper_links]
        found = [shape for link in links for shape in plant.GetCollisionGeometriesForBody(link)]
        moving = (body for body in _moving_bodies(plant) if int(body.index()) not in objects)
        others = [body for body in moving if int(body.model_instance()) not in own]
        self.shapes = {shape: inspector.GetProximityProperties(shape) for shape in found}
        self.apart = CollisionFilterDeclaration().ExcludeWithin(GeometrySet(robot.geometries()))
        self.asleep = False
        self._spheres, self._others = _Spheres(plant, inspector, links), _Spheres(plant, inspector, others)
        self._fixed = fixed
        self._measured = np.full((len(self._spheres.radii_m), 3), np.inf), np.zeros(len(self._spheres.radii_m))

    def is_near(self, context: Context, margin_m: float, objects_W: FloatArray, radii_m: FloatArray) -> bool:
        """Returns whether anything except the robot itself is within a margin of the hand.

        `objects_W` (N, 3) and `radii_m` are the bounding spheres of the loose objects.
        """
        centres_W, reach_m = self._spheres.centres_W(context), self._spheres.radii_m + margin_m
        for others_W, sizes_m in ((objects_W, radii_m), (self._others.centres_W(context), self._others.radii_m)):
            apart_m = np.linalg.norm(centres_W[:, None] - others_W, axis=-1)
            if (apart_m < reach_m[:, None] + sizes_m).any():
                return True
        measured_W, clear_m = self._measured
        if (clear_m - np.linalg.norm(centres_W - measured_W, axis=1) >= reach_m).all():
            return False
        self._measured = centres_W, _clearance_m(self._fixed, centres_W)
        return bool((self._measured[1] < reach_m).any())


class Sleepers:
    """Puts loose objects and hands in one plant to sleep and wakes them; call `update` regularly, before it steps."""

    def __init__(self, world: WorldDiagram, root_context: Context, limits: SleepLimits | None = None) -> None:
        """All objects are awake at first; `all_asleep` is True while every loose body in the plant sleeps."""
        plant, inspector = world.plant, world.scene_graph.model_inspector()
        self._plant, self._limits = plant, limits or SleepLimits()
        self._context = plant.GetMyMutableContextFromRoot(root_context)
        self._scene_graph = world.scene_graph
        self._geometry_context = world.scene_graph.GetMyMutableContextFromRoot(root_context)
        self._objects = tuple(_objects(plant, inspector, world.models))
        passed_over = {int(body.index()) for body in (*(each.body for each in self._objects), *world.trays.values())}
        others = [body for body in _moving_bodies(plant) if int(body.index()) not in passed_over]
        self._links = _Spheres(plant, inspector, others)
        of_robots = {int(instance) for robot in world.robots.values() for instance in robot.instances()}
        models = world.models.values()
        sliding = [body for body in others if body.model_instance() in models and not body.is_floating_base_body()]
        known = of_robots | {int(body.model_instance()) for body in sliding}
        self._only_known_move = all(int(body.model_instance()) in known for body in others)
        self._known = [*(robot.body for robot in world.robots.values()), *sliding]
        self._bounds = _Spheres(plant, inspector, [each.body for each in self._objects])
        starts = [each.body.floating_positions_start() for each in self._objects]
        self._places = np.array([range(start, start + 7) for start in starts], dtype=np.int64).reshape(-1, 7)
        self._asleep = np.zeros(len(self._objects), dtype=bool)
        loose = (body for body in _moving_bodies(plant) if int(body.model_instance()) in map(int, models))
        self._restless = sum(body.is_floating_base_body() for body in loose) - len(self._objects)
        self.all_asleep = False
        self._lift = np.zeros(plant.num_velocities())
        self._still_s = np.zeros(len(self._objects))
        self._last: tuple[float, FloatArray, FloatArray] | None = None
        fixed = _fixed_shapes(plant, inspector)
        indices = {int(each.body.index()) for each in self._objects}
        self._hands = [_Hand(robot, inspector, fixed, indices) for robot in world.robots.values()]

    @property
    def asleep(self) -> frozenset[str]:
        """Names of the sleeping objects."""
        return frozenset(each.name for each, asleep in zip(self._objects, self._asleep, strict=True) if asleep)

    def update(self, now_s: float) -> None:
        """Wakes objects that a link or an object is about to reach; puts still objects and distant hands to sleep."""
        centres_W = self._update_objects(now_s) if self._objects else np.zeros((0, 3))
        for hand in self._hands:
            margin_m = self._limits.margin_m if hand.asleep else 2.0 * self._limits.margin_m
            if hand.is_near(self._context, margin_m, centres_W, self._bounds.radii_m) == hand.asleep:
                self._turn_hand(hand)

    def _update_objects(self, now_s: float) -> FloatArray:
        """Wakes objects and puts them to sleep; returns the centres (N, 3) of their bounding spheres."""
        poses = self._plant.GetPositions(self._context)[self._places]
        last_s, last_poses, last_centres_W = self._last or (now_s, poses, self._bounds.centres_W(self._context))
        elapsed_s, change = now_s - last_s, np.abs(poses - last_poses).max(axis=1)
        moved = change > self._limits.still * elapsed_s
        centres_W = self._bounds.centres_W(self._context) if change.max() > _EXACT else last_centres_W
        self._last = (now_s, poses, centres_W)
        radii_m, margin_m = self._bounds.radii_m, self._limits.margin_m
        disturbed = moved | self._reached(centres_W)
        for places_W in (last_centres_W, centres_W) if moved.any() else ():
            disturbed |= self._near(centres_W, places_W[moved], radii_m[moved], margin_m)
        spread = disturbed
        while spread.any():
            beside = self._near(centres_W, centres_W[spread], radii_m[spread], self._limits.beside_m)
            spread, disturbed = beside & ~disturbed, disturbed | beside
        self._still_s = np.where(disturbed, 0.0, self._still_s + elapsed_s)
        tired = self._still_s > self._limits.still_s
        for number in np.flatnonzero((self._asleep & disturbed) | (~self._asleep & tired)):
            self._turn(int(number))
        return centres_W

    def wake_all(self) -> None:
        """Wakes all objects and hands, for instance before the plant's state is replaced."""
        for hand in self._hands:
            if hand.asleep:
                self._turn_hand(hand)
        for number in np.flatnonzero(self._asleep):
            self._turn(int(number))
        self._still_s = np.zeros(len(self._objects))
        self._last = None

    def _reached(self, centres_W: FloatArray) -> NDArray[np.bool_]:
        """Mask (N,) of the objects that a link is about to reach."""
        bases = [self._plant.EvalBodyPoseInWorld(self._context, body).translation() for body in self._known]
        if self._only_known_move and all(np.abs(centres_W - p_WB).max(axis=1).min() > _REACH_M for p_WB in bases):
            return np.zeros(len(centres_W), dtype=bool)
        links_W = self._links.centres_W(self._context)
        return self._near(centres_W, links_W, self._links.radii_m, self._limits.margin_m)

    def _near(
        self, centres_W: FloatArray, others_W: FloatArray, radii_m: FloatArray, margin_m: float
    ) -> NDArray[np.bool_]:
        """Mask (N,) of the objects whose sphere is within a margin of another sphere (M, 3)."""
        apart_m = np.linalg.norm(centres_W[:, None] - others_W[None], axis=-1)
        near: NDArray[np.bool_] = (apart_m < self._bounds.radii_m[:, None] + radii_m + margin_m).any(axis=1)
        return near

    def _turn_hand(self, hand: _Hand) -> None:
        """Toggles whether a hand sleeps."""
        hand.asleep = not hand.asleep
        self._give_role(hand.shapes, not hand.asleep)
        if not hand.asleep:  # a filter forgets the shapes that lose their role
            self._scene_graph.collision_filter_manager(self._geometry_context).Apply(hand.apart)

    def _give_role(self, shapes: Mapping[GeometryId, ProximityProperties], awake: bool) -> None:
        """Assigns the proximity role to shapes, or removes it."""
        graph, source = self._scene_graph, self._plant.get_source_id()
        for shape, properties in shapes.items():
            if awake:
                graph.AssignRole(self._geometry_context, source, shape, properties)
            else:
                graph.RemoveRole(self._geometry_context, source, shape, Role.kProximity)

    def _turn(self, number: int) -> None:
        """Toggles whether an object sleeps."""
        each, plant = self._objects[number], self._plant
        self._give_role(each.shapes, bool(self._asleep[number]))
        if self._asleep[number]:
            self._lift[each.velocities] = 0.0
        else:
            self._lift[each.velocities] = -plant.CalcGravityGeneralizedForces(self._context)[each.velocities]
            velocities = plant.GetVelocities(self._context)
            velocities[each.velocities] = 0.0
            plant.SetVelocities(self._context, velocities)
        plant.get_applied_generalized_force_input_port().FixValue(self._context, self._lift)
        self._asleep[number] = not self._asleep[number]
        self.all_asleep = self._restless == 0 and bool(self._asleep.all())


def _objects(
    plant: MultibodyPlant, inspector: SceneGraphInspector, models: Mapping[str, ModelInstanceIndex]
) -> Iterator[_Object]:
    """Yields the loose objects with one body, which may sleep; a model with joints never sleeps."""
    for name, instance in models.items():
        bodies = [plant.get_body(index) for index in plant.GetBodyIndices(instance)]
        if len(bodies) == 1 and bodies[0].is_floating_base_body():
            found = plant.GetCollisionGeometriesForBody(bodies[0])
            shapes = {shape: inspector.GetProximityProperties(shape) for shape in found}
            start = bodies[0].floating_velocities_start_in_v()
            yield _Object(name, bodies[0], shapes, slice(start, start + 6))


def _moving_bodies(plant: MultibodyPlant) -> Iterator[RigidBody]:
    bodies = (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies()))
    return (body for body in bodies if not plant.IsAnchored(body))


def _fixed_shapes(plant: MultibodyPlant, inspector: SceneGraphInspector) -> ShapeArrays:
    """Collision shapes of the bodies that are fixed to the world, in the world frame."""
    context, rows = plant.CreateDefaultContext(), []
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        for shape in plant.GetCollisionGeometriesForBody(body) if plant.IsAnchored(body) else ():
            kind, half_m, X_BG = shape_row(inspector, shape)
            rows.append((kind, half_m, plant.EvalBodyPoseInWorld(context, body) @ X_BG))
    return ShapeArrays.from_rows(rows)


def _clearance_m(shapes: ShapeArrays, points_W: FloatArray) -> FloatArray:
    """Distance (m) from each point (K, 3) to the nearest bounding box of the shapes."""
    off_W = points_W[:, None] - shapes.positions_m
    off_G = np.abs(np.einsum("nji,knj->kni", shapes.rotations, off_W))
    gaps_m = np.linalg.norm(np.maximum(off_G - shapes.half_extents_m, 0.0), axis=-1)
    return np.asarray(gaps_m.min(axis=1, initial=np.inf))


def _bound(inspector: SceneGraphInspector, shapes: Sequence[GeometryId]) -> tuple[FloatArray, float] | None:
    """Centre and radius of a bounding sphere of shapes, in the frame of their body; None without shapes."""
    rows = [shape_row(inspector, shape) for shape in shapes]
    if not rows:
        return None
    centre = np.mean([X_BG.translation() for _, _, X_BG in rows], axis=0)
    reach = [np.linalg.norm(X_BG.translation() - centre) + np.linalg.norm(half) for _, half, X_BG in rows]
    return centre, float(max(reach))


WITH_HAND_M_S: Final = 0.02
"""Largest relative speed of an object that moves with the hand."""
FASTEST_SPIN_RAD_S: Final = 25.0
"""A third of a radian in a step of 12.5 ms."""
CALM_RAD_S: Final = 1.5
FASTEST_M_S: Final = 5.0
"""Speed after a fall from 1.3 m; 6 cm in a step of 12.5 ms."""
_ALONG: Final = 3.0**-0.5
"""Part of a limit along each axis within which a vector cannot exceed the limit."""
_AT_HAND_M: Final = 0.5


class CarriedObjects:
    """Corrects the loose bodies that a hand carries; call `limit_motion` and `after_steps` after steps of the plant.

    `calm` is True while no free body spins faster than `CALM_RAD_S`; then a spin that begins in a step is limited soon
    enough after the next one.
    """

    def __init__(self, plant: MultibodyPlant, context: Context, loose: Sequence[RigidBody]) -> None:
        self._plant, self._context = plant, context
        self._loose = [body for body in loose if body.is_floating_base_body()]
        starts = [body.floating_velocities_start_in_v() for body in self._loose]
        places = [body.floating_positions_start() + 4 for body in self._loose]
        self._places = np.array([range(start, start + 3) for start in places], dtype=np.int64).reshape(-1, 3)
        self._spins = np.array([range(start, start + 3) for start in starts], dtype=np.int64).ravel()
        self._speeds = self._spins + 3
        self.calm = False

    def after_steps(self, hand: RigidBody, dt_s: float, steps: int = 1) -> None:
        """Moves the bodies that the hand carries along their arcs, after `steps` steps of dt_s each."""
        plant, context = self._plant, self._context
        p_WH = plant.EvalBodyPoseInWorld(context, hand).translation()
        places_W = plant.GetPositions(context)[self._places]
        V_WH = plant.EvalBodySpatialVelocityInWorld(context, hand)
        for number in np.flatnonzero(np.abs(places_W - p_WH).max(axis=1) <= _AT_HAND_M):
            body, p_WO = self._loose[number], places_W[number]
            v_WO = plant.EvalBodySpatialVelocityInWorld(context, body).translational()
            with_hand = V_WH.translational() + _cross(V_WH.rotational(), p_WO - p_WH)
            bias_m_s2 = self._bias_m_s2(hand, p_WO)  # contact made the velocities equal before the hand turned on
            if np.linalg.norm(v_WO - with_hand + dt_s * bias_m_s2) < WITH_HAND_M_S:
                q = plant.GetPositions(context)
                q[self._places[number]] += steps * arc_m(bias_m_s2, dt_s)
                plant.SetPositions(context, q)

    def _bias_m_s2(self, hand: RigidBody, p_WO: FloatArray) -> FloatArray:
        """Acceleration (m/s^2) of the hand's point at p_WO while all joint rates stay constant."""
        plant, context, world = self._plant, self._context, self._plant.world_frame()
        p_HO = plant.EvalBodyPoseInWorld(context, hand).inverse() @ p_WO
        rates = JacobianWrtVariable.kV
        bias = plant.CalcBiasSpatialAcceleration(context, rates, hand.body_frame(), p_HO, world, world)
        return np.asarray(bias.translational())

    def limit_motion(self) -> None:
        """Limits the spin of the free bodies to `FASTEST_SPIN_RAD_S`, and their speed to `FASTEST_M_S`."""
        velocities = self._plant.GetVelocities(self._context)
        self.calm = bool(np.abs(velocities[self._spins]).max(initial=0.0) < CALM_RAD_S)
        limited = [_limit(velocities, self._spins, FASTEST_SPIN_RAD_S), _limit(velocities, self._speeds, FASTEST_M_S)]
        if any(limited):
            self._plant.SetVelocities(self._context, velocities)


def _limit(velocities: FloatArray, indices: NDArray[np.int64], most: float) -> bool:
    """Shortens the vectors at `indices`, three for each, that are longer than `most`; returns whether any may be."""
    if np.abs(velocities[indices]).max(initial=0.0) <= _ALONG * most:
        return False
    vectors = velocities[indices].reshape(-1, 3)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    velocities[indices] = (vectors * np.minimum(1.0, most / np.maximum(lengths, 1e-9))).ravel()
    return True


def arc_m(acceleration_W: FloatArray, dt_s: float) -> FloatArray:
    """Distance (m) between an accelerated point (m/s^2) and its tangent after dt_s."""
    return np.asarray(0.5 * dt_s**2 * acceleration_W)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product a x b of two vectors (3,); faster than numpy's."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
