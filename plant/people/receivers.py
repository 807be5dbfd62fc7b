"""People who receive an offered object: each brings a tray below it, pulls at it, and holds the tray still.

A robot offers an object when its hand holds the object still outside the robot's outline, free of other contacts. A
person knows the true state of the plant. The tray is a weightless free body with prescribed pose and velocity; it
touches robots and loose objects, and is hidden in the torso while unused. The pull is a force on the object, and ends
when the gripper gives way.
"""

import enum
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.geometry import GeometryId
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from plant.diagram import X_PT_HOME, WorldDiagram
from plant.saved_state import Stateful
from plant.sensors.ray_shapes import Row, ShapeKind, shape_row
from plant.worlds.seeding import Receiving
from skills.robot import FloatArray

LEAST_HEIGHT_M = 0.5
STILL_M_S = 0.03
"""Speed of the hand up to which a person begins to take the object."""
MOVES_M_S = 0.15
"""Speed of the hand from which on they no longer do."""
BEYOND_OUTLINE_M = 0.05
_AT_HAND_M = 0.5
_ROUNDING_M = 1e-9


class _Shapes:
    """Rows of a body's shapes; of the many spheres of a gripper's rubber only the lowest ones are used."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self._balls = [row for row in rows if row[0] is ShapeKind.ELLIPSOID and np.ptp(row[1]) == 0.0]
        self._others = [row for row in rows if row[0] is not ShapeKind.ELLIPSOID or np.ptp(row[1]) > 0.0]
        self._centres_B = np.array([X_BG.translation() for _, _, X_BG in self._balls]).reshape(-1, 3)
        self._radii_m = np.array([half_m[0] for _, half_m, _ in self._balls])

    def lowest(self, X_WB: RigidTransform) -> Sequence[Row]:
        """Candidate rows for the lowest point with the body at a pose: the lowest spheres, and all other shapes."""
        lows_m = self._centres_B @ X_WB.rotation().matrix()[2] - self._radii_m
        chosen = np.flatnonzero(lows_m <= lows_m.min(initial=np.inf) + _ROUNDING_M)
        return [*self._others, *(self._balls[number] for number in chosen)]


@dataclass(frozen=True)
class Offer:
    """An object that a robot offers."""

    robot: str
    object: str


class Offers(Stateful, saved=("_still_since_s",)):
    """Tracks the offers of the robots in one plant; call `update` regularly."""

    def __init__(self, world: WorldDiagram, context: Context) -> None:
        plant = world.plant
        self._plant, self._context, self._query = plant, context, plant.get_geometry_query_input_port()
        inspector, self._robots = world.scene_graph.model_inspector(), world.robots
        outlines = {name: np.array(robot.kind.capabilities().footprint_m) for name, robot in world.robots.items()}
        self._bounds_B = {name: (corners.min(axis=0), corners.max(axis=0)) for name, corners in outlines.items()}
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
        bodies = (*self.loose.values(), *(link for links in self._links.values() for link in links))
        geometries = {int(body.index()): plant.GetCollisionGeometriesForBody(body) for body in bodies}
        self._shapes = {
            body: _Shapes([shape_row(inspector, each) for each in found]) for body, found in geometries.items()
        }
        self._owners: Mapping[GeometryId, int] = {each: body for body, found in geometries.items() for each in found}
        self._still_since_s: dict[str, float] = {}

    def update(self, now_s: float, holding: Sequence[str]) -> None:
        """Records which robots in `holding` keep an object still for a person, and since when."""
        offering = [name for name in holding if self._holds_still(name)]
        self._still_since_s = {name: self._still_since_s.get(name, now_s) for name in offering}

    def find(self, p_WP: FloatArray, reach_m: float, since_s: float) -> Offer | None:
        """Returns an offer that has existed since a time, within reach of a person at p_WP; None when there is none."""
        for name, still_s in self._still_since_s.items():
            away_m = math.dist(self.grip_W(name)[:2], p_WP[:2])
            if still_s <= since_s and away_m <= reach_m and (held := self._free_in(name)) is not None:
                return Offer(name, held)
        return None

    def holds(self, offer: Offer) -> bool:
        """Returns whether an offer still exists: the hand holds the object and moves no faster than a pull moves it."""
        p_WO = self._plant.EvalBodyPoseInWorld(self._context, self.loose[offer.object]).translation()
        at_hand = float(np.linalg.norm(p_WO - self.grip_W(offer.robot))) < _AT_HAND_M
        return at_hand and self._outside_outline(offer.robot) and self._hand_m_s(offer.robot) < MOVES_M_S

    def grips(self, offer: Offer) -> bool:
        """Returns whether the gripper still touches an object that touches nothing else."""
        return self._free_in(offer.robot) == offer.object

    def grip_W(self, robot: str) -> FloatArray:
        """Position (3,) of the grip point of a robot's hand in the world."""
        return np.asarray(self._plant.EvalBodyPoseInWorld(self._context, self._links[robot][0]) @ self._p_HT[robot])

    def in_hand(self, offer: Offer) -> FloatArray:
        """Position (3,) of the offered object in the hand frame, in metres."""
        X_WH = self._plant.EvalBodyPoseInWorld(self._context, self._links[offer.robot][0])
        return np.asarray(X_WH.inverse() @ self.place_W(offer))

    def opening(self, robot: str) -> float:
        """Opening of a robot's gripper, in its own unit."""
        return self._robots[robot].opening(self._context)

    def lowest_m(self, offer: Offer) -> float:
        """Height (m) of the lowest point on an offered object and its gripper."""
        bodies = (self.loose[offer.object], *self._links[offer.robot])
        return min(self._low_m(body) for body in bodies)

    def place_W(self, offer: Offer) -> FloatArray:
        """Position (3,) of the offered object's centre of mass in the world."""
        body = self.loose[offer.object]
        return np.asarray(self._plant.EvalBodyPoseInWorld(self._context, body) @ body.default_com())

    def _low_m(self, body: RigidBody) -> float:
        """Height (m) of the lowest point on a body's shapes; infinite for a body without shapes."""
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, body)
        return min((_lowest_m(X_WB, row) for row in self._shapes[int(body.index())].lowest(X_WB)), default=math.inf)

    def _holds_still(self, robot: str) -> bool:
        """Returns whether a robot keeps its hand still, outside its outline and high enough for a person."""
        if self._hand_m_s(robot) > STILL_M_S:
            return False
        return self.grip_W(robot)[2] >= LEAST_HEIGHT_M and self._outside_outline(robot)

    def _hand_m_s(self, robot: str) -> float:
        V_WH = self._plant.EvalBodySpatialVelocityInWorld(self._context, self._links[robot][0])
        return float(np.linalg.norm(V_WH.translational()))

    def _outside_outline(self, robot: str) -> bool:
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, self._robots[robot].body)
        p_BG = X_WB.inverse() @ self.grip_W(robot)
        low, high = self._bounds_B[robot]
        return bool(np.any((p_BG[:2] < low - BEYOND_OUTLINE_M) | (p_BG[:2] > high + BEYOND_OUTLINE_M)))

    def _free_in(self, robot: str) -> str | None:
        """Returns the only object in contact with a gripper if it has no other contact; None otherwise."""
        links = {int(link.index()) for link in self._links[robot]}
        touching: dict[int, set[int]] = {}
        for each in self._query.Eval(self._context).ComputePointPairPenetration():
            a, b = self._owners.get(each.id_A, -1), self._owners.get(each.id_B, -1)
            touching.setdefault(a, set()).add(b)
            touching.setdefault(b, set()).add(a)
        held = [n for n, body in self.loose.items() if touching.get(int(body.index()), set()) & links]
        if len(held) != 1 or touching[int(self.loose[held[0]].index())] - links:
            return None
        return held[0]


def _lowest_m(X_WB: RigidTransform, row: Row) -> float:
    """Height (m) of the lowest point of a body's shape."""
    kind, half_m, X_BG = row
    X_WG = X_WB @ X_BG
    return float(X_WG.translation()[2]) - _reach_m(kind, half_m, np.abs(X_WG.rotation().matrix()[2]))


def _reach_m(kind: ShapeKind, half_m: FloatArray, down: FloatArray) -> float:
    """Extent (m) of a shape below its centre; `down` (3,) has the absolute components of the vertical in its axes."""
    if kind is ShapeKind.BOX:
        return float(half_m @ down)
    if kind is ShapeKind.ELLIPSOID:
        return float(np.linalg.norm(half_m * down))
    if kind is ShapeKind.CAPSULE:
        return float(half_m[0] + (half_m[2] - half_m[0]) * down[2])
    return float(half_m[0] * math.hypot(down[0], down[1]) + half_m[2] * down[2])


REACH_M = 1.0
BELOW_M = 0.018
"""Distance of the tray below the lowest point of the offered object."""
UNDER_M = 0.15
"""Distance below the offered object from which the tray is raised."""
SPEED_M_S = 0.3
TURN_RAD_S = 1.5
PULL_S = 6.0
RAMP_S = 0.6
"""Time in which the pull grows to its full force."""
PAUSE_S = 4.0
"""Time between two pulls."""
DOWN = 0.95
"""Downward component of the pull; the rest points towards the person."""
GIVES_M = 0.01
"""The gripper gives way when the object has moved this far in the hand, or the fingers have opened as follows."""
GIVES_RAD = 0.03
DROPS_M = BELOW_M - 0.002
"""The same distance while nobody pulls: a smaller creep in the hand does not count as released."""
SETTLE_S = 1.5
ON_TRAY_M = 0.25
_NEAR_M = 0.004
_ASIDE_M = 0.05
_DOWN_M = 0.05
_MOVED = 1e-9


class Phase(enum.Enum):
    """Phase of receiving an object."""

    IDLE = "idle"
    BRINGING = "bringing"
    PULLING = "pulling"
    PAUSING = "pausing"
    RECEIVING = "receiving"


class Receiver(Stateful, saved=("phase", "offer", "_since_s", "_opening", "_p_HO", "_home", "_X_WT")):
    """One person who receives objects. Call `update` regularly, and `move_tray` before each step."""

    def __init__(self, world: WorldDiagram, context: Context, name: str, receiving: Receiving, offers: Offers) -> None:
        self._plant, self._context, self._offers, self._receiving = world.plant, context, offers, receiving
        (index,) = world.plant.GetBodyIndices(world.models[name])[:1]
        self._body, self._tray = world.plant.get_body(index), world.trays[name]
        self._walks = not world.plant.IsAnchored(self._body)
        self.phase = Phase.IDLE
        self.offer: Offer | None = None
        self._since_s, self._opening = 0.0, 0.0
        self._p_HO = np.zeros(3)
        self._home, self._X_WT = True, self._home_W()

    @property
    def busy(self) -> bool:
        """Returns whether the person receives an object, or the tray is not hidden in the torso."""
        return self.phase is not Phase.IDLE or not self._home

    @property
    def still(self) -> bool:
        """Returns whether the tray stays where it is, and the person does not pull."""
        return self.phase is Phase.RECEIVING or not self.busy

    def update(self, now_s: float) -> None:
        """Decides the next phase."""
        if self.offer is None:
            self.offer = self._offers.find(self._X_WP().translation(), REACH_M, now_s - self._receiving.reaction_s)
            if self.offer is not None:
                self._grip(self.offer)
                self._enter(Phase.BRINGING, now_s)
        elif self.phase is Phase.RECEIVING:
            if now_s - self._since_s > SETTLE_S:
                self._end_receiving(self.offer, now_s)
        elif self._gives(self.offer, moved_m=DROPS_M if self.phase is Phase.BRINGING else GIVES_M):
            self._enter(Phase.RECEIVING, now_s)
        elif not self._offers.holds(self.offer):
            self._go_home(now_s)
        else:
            self._go_on(self.offer, now_s)

    def _go_on(self, offer: Offer, now_s: float) -> None:
        """Enters the next phase while the offer exists."""
        for_s = now_s - self._since_s
        off_m = float(np.linalg.norm(self._under(offer).translation() - self._X_WT.translation()))
        if self.phase is Phase.PULLING and for_s > PULL_S:
            self._enter(Phase.PAUSING, now_s)
        elif (self.phase is Phase.BRINGING and off_m < _NEAR_M) or (self.phase is Phase.PAUSING and for_s > PAUSE_S):
            self._grip(offer)
            self._enter(Phase.PULLING, now_s)

    def _end_receiving(self, offer: Offer, now_s: float) -> None:
        """Brings the tray below an object that the gripper still holds; hides it when the object is not on it."""
        if self._offers.grips(offer) and self._offers.holds(offer):
            self._grip(offer)
            self._enter(Phase.BRINGING, now_s)
        elif not self._on_tray(offer):
            self._go_home(now_s)

    def _grip(self, offer: Offer) -> None:
        """Records the opening and the object's position in the hand, to detect when the gripper releases."""
        self._opening, self._p_HO = self._offers.opening(offer.robot), self._offers.in_hand(offer)

    def _gives(self, offer: Offer, opens_rad: float = GIVES_RAD, moved_m: float = GIVES_M) -> bool:
        """Returns whether the gripper has released since `_grip`."""
        opened = self._offers.opening(offer.robot) - self._opening > opens_rad
        return opened or float(np.linalg.norm(self._offers.in_hand(offer) - self._p_HO)) > moved_m

    def pull_W(self, now_s: float) -> FloatArray | None:
        """Force (3,) of the pull (N, world); None when the person does not pull, or the gripper releases."""
        if self.offer is None or self.phase is not Phase.PULLING:
            return None
        if self._gives(self.offer, 0.5 * GIVES_RAD):
            self._enter(Phase.RECEIVING, now_s)
            return None
        to_person = self._X_WP().translation()[:2] - self._offers.place_W(self.offer)[:2]
        along = to_person / max(float(np.linalg.norm(to_person)), 1e-6)
        force_n = self._receiving.pull_n * min(1.0, (now_s - self._since_s) / RAMP_S)
        return np.asarray(force_n * np.array([*(math.sqrt(1.0 - DOWN**2) * along), -DOWN]))

    def move_tray(self, dt_s: float) -> None:
        """Sets the pose of the tray, and the velocity that brings it to its next pose within dt_s."""
        if self.phase is Phase.IDLE and self._home:
            if self._walks:
                self._X_WT = self._home_W()
                self._set(self._X_WT, SpatialVelocity.Zero())
            return
        if self.phase is Phase.RECEIVING:
            self._set(self._X_WT, SpatialVelocity.Zero())
            return
        here, goal = self._X_WT, self._goal()
        self._X_WT, velocity = _towards(here, goal, dt_s)
        self._set(here, velocity)
        self._home = self.phase is Phase.IDLE and self._X_WT.IsNearlyEqualTo(self._home_W(), _MOVED)
        if self._home:
            self._set(self._X_WT, SpatialVelocity.Zero())

    def _goal(self) -> RigidTransform:
        """Goal pose of the tray."""
        if self.phase is Phase.IDLE or self.offer is None:
            return self._goal_home()
        under = self._under(self.offer)
        aside_m = float(np.linalg.norm((under.translation() - self._X_WT.translation())[:2]))
        if self.phase is Phase.BRINGING and aside_m > _ASIDE_M:
            return self._goal_under(under)
        return under

    def _goal_under(self, under: RigidTransform) -> RigidTransform:
        """Next goal on the tray's path below the offered object: first down at the body, then to below the object."""
        here, level_m = self._X_WT.translation(), float(under.translation()[2]) - UNDER_M
        xy = here[:2] if here[2] > level_m + _NEAR_M else under.translation()[:2]
        return RigidTransform(under.rotation(), np.array([*xy, level_m]))

    def _goal_home(self) -> RigidTransform:
        """Next goal on the tray's path home: first level and a little down to the body, then into the torso."""
        home, here = self._home_W(), self._X_WT
        p_W = np.array([*home.translation()[:2], here.translation()[2] - _DOWN_M])
        aside_m = float(np.linalg.norm((p_W - here.translation())[:2]))
        return RigidTransform(here.rotation(), p_W) if aside_m > _ASIDE_M else home

    def _under(self, offer: Offer) -> RigidTransform:
        """Pose of the tray just below the offered object, its handle towards the person."""
        x, y, _ = place_W = self._offers.place_W(offer)
        from_person = place_W - self._X_WP().translation()
        yaw_rad = math.atan2(from_person[1], from_person[0])
        level_m = self._offers.lowest_m(offer) - BELOW_M
        return RigidTransform(RotationMatrix.MakeZRotation(yaw_rad), np.array([x, y, level_m]))

    def _on_tray(self, offer: Offer) -> bool:
        """Returns whether the object is on the tray or just above it."""
        x, y, z = self._X_WT.inverse() @ self._offers.place_W(offer)
        return math.hypot(x, y) < ON_TRAY_M and -BELOW_M < z < ON_TRAY_M

    def _enter(self, phase: Phase, now_s: float) -> None:
        self.phase, self._since_s, self._home = phase, now_s, False

    def _go_home(self, now_s: float) -> None:
        """Ends the offer and starts to hide the tray."""
        self.offer = None
        self._enter(Phase.IDLE, now_s)

    def _X_WP(self) -> RigidTransform:
        return self._plant.EvalBodyPoseInWorld(self._context, self._body)

    def _home_W(self) -> RigidTransform:
        return self._X_WP() @ X_PT_HOME

    def _set(self, X_WT: RigidTransform, V_WT: SpatialVelocity) -> None:
        """Sets the tray's pose and velocity in the plant when they differ from the present ones."""
        plant, context, tray = self._plant, self._context, self._tray
        if not plant.EvalBodyPoseInWorld(context, tray).IsNearlyEqualTo(X_WT, _MOVED):
            plant.SetFreeBodyPose(context, tray, X_WT)
        off = plant.EvalBodySpatialVelocityInWorld(context, tray).get_coeffs() - V_WT.get_coeffs()
        if float(np.abs(off).max()) > _MOVED:
            plant.SetFreeBodySpatialVelocity(context, tray, V_WT)


def _towards(X: RigidTransform, goal: RigidTransform, dt_s: float) -> tuple[RigidTransform, SpatialVelocity]:
    """Pose after dt_s on the path to a goal, at limited speed, and the velocity that leads to that pose."""
    offset = goal.translation() - X.translation()
    shift = offset * min(1.0, SPEED_M_S * dt_s / max(float(np.linalg.norm(offset)), 1e-9))
    turn = (goal.rotation() @ X.rotation().inverse()).ToAngleAxis()
    turned = AngleAxis(min(turn.angle(), TURN_RAD_S * dt_s), turn.axis())
    after = RigidTransform(RotationMatrix(turned) @ X.rotation(), X.translation() + shift)
    return after, SpatialVelocity(turned.axis() * turned.angle() / dt_s, shift / dt_s)


UPDATE_STEPS = 4
"""Steps between two updates of offers and people."""


class Receivers(Stateful, saved=("_offers", "_people")):
    """The people of one plant who receive objects, by name; call `before_step` before each step."""

    def __init__(self, world: WorldDiagram, context: Context) -> None:
        """`context` is the plant's."""
        self._plant, self._context = world.plant, context
        self._offers = Offers(world, context)
        self._people = {
            model.name: Receiver(world, context, model.name, model.receiving, self._offers)
            for model in sorted(world.config.models, key=lambda model: model.name)
            if model.receiving is not None
        }
        self._pulling = False

    def __getitem__(self, name: str) -> Receiver:
        """Returns the person with this name. Raises KeyError when there is none."""
        return self._people[name]

    @property
    def busy(self) -> Collection[str]:
        """Names of the people who receive an object or have one on their tray."""
        return [name for name, person in self._people.items() if person.busy]

    @property
    def still(self) -> bool:
        """Returns whether all trays stay where they are, and nobody pulls."""
        return all(person.still for person in self._people.values())

    def before_step(self, now_s: float, dt_s: float, holding: Sequence[str]) -> None:
        """Updates offers and people, pulls and moves the trays; `holding` names the robots that hold an object."""
        if round(now_s / dt_s) % UPDATE_STEPS == 0:
            self._offers.update(now_s, holding)
            for person in self._people.values():
                person.update(now_s)
        pulls = [each for person in self._people.values() if (each := self._pull(person, now_s)) is not None]
        if pulls or self._pulling:
            self._plant.get_applied_spatial_force_input_port().FixValue(self._context, pulls)
        self._pulling = bool(pulls)
        for person in self._people.values():
            person.move_tray(dt_s)

    def _pull(self, person: Receiver, now_s: float) -> ExternallyAppliedSpatialForce | None:
        """Force of a person's pull on the offered object now; None when the person does not pull."""
        force_W = person.pull_W(now_s)
        if force_W is None or person.offer is None:
            return None
        pull, body = ExternallyAppliedSpatialForce(), self._offers.loose[person.offer.object]
        pull.body_index = body.index()
        pull.p_BoBq_B = body.default_com()
        pull.F_Bq_W = SpatialForce(np.zeros(3), force_W)
        return pull
