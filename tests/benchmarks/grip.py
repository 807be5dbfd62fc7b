"""Holds, twists, pulls and shakes objects in Spot's gripper alone, with three models of its pads; prints JSON lines.

    python -m tests.benchmarks.grip [--pads dots,grid,hydroelastic] [--things NAME,NAME] [--force-n 40,100] [--step-s S]

The hand points down, as above a table, or ahead, as beside a bottle. It closes with a force; then the object gets its
weight within half a second, which acts beside the grip by a lever.

`turned_deg` and `slid_mm` are what it did in the gripper in 5 s, `shaken_deg` and `shaken_mm` after the hand moved to
and fro by 2 cm at 2 Hz along each axis in turn. `twist` is the torque about the closing axis at which it turns by 10
degrees, as a part of friction times force times mean radius of the patch, for both pads; `pull` the force along the
fingers at which it slides by 5 mm, as a part of friction times force for both. `failed` counts the runs in which the
solver gave up.
"""

import itertools
import math
import time
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    CollisionFilterDeclaration,
    Cylinder,
    GeometrySet,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from plant.diagram import NEAR_RIGID, TIME_STEP_S
from plant.models import urdf
from plant.robots.servos import gripper_set_point
from plant.robots.spot.description import FINGER_LINK, GRIPPER_JOINT, HAND_LINK, spot_facts
from tests.benchmarks.harness import command, show

DOTS = {
    HAND_LINK: [[0.155, -0.046], [0.180, -0.046], [0.205, -0.046], [0.219, -0.045], [0.231, -0.044]],
    FINGER_LINK: [[0.035, -0.002], [0.058, -0.006], [0.080, -0.012], [0.098, -0.024], [0.108, -0.040], [0.113, -0.052]],
}
"""Middles (x, z) of the dots in two rows, balls of 8 mm radius, that the grid replaced."""
DOT_M, DOTS_Y_M, DOT_STIFFNESS_N_M = 0.008, (-0.018, 0.018), 50000.0
MODULUS_PA, SOFT_M, CELL_M = 2e6, 0.016, 0.008
"""Hydroelastic pads: their modulus, thickness and the size of their mesh's cells."""
FINGER_GAINS, SLIDE_GAINS = PdControllerGains(p=60.0, d=0.8), PdControllerGains(p=2e5, d=4e3)
CLOSING_S, LOADING_S, HOLDING_S, SHAKING_S, PULLING_S = 0.8, 0.5, 5.0, 1.0, 8.0
SHAKE_M, SHAKE_RAD_S, MOST_LOAD = 0.02, 4.0 * math.pi, 3.0
TURNED_DEG, SLID_M, LOST_M = 10.0, 0.005, 0.03
PAD_END_M, HALF_BREADTH_M, PAD_Z_M, BESIDE_M = 0.239, 0.023, -0.036, 0.004
"""The half breadth is the mean of the fixed jaw's and the finger's."""


@dataclass(frozen=True)
class Thing:
    """An object in the gripper. In the hand, whose fingers point along x and close along z, it is `ahead_m` along x.

    `size_m` is along x, y and z; a `round` one is a cylinder along y. Its weight acts `lever_m` beside the grip along
    y. The hand points down, or ahead when it is `level`.
    """

    name: str
    size_m: tuple[float, float, float]
    mass_kg: float
    lever_m: float
    ahead_m: float
    round: bool = False
    level: bool = False
    friction: float = 0.6

    @property
    def shape(self):
        return Cylinder(0.5 * self.size_m[2], self.size_m[1]) if self.round else Box(*self.size_m)

    @property
    def pad_friction(self):
        """Friction coefficient between it and a pad of 1.0, as Drake combines them."""
        return 2.0 * self.friction / (1.0 + self.friction)

    def patch_m(self):
        """Mean distance (m) of the points of a pad's patch on it from the grip's middle."""
        x = 0.0 if self.round else min(0.5 * self.size_m[0], PAD_END_M - self.ahead_m)
        y = min(HALF_BREADTH_M, 0.5 * self.size_m[1])
        return float(np.hypot(*np.meshgrid(np.linspace(-x, x, 41), np.linspace(-y, y, 41))).mean())


THINGS = (
    Thing("hammer bar", (0.028, 0.30, 0.014), 0.60, 0.08, 0.234),
    Thing("round handle", (0.030, 0.30, 0.030), 0.60, 0.08, 0.232, round=True),
    Thing("thin bar", (0.010, 0.25, 0.010), 0.25, 0.05, 0.236),
    Thing("25 mm peg", (0.025, 0.08, 0.025), 0.30, 0.02, 0.234),
    Thing("block", (0.060, 0.060, 0.060), 1.20, 0.02, 0.216),
    Thing("plate", (0.100, 0.120, 0.004), 0.40, 0.04, 0.195),
    Thing("tube", (0.066, 0.130, 0.066), 0.40, 0.04, 0.183, round=True, level=True),
    Thing("bottle's neck", (0.028, 0.25, 0.028), 0.80, 0.08, 0.215, round=True, level=True),
    Thing("sledge bar", (0.028, 0.60, 0.014), 1.50, 0.25, 0.234),
    Thing("greasy bar", (0.028, 0.30, 0.014), 1.00, 0.05, 0.234, friction=0.08),
)
"""All but the last two are held by a real gripper; these turn and slip out."""


class Bench:
    """The hand on a carriage and an object between its fingers, whose loads (torque and force in the world) are set."""

    def __init__(self, pads, thing, step_s):
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=step_s, discrete_contact_approximation="sap", use_sampled_output_ports=False
        )
        self.plant, scene_graph = AddMultibodyPlant(config, builder)
        self.plant.set_sap_near_rigid_threshold(NEAR_RIGID)
        Parser(self.plant).AddModelsFromString(hand_urdf(pads), "urdf")
        self.hand, self.finger = self.plant.GetBodyByName(HAND_LINK), self.plant.GetJointByName(GRIPPER_JOINT)
        self.thing, self._step_s = thing, step_s
        roll, pitch = (0.5 * math.pi, 0.0) if thing.level else (0.0, 0.5 * math.pi)
        self.R_WH = RotationMatrix(RollPitchYaw(roll, pitch, 0.0))
        self._add_carriage()
        self._add_thing(soft := pads == "hydroelastic")
        if soft:
            add_soft_pads(self.plant)
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        self.plant.GetJointActuatorByName(GRIPPER_JOINT).set_controller_gains(FINGER_GAINS)
        self.plant.Finalize()
        links = (self.hand, self.finger.child_body())
        own = GeometrySet([each for link in links for each in self.plant.GetCollisionGeometriesForBody(link)])
        scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(own))
        self._simulator = Simulator(builder.Build())
        self._root = self._simulator.get_mutable_context()
        self._context = self.plant.GetMyMutableContextFromRoot(self._root)
        self.load_W, self._force_n = np.zeros(6), 0.0
        self._begin()

    def _add_carriage(self):
        before = self.plant.world_body()
        self._slides = self.plant.AddModelInstance("carriage")
        for name, axis in zip("xyz", np.eye(3), strict=True):
            after = self.plant.AddRigidBody(name, self._slides, SpatialInertia.SolidSphereWithMass(5.0, 0.1))
            joint = self.plant.AddJoint(PrismaticJoint(name, before.body_frame(), after.body_frame(), axis))
            self.plant.AddJointActuator(name, joint).set_controller_gains(SLIDE_GAINS)
            before = after
        self.plant.WeldFrames(before.body_frame(), self.hand.body_frame(), RigidTransform(self.R_WH, np.zeros(3)))

    def _add_thing(self, rigid):
        """Adds the object; its body's origin is the centre of mass."""
        thing, contact = self.thing, ProximityProperties()
        inertia = SpatialInertia(thing.mass_kg, np.zeros(3), UnitInertia.SolidBox(*thing.size_m))
        self._thing = self.plant.AddRigidBody("thing", self.plant.AddModelInstance("thing"), inertia)
        AddContactMaterial(friction=CoulombFriction(thing.friction, thing.friction), properties=contact)
        if rigid:
            AddRigidHydroelasticProperties(CELL_M, contact)
        turn = RollPitchYaw(0.5 * math.pi if thing.round else 0.0, 0.0, 0.0)
        X_OS = RigidTransform(turn, np.array([0.0, thing.lever_m, 0.0]))
        self.plant.RegisterCollisionGeometry(self._thing, X_OS, thing.shape, "thing", contact)

    def _begin(self):
        """Puts the object beside the fixed jaw and opens the finger about it."""
        gap_m = self.thing.size_m[2] + 2.0 * BESIDE_M
        self._open_rad = -2.0 * math.asin(0.5 * (gap_m + 0.01) / 0.125)
        self.finger.set_angle(self._context, self._open_rad)
        X_HO = RigidTransform(np.array([self.thing.ahead_m, -self.thing.lever_m, PAD_Z_M + 0.5 * gap_m]))
        X_WO = self.hand.EvalPoseInWorld(self._context) @ X_HO
        self.plant.SetFreeBodyPose(self._context, self._thing, X_WO)
        self._X_HO = X_HO

    def close(self, force_n):
        self._force_n = force_n
        self.wait(CLOSING_S)
        self._X_HO = self.X_HO()

    def weigh_down(self):
        weight_W = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -9.81 * self.thing.mass_kg])
        self.wait(LOADING_S, load_W=weight_W)
        self.load_W = weight_W

    def wait(self, duration_s, shaken=None, load_W=None):
        """Steps for a time, or until the object is lost."""
        for _ in self.steps(duration_s, shaken, load_W):
            if self.slid_m() > LOST_M:
                return

    def steps(self, duration_s, shaken=None, load_W=None):
        """Steps while the hand is shaken along an axis, and a load grows from nothing; yields the part of the time."""
        began_s, gripper = self._root.get_time(), self.finger.model_instance()
        lead_rad = self._force_n * spot_facts()["gripper"]["tip_radius"] / FINGER_GAINS.p
        first = self._thing.floating_velocities_start_in_v()
        for k in range(round(duration_s / self._step_s)):
            elapsed_s, slides, load = k * self._step_s, np.zeros(6), np.zeros(self.plant.num_velocities())
            if shaken is not None:
                phase = SHAKE_RAD_S * elapsed_s
                slides[shaken], slides[3 + shaken] = SHAKE_M * math.sin(phase), SHAKE_M * SHAKE_RAD_S * math.cos(phase)
            self.plant.get_desired_state_input_port(self._slides).FixValue(self._context, slides)
            if k % 2 == 0:
                now_rad = self.finger.get_angle(self._context)
                goal = gripper_set_point(0.0, now_rad, lead_rad) if self._force_n else self._open_rad
                self.plant.get_desired_state_input_port(gripper).FixValue(self._context, np.array([goal, 0.0]))
            part = elapsed_s / duration_s
            load[first : first + 6] = self.load_W + (0.0 if load_W is None else part * load_W)
            self.plant.get_applied_generalized_force_input_port().FixValue(self._context, load)
            self._simulator.AdvanceTo(began_s + elapsed_s + self._step_s)
            yield part

    def X_HO(self):
        return self.hand.EvalPoseInWorld(self._context).inverse() @ self._thing.EvalPoseInWorld(self._context)

    def turned_deg(self, axis=None):
        """Turn of the object in the hand since it was gripped: about an axis of the hand, or about any."""
        turn = (self.X_HO().rotation() @ self._X_HO.rotation().inverse()).ToAngleAxis()
        return math.degrees(abs(turn.angle() * (1.0 if axis is None else turn.axis()[axis])))

    def slid_m(self):
        """Slide of the object's gripped point in the hand since it was gripped."""
        p_OG = np.array([0.0, self.thing.lever_m, 0.0])
        return float(np.linalg.norm(self.X_HO() @ p_OG - self._X_HO @ p_OG))


def hand_urdf(pads):
    """The last arm link and the finger of Spot alone, with one model of the pads."""
    facts = spot_facts()
    robot = ElementTree.Element("robot", name="hand")
    for part in facts["arm"][-2:]:
        link = urdf.add_link(robot, part["link"], part)
        boxes = [(shape, {}) for shape in part["collision"]]
        for index, (shape, contact) in enumerate((*boxes, *spheres(pads, part))):
            urdf.add_collision(link, f"{part['link']}_{index}", shape, contact)
    urdf.add_joint(robot, GRIPPER_JOINT, HAND_LINK, GRIPPER_JOINT, facts["arm"][-1])
    return ElementTree.tostring(robot, encoding="unicode")


def spheres(pads, part):
    """Spheres of a link's pads with their proximity properties; hydroelastic pads have none."""
    facts = spot_facts()
    if pads == "dots":
        dots = {"radius": DOT_M, "y": DOTS_Y_M, "xz": DOTS[part["link"]]}
        yield from urdf.pad_shapes([dots], facts["pad_friction"], DOT_STIFFNESS_N_M)
    elif pads == "grid":
        yield from urdf.pad_shapes(part["pads"], facts["pad_friction"], facts["pad_stiffness_n_m"])


def add_soft_pads(plant):
    for link, places in DOTS.items():
        for index, (start, end) in enumerate(itertools.pairwise(np.array(places))):
            along, contact = end - start, ProximityProperties()
            AddContactMaterial(friction=CoulombFriction(1.0, 1.0), properties=contact, dissipation=5.0)
            AddCompliantHydroelasticProperties(CELL_M, MODULUS_PA, contact)
            x, z = 0.5 * (start + end)
            X_LP = RigidTransform(RollPitchYaw(0.0, -math.atan2(along[1], along[0]), 0.0), np.array([x, 0.0, z]))
            box = Box(float(np.hypot(*along)), 2.0 * HALF_BREADTH_M, SOFT_M)
            plant.RegisterCollisionGeometry(plant.GetBodyByName(link), X_LP, box, f"soft_{link}_{index}", contact)


def held(pads, thing, force_n, step_s):
    bench = Bench(pads, thing, step_s)
    bench.close(force_n)
    bench.weigh_down()
    bench.wait(HOLDING_S)
    result = {"turned_deg": bench.turned_deg(), "slid_mm": 1e3 * bench.slid_m()}
    for axis in range(3):
        bench.wait(SHAKING_S, shaken=axis)
    result |= {"shaken_deg": bench.turned_deg(), "shaken_mm": 1e3 * bench.slid_m()}
    return {name: round(value, 1) for name, value in result.items()} | {"held": bench.slid_m() < LOST_M}


def twisted(pads, thing, force_n, step_s):
    bench = Bench(pads, replace(thing, lever_m=0.0), step_s)
    torque_W = 2.0 * thing.pad_friction * force_n * thing.patch_m() * bench.R_WH.matrix()[:, 2]
    load = np.array([*torque_W, 0.0, 0.0, 0.0])
    return {"twist": _resisted(bench, force_n, load, lambda: bench.turned_deg(2) > TURNED_DEG)}


def pulled(pads, thing, force_n, step_s):
    bench = Bench(pads, replace(thing, lever_m=0.0), step_s)
    force_W = 2.0 * thing.pad_friction * force_n * bench.R_WH.matrix()[:, 0]
    load = np.array([0.0, 0.0, 0.0, *force_W])
    return {"pull": _resisted(bench, force_n, load, lambda: bench.slid_m() > SLID_M)}


def _resisted(bench, force_n, load, moved):
    """Part of a load at which the clamped object moves; the load grows to `MOST_LOAD` times itself."""
    bench.close(force_n)
    parts = bench.steps(PULLING_S, load_W=MOST_LOAD * load)
    return round(MOST_LOAD * next((part for part in parts if moved()), 1.0), 2)


def measure(pads, thing, force_n, step_s):
    result = {"pads": pads, "thing": thing.name, "force_n": force_n, "failed": 0}
    began_s = time.process_time()
    for test in (held, twisted, pulled):
        try:
            result |= test(pads, thing, force_n, step_s)
        except RuntimeError:
            result["failed"] += 1
    return result | {"cpu_s": round(time.process_time() - began_s, 2)}


def main(
    pads: tuple[str, ...] = ("dots", "grid", "hydroelastic"),
    things: tuple[str, ...] = tuple(thing.name for thing in THINGS),
    force_n: tuple[float, ...] = (40.0, 100.0),
    step_s: float = TIME_STEP_S,
):
    chosen = [thing for thing in THINGS if thing.name in things]
    for case in itertools.product(pads, chosen, force_n):
        show(measure(*case, step_s))


if __name__ == "__main__":
    command(main)
