"""The referee tells an expected touch of the fingertips from a hit, by the speed and the force that it measures."""

import numpy as np
import pytest
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from plant.referee import Referee
from plant.robots.spot.kind import SPOT

FRICTION = CoulombFriction(0.9, 0.9)
TIP_M, PALM_M, STIFF_N_M = 0.23, 0.15, 2000.0


class Hand:
    """A hand on a lift, with one ball that touches a table 0.02 m below: at its fingertip, or at its palm."""

    def __init__(self, ball_x_m=TIP_M):
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=0.005, discrete_contact_approximation="sap", use_sampled_output_ports=False
        )
        plant, _ = AddMultibodyPlant(config, builder)
        table = plant.RegisterCollisionGeometry(
            plant.world_body(), RigidTransform([0.2, 0, 0.475]), Box(1, 1, 0.05), "table", FRICTION
        )
        alice = plant.AddModelInstance("alice")
        inertia = SpatialInertia.SolidSphereWithMass(0.5, 0.05)
        base, hand = (plant.AddRigidBody(name, alice, inertia) for name in ("body", "arm_wr1"))
        plant.WeldFrames(plant.world_frame(), base.body_frame(), RigidTransform([0, 0, 0.53]))
        lift = plant.AddJoint(PrismaticJoint("lift", base.body_frame(), hand.body_frame(), [0, 0, 1]))
        plant.AddJointActuator("lift", lift).set_controller_gains(PdControllerGains(p=STIFF_N_M, d=100.0))
        plant.RegisterCollisionGeometry(hand, RigidTransform([ball_x_m, 0, 0]), Sphere(0.01), "ball", FRICTION)
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        plant.Finalize()
        self.simulator = Simulator(builder.Build())
        self.context = plant.GetMyContextFromRoot(self.simulator.get_mutable_context())
        self.desired = plant.get_desired_state_input_port(alice)
        self.referee = Referee(plant, [], robots={"alice": SPOT}, scenery={table: "table"})
        self.referee.observe(self.context, 0.0)

    def lower(self, speed_m_s, depth_m):
        """Lowers the hand at a speed, to a depth below the touch, and waits there."""
        goal_m = 0.02 + depth_m
        for k in range(1, round((goal_m / speed_m_s + 0.3) / 0.05) + 1):
            t = 0.05 * k
            down_m = min(speed_m_s * t, goal_m)
            self.desired.FixValue(self.context, np.array([-down_m, -speed_m_s if down_m < goal_m else 0.0]))
            self.simulator.AdvanceTo(t)
            self.referee.observe(self.context, t)
        return [each.sentence.split(" at ")[0] for each in self.referee.collisions]


@pytest.mark.parametrize(
    ("speed_m_s", "depth_m", "ball_x_m", "until_s", "hits"),
    [
        (0.02, 0.004, TIP_M, 9.0, 0),  # slow, 8 N, as announced
        (0.02, 0.004, TIP_M, None, 1),  # nobody said so
        (0.02, 0.004, TIP_M, 0.5, 1),  # it was to be over by then
        (0.02, 0.015, TIP_M, 9.0, 1),  # 30 N in the end
        (0.20, 0.004, TIP_M, 9.0, 1),  # too fast
        (0.02, 0.004, PALM_M, 9.0, 1),  # the palm
    ],
)
def test_only_an_announced_slow_and_gentle_touch_of_the_fingertips_is_no_hit(
    speed_m_s, depth_m, ball_x_m, until_s, hits
):
    hand = Hand(ball_x_m)
    if until_s is not None:
        hand.referee.expect_touch("alice", until_s)
    assert hand.lower(speed_m_s, depth_m) == ["alice's gripper (arm_wr1) hit the table"] * hits
