"""Moves the people who take what a robot holds out: each brings a tray under it, pulls at it, and holds the tray still.

A person knows the plant's truth. The tray is a free body without weight whose pose and velocity are set, whatever is
laid on it; it touches robots and loose objects. While it is not in use it is out of sight within the torso. The pull
is a force on the object, and ends as soon as the gripper gives way. What a robot holds out is a loose object in a
gripper before the robot's outline, clear of everything, and still.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
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
from plant.sensors.ray_shapes import ShapeKind, shape_row
from plant.worlds.seeding import Receiving
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


class Offers(Stateful, saved=("_still_since_s",)):
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
        """Notes which robots hold something out, and since when."""
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
        """Returns whether the gripper still touches an object that touches nothing else."""
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
        """Returns whether a robot that holds something keeps its hand still before itself, high enough."""
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


REACH_M = 1.0
BELOW_M = 0.018
"""So far below the lowest point of what is held out the tray is held."""
UNDER_M = 0.15
"""From so far below it the tray is raised."""
SPEED_M_S, TURN_RAD_S = 0.3, 1.5
PULL_S, RAMP_S, PAUSE_S = 6.0, 0.6, 4.0
DOWN = 0.95
"""The share of the pull that goes down, beside that towards the person."""
GIVES_M, GIVES_RAD = 0.01, 0.03
"""The gripper gives way: the object has moved so far in the hand since the pull began, or the fingers have opened."""
DROPS_M = BELOW_M - 0.002
"""As long as nobody pulls, what creeps in the hand by less is not let go of."""
SETTLE_S = 1.5
ON_TRAY_M = 0.25
_NEAR_M, _ASIDE_M, _DOWN_M = 0.004, 0.05, 0.05
_MOVED = 1e-9


class Phase(enum.Enum):
    """What a person does."""

    IDLE = "idle"
    BRINGING = "bringing"
    PULLING = "pulling"
    PAUSING = "pausing"
    RECEIVING = "receiving"


class Receiver(Stateful, saved=("phase", "offer", "_since_s", "_opening", "_p_HO", "_home", "_X_WT")):
    """One person. Call `look` now and then, and `move_tray` before each step."""

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
        """Returns whether they take something, or have something on the tray."""
        return self.phase is not Phase.IDLE or not self._home

    def look(self, now_s: float) -> None:
        """Decides what to do next."""
        if self.offer is None:
            self.offer = self._offers.near(self._X_WP().translation(), REACH_M, now_s - self._receiving.reaction_s)
            if self.offer is not None:
                self._grip(self.offer)
                self._turn_to(Phase.BRINGING, now_s)
        elif self.phase is Phase.RECEIVING:
            if now_s - self._since_s > SETTLE_S:
                self._end_receiving(self.offer, now_s)
        elif self._gives(self.offer, moved_m=DROPS_M if self.phase is Phase.BRINGING else GIVES_M):
            self._turn_to(Phase.RECEIVING, now_s)
        elif not self._offers.holds(self.offer):
            self._go_home(now_s)
        else:
            self._go_on(self.offer, now_s)

    def _go_on(self, offer: Offer, now_s: float) -> None:
        """The next phase while something is held out."""
        for_s = now_s - self._since_s
        off_m = float(np.linalg.norm(self._under(offer).translation() - self._X_WT.translation()))
        if self.phase is Phase.PULLING and for_s > PULL_S:
            self._turn_to(Phase.PAUSING, now_s)
        elif (self.phase is Phase.BRINGING and off_m < _NEAR_M) or (self.phase is Phase.PAUSING and for_s > PAUSE_S):
            self._grip(offer)
            self._turn_to(Phase.PULLING, now_s)

    def _end_receiving(self, offer: Offer, now_s: float) -> None:
        """Pulls again when the gripper still holds the object; put the tray away when the object is not on it."""
        if self._offers.grips(offer) and self._offers.holds(offer):
            self._grip(offer)
            self._turn_to(Phase.PULLING, now_s)
        elif not self._on_tray(offer):
            self._go_home(now_s)

    def _grip(self, offer: Offer) -> None:
        """Note how the gripper has the object, against which it is seen to give way."""
        self._opening, self._p_HO = self._offers.opening(offer.robot), self._offers.in_hand(offer)

    def _gives(self, offer: Offer, opens_rad: float = GIVES_RAD, moved_m: float = GIVES_M) -> bool:
        """Returns whether the gripper gives way: somebody who pulls feels it sooner."""
        opened = self._offers.opening(offer.robot) - self._opening > opens_rad
        return opened or float(np.linalg.norm(self._offers.in_hand(offer) - self._p_HO)) > moved_m

    def pull_W(self, now_s: float) -> FloatArray | None:
        """The force (N, world) on the object; it ends for good when the gripper gives way."""
        if self.offer is None or self.phase is not Phase.PULLING:
            return None
        if self._gives(self.offer, 0.5 * GIVES_RAD):
            self._turn_to(Phase.RECEIVING, now_s)
            return None
        to_person = self._X_WP().translation()[:2] - self._offers.place_W(self.offer)[:2]
        along = to_person / max(float(np.linalg.norm(to_person)), 1e-6)
        force_n = self._receiving.pull_n * min(1.0, (now_s - self._since_s) / RAMP_S)
        return np.asarray(force_n * np.array([*(math.sqrt(1.0 - DOWN**2) * along), -DOWN]))

    def move_tray(self, dt_s: float) -> None:
        """Puts the tray where it is, with the velocity that leads to where it will be after dt_s."""
        if self.phase is Phase.IDLE and self._home:
            if self._walks:
                self._X_WT = self._home_W()
                self._set(self._X_WT, SpatialVelocity.Zero())
            return
        here, goal = self._X_WT, self._goal()
        self._X_WT, velocity = _towards(here, goal, dt_s)
        self._set(here, velocity)
        self._home = self.phase is Phase.IDLE and self._X_WT.IsNearlyEqualTo(self._home_W(), _MOVED)
        if self._home:
            self._set(self._X_WT, SpatialVelocity.Zero())

    def _goal(self) -> RigidTransform:
        """Where the tray is to go."""
        if self.phase is Phase.IDLE or self.offer is None:
            return self._way_home()
        if self.phase is Phase.RECEIVING:
            return self._X_WT
        under = self._under(self.offer)
        aside_m = float(np.linalg.norm((under.translation() - self._X_WT.translation())[:2]))
        if self.phase is Phase.BRINGING and aside_m > _ASIDE_M:
            return self._way_under(under)
        return under

    def _way_under(self, under: RigidTransform) -> RigidTransform:
        """First down before the body, lower than what is held out hangs, then below it."""
        here, level_m = self._X_WT.translation(), float(under.translation()[2]) - UNDER_M
        xy = here[:2] if here[2] > level_m + _NEAR_M else under.translation()[:2]
        return RigidTransform(under.rotation(), np.array([*xy, level_m]))

    def _way_home(self) -> RigidTransform:
        """First back to the body, level and a little down, as something may be above the tray; then into the torso."""
        home, here = self._home_W(), self._X_WT
        p_W = np.array([*home.translation()[:2], here.translation()[2] - _DOWN_M])
        aside_m = float(np.linalg.norm((p_W - here.translation())[:2]))
        return RigidTransform(here.rotation(), p_W) if aside_m > _ASIDE_M else home

    def _under(self, offer: Offer) -> RigidTransform:
        """Where the tray is just below what is held out, its handle towards the person."""
        x, y, _ = place_W = self._offers.place_W(offer)
        from_person = place_W - self._X_WP().translation()
        yaw_rad = math.atan2(from_person[1], from_person[0])
        level_m = self._offers.lowest_m(offer) - BELOW_M
        return RigidTransform(RotationMatrix.MakeZRotation(yaw_rad), np.array([x, y, level_m]))

    def _on_tray(self, offer: Offer) -> bool:
        """Returns whether the object is on the tray or just above it."""
        x, y, z = self._X_WT.inverse() @ self._offers.place_W(offer)
        return math.hypot(x, y) < ON_TRAY_M and -BELOW_M < z < ON_TRAY_M

    def _turn_to(self, phase: Phase, now_s: float) -> None:
        self.phase, self._since_s, self._home = phase, now_s, False

    def _go_home(self, now_s: float) -> None:
        """What was held out is gone: put the tray away."""
        self.offer = None
        self._turn_to(Phase.IDLE, now_s)

    def _X_WP(self) -> RigidTransform:
        return self._plant.EvalBodyPoseInWorld(self._context, self._body)

    def _home_W(self) -> RigidTransform:
        return self._X_WP() @ X_PT_HOME

    def _set(self, X_WT: RigidTransform, V_WT: SpatialVelocity) -> None:
        """Sets the tray's pose and velocity in the plant where they are others."""
        plant, context, tray = self._plant, self._context, self._tray
        if not plant.EvalBodyPoseInWorld(context, tray).IsNearlyEqualTo(X_WT, _MOVED):
            plant.SetFreeBodyPose(context, tray, X_WT)
        off = plant.EvalBodySpatialVelocityInWorld(context, tray).get_coeffs() - V_WT.get_coeffs()
        if float(np.abs(off).max()) > _MOVED:
            plant.SetFreeBodySpatialVelocity(context, tray, V_WT)


def _towards(X: RigidTransform, goal: RigidTransform, dt_s: float) -> tuple[RigidTransform, SpatialVelocity]:
    """The pose after dt_s on the way to a goal, at limited speed, and the velocity that leads there."""
    way = goal.translation() - X.translation()
    shift = way * min(1.0, SPEED_M_S * dt_s / max(float(np.linalg.norm(way)), 1e-9))
    turn = (goal.rotation() @ X.rotation().inverse()).ToAngleAxis()
    turned = AngleAxis(min(turn.angle(), TURN_RAD_S * dt_s), turn.axis())
    after = RigidTransform(RotationMatrix(turned) @ X.rotation(), X.translation() + shift)
    return after, SpatialVelocity(turned.axis() * turned.angle() / dt_s, shift / dt_s)


LOOK_STEPS = 4
"""Everybody looks whether something is held out once in so many steps."""


class Receivers(Stateful, saved=("_steps", "_offers", "_people")):
    """The people of one plant who receive, by name. `before_step` is to be called before each step."""

    def __init__(self, world: WorldDiagram, context: Context) -> None:
        """`context` is the plant's."""
        self._plant, self._context = world.plant, context
        self._offers = Offers(world, context)
        self._people = {
            model.name: Receiver(world, context, model.name, model.receiving, self._offers)
            for model in sorted(world.config.models, key=lambda model: model.name)
            if model.receiving is not None
        }
        self._steps = 0
        self._pulling = False

    def __getitem__(self, name: str) -> Receiver:
        """One of them. Raises KeyError."""
        return self._people[name]

    @property
    def busy(self) -> Collection[str]:
        """Those who take something, or have something on their tray."""
        return [name for name, person in self._people.items() if person.busy]

    def before_step(self, now_s: float, dt_s: float, holding: Sequence[str]) -> None:
        """Look, move the trays and pull; `holding` names the robots that hold something."""
        if self._steps % LOOK_STEPS == 0:
            self._offers.look(now_s, holding)
            for person in self._people.values():
                person.look(now_s)
        self._steps += 1
        pulls = [each for person in self._people.values() if (each := self._pull(person, now_s)) is not None]
        if pulls or self._pulling:
            self._plant.get_applied_spatial_force_input_port().FixValue(self._context, pulls)
        self._pulling = bool(pulls)
        for person in self._people.values():
            person.move_tray(dt_s)

    def _pull(self, person: Receiver, now_s: float) -> ExternallyAppliedSpatialForce | None:
        """The force with which a person pulls just now."""
        force_W = person.pull_W(now_s)
        if force_W is None or person.offer is None:
            return None
        pull, body = ExternallyAppliedSpatialForce(), self._offers.loose[person.offer.thing]
        pull.body_index = body.index()
        pull.p_BoBq_B = body.default_com()
        pull.F_Bq_W = SpatialForce(np.zeros(3), force_W)
        return pull
