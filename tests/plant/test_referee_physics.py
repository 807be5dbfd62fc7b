"""The referee sees a grasp by friction, and a drop, in a plant that really moves."""

from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from executive.words.goal import GoalCondition, GoalKind, Region, When
from plant.referee import Referee
from plant.robots.spot.kind import SPOT

FRICTION = CoulombFriction(0.9, 0.9)
TABLE = Region("the table", ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)), 0.7, 1.0)
GRASPED = GoalCondition(GoalKind.GRASPED, ("coke",), source=(TABLE,), when=When.SOME_TIME)
ON_TABLE = GoalCondition(GoalKind.ANSWERED, ("coke",), source=(TABLE,), answer=True)


class Press:
    """A hand on a lift (z) with a jaw (y) that closes on a block which lies on a table 0.75 m high."""

    def __init__(self):
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(time_step=0.005, discrete_contact_approximation="sap")
        plant, _ = AddMultibodyPlant(config, builder)
        world = plant.world_body()
        plant.RegisterCollisionGeometry(world, RigidTransform([0, 0, -0.5]), Box(9, 9, 1), "floor", FRICTION)
        plant.RegisterCollisionGeometry(world, RigidTransform([0, 0, 0.725]), Box(0.6, 0.6, 0.05), "table", FRICTION)
        alice = plant.AddModelInstance("alice")
        inertia = SpatialInertia.SolidSphereWithMass(0.5, 0.05)
        base, hand, jaw = (plant.AddRigidBody(name, alice, inertia) for name in ("body", "arm_wr1", "arm_f1x"))
        plant.WeldFrames(plant.world_frame(), base.body_frame(), RigidTransform([0, -0.05, 0.8]))
        joints = [
            PrismaticJoint("lift", base.body_frame(), hand.body_frame(), [0, 0, 1]),
            PrismaticJoint("close", hand.body_frame(), jaw.body_frame(), [0, 1, 0]),
        ]
        for joint in joints:
            actuator = plant.AddJointActuator(joint.name(), plant.AddJoint(joint), 40.0)
            actuator.set_controller_gains(PdControllerGains(p=2000.0, d=100.0))
        for body in (hand, jaw):
            plant.RegisterCollisionGeometry(body, RigidTransform(), Box(0.06, 0.02, 0.06), body.name(), FRICTION)
        coke = plant.AddRigidBody("coke", plant.AddModelInstance("coke"), SpatialInertia.SolidSphereWithMass(0.3, 0.03))
        plant.RegisterCollisionGeometry(coke, RigidTransform(), Box(0.06, 0.06, 0.1), "coke", FRICTION)
        plant.Finalize()
        plant.SetDefaultFloatingBaseBodyPose(coke, RigidTransform([0, 0, 0.81]))
        self.simulator = Simulator(builder.Build())
        self.context = plant.GetMyContextFromRoot(self.simulator.get_mutable_context())
        self.desired = plant.get_desired_state_input_port(alice)
        plant.SetPositions(self.context, alice, [0.0, 0.12])
        form = SimpleNamespace(sides_m=(0.06, 0.06, 0.06))
        placement = SimpleNamespace(name="coke", class_name="coke", form=form)
        self.referee = Referee(plant, [placement], robots={"alice": SPOT})

    def run(self, lift_m, jaw_m, seconds):
        """Move lift and jaw towards positions; the referee looks on at 20 Hz."""
        start = self.simulator.get_context().get_time()
        self.desired.FixValue(self.context, np.array([lift_m, jaw_m, 0, 0]))
        for t in start + np.arange(1, round(seconds / 0.05) + 1) * 0.05:
            self.simulator.AdvanceTo(t)
            self.referee.observe(self.context, t)
        return self


PLACED = GoalCondition(GoalKind.PLACED, ("coke",), source=(TABLE,), goal=(TABLE,))
TAKEN_UP = [(0.0, 0.12, 0.5), (0.0, 0.07, 0.5), (0.2, 0.07, 0.8)]
SET_DOWN = [(0.0, 0.07, 0.8), (0.0, 0.14, 0.4), (0.3, 0.14, 0.8)]


# motions: lift (m), jaw (m), seconds -> conditions that hold, one that does not, and drops
@pytest.mark.parametrize(
    ("motions", "holds", "denied", "drops"),
    [
        ([(0.0, 0.12, 0.6)], [ON_TABLE], [GRASPED], 0),
        (TAKEN_UP, [GRASPED], [ON_TABLE], 0),
        ([*TAKEN_UP, (0.2, 0.14, 0.8)], [ON_TABLE], [], 1),
        ([*TAKEN_UP, *SET_DOWN], [GRASPED, PLACED], [], 0),
    ],
    ids=["only lies there", "taken up by friction", "let go in the air", "set down and let go"],
)
def test_a_block_taken_up_by_friction_is_grasped_and_dropped_when_let_go_in_the_air(motions, holds, denied, drops):
    press = Press()
    for motion in motions:
        press.run(*motion)
    verdicts = [press.referee.judge([condition]) for condition in (*holds, *denied)]
    assert [each.success for each in verdicts] == [*[True] * len(holds), *[False] * len(denied)], verdicts
    assert (press.referee.drops, len(press.referee.collisions)) == (drops, 0)
