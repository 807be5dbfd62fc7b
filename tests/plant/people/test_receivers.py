"""People who receive offered objects in the plant."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity

from executive.words.json_values import pack, unpack
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.models.catalogue import load_catalogue
from plant.people import receivers
from plant.people.receivers import Offer, Offers, Phase
from plant.referee import Referee
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import SPOT
from plant.worlds.seeding import Placement, PointRoute, PointStop, Receiving
from skills.robot import ArmTrajectory, Pose2D
from tests.plant.boxes import box_world

CATALOGUE = load_catalogue()
PERSON, CAN = CATALOGUE["person"].forms["standing"], CATALOGUE["coke"].forms["can"]
OUT_RAD = np.array([0.0, -1.45, 1.85, 0.0, -0.4, 1.57])
GRIP_X_M = 0.18
TAKES = Receiving()
X_WP = RigidTransform(RollPitchYaw(0.0, 0.0, math.pi), [1.45, 0.0, 0.0])


class Hall:
    """Alice offers a can to Kim, who stands in front of her or walks past; Lee, as near, takes nothing."""

    def __init__(self, folder, receiving=TAKES, *, route=None):
        directives = box_world(folder, floor=("20 20 1", "0 0 -0.5"))
        models = [
            LooseModel("Kim", PERSON.path(), X_WP, fixed=route is None, route=route, receiving=receiving),
            LooseModel("Lee", PERSON.path(), X_WP @ RigidTransform([0.0, 0.7, 0.0]), fixed=True),
            LooseModel("coke", CAN.path(), RigidTransform([-2.0, 0.0, CAN.rest_height_m])),
        ]
        robots = [PlacedRobot("Alice", "spot", Pose2D(0.0, 0.0, 0.0))]
        config = DiagramConfig(directives=directives, models=models, robots=robots, visuals=False, render=False)
        self.world = build_diagram(config)
        self.engine = Engine(self.world)
        placed = Placement("coke", "coke", CAN, RigidTransform())
        self.referee = Referee(
            self.world.plant, [placed], robots={"Alice": SPOT}, persons=["Kim", "Lee"], scenery=self.world.scenery
        )
        self.engine.observe(lambda now_s: self.referee.observe(self.engine.context, now_s), every=4)
        self.robot = self.engine.robots["Alice"]
        self.lease = self.robot.acquire_lease("test")
        self._hold_out()

    def _hold_out(self):
        """Stretch the arm, and close the gripper about a can that is put there."""
        names = self.robot.capabilities().arm.joint_names
        joints, plant, context = self.robot.joints().position_rad, self.world.plant, self.engine.context
        way = np.vstack([[joints[name] for name in names], OUT_RAD])
        self.robot.move_arm(ArmTrajectory(np.array([0.0, 2.0]), way), until_s=5.0, lease=self.lease)
        self.robot.set_gripper(0.9, 20.0, until_s=3.0, lease=self.lease)
        self.engine.advance(2.5)
        hand = plant.GetBodyByName("arm_wr1")
        X_WC = RigidTransform(plant.EvalBodyPoseInWorld(context, hand) @ np.array([GRIP_X_M, 0.0, 0.0]))
        for step in range(55):
            if step == 40:
                self.robot.set_gripper(0.0, 60.0, until_s=9.0, lease=self.lease)
            plant.SetFreeBodyPose(context, self.can, X_WC)
            plant.SetFreeBodySpatialVelocity(context, self.can, SpatialVelocity.Zero())
            self.engine.advance(0.0125)
        while not self.robot.gripper().holding and self.engine.now() < 6.0:
            self.engine.advance(0.05)
        assert self.robot.gripper().holding

    def saved(self):
        """The state of the hall now."""
        world = {name: each.copy() for name, each in self.engine.world_state().items()}
        return self.engine.state(), world, self.referee.state()

    def put_back(self, saved):
        """Put all back to a saved state; Alice's commands are over, and she holds on."""
        engine, world, referee = saved
        self.engine.resume(engine, world)
        self.referee.resume(referee, {})
        self.lease = self.robot.acquire_lease("test")
        return self

    @property
    def can(self):
        return self.world.plant.GetBodyByName("coke")

    def place_W(self, body):
        return self.world.plant.EvalBodyPoseInWorld(self.engine.context, body).translation()

    @property
    def kim(self):
        return self.engine.receivers["Kim"]

    def until(self, phase, limit_s=8.0):
        end_s = self.engine.now() + limit_s
        while self.kim.phase is not phase:
            assert self.engine.now() < end_s, f"still {self.kim.phase}"
            self.engine.advance(0.05)
        return self

    def let_go(self):
        self.robot.set_gripper(1.2, 20.0, until_s=self.engine.now() + 3.0, lease=self.lease)


def slide(hall, along_m):
    """Puts the state as if the object had moved in the hand."""
    state = hall.kim.state()
    hall.kim.restore({**state, "p_HO": pack(unpack(state["p_HO"]) + [along_m, 0.0, 0.0])})


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """One hall with its states, when Alice holds the can out and when each phase of the receiving begins.

    Also the places of the tray and the can until the pull, and the number of those before the tray moves.
    """
    hall, path, counts = Hall(tmp_path_factory.mktemp("hall")), [], []
    bodies, states = (hall.world.trays["Kim"], hall.can), {None: hall.saved()}
    hall.engine.observe(lambda _: path.append([hall.place_W(each) for each in bodies]), every=4)
    for phase in (Phase.BRINGING, Phase.PULLING):
        states[phase] = hall.until(phase).saved()
        counts.append(len(path))
    return hall, states, np.array(path), counts[0]


@pytest.fixture
def at(stage):
    """Puts the hall back to the beginning of a phase, or to the time when the can is held out."""
    hall, states, *_ = stage
    return lambda phase=None: hall.put_back(states[phase])


def test_the_tray_moves_down_at_the_body_before_it_nears_the_object(stage):
    *_, path, before = stage
    lowest_m = path[before, 1, 2] - 0.06
    for (x, _, z), can_W in path[before:]:
        under = math.dist((x, 0.0), can_W[:2]) < 0.05
        assert under or x > 1.4 or z < lowest_m - 0.1


def test_the_lowest_point_of_a_gripper_is_found_from_a_few_of_its_balls(at, monkeypatch):
    hall, computed = at(), []
    offers, plant, lowest_m = Offers(hall.world, hall.engine.context), hall.world.plant, receivers._lowest_m
    monkeypatch.setattr(receivers, "_lowest_m", lambda X_WB, row: computed.append(1) or lowest_m(X_WB, row))
    found_m = offers.lowest_m(Offer("Alice", "coke"))
    bodies = [plant.GetBodyByName(name) for name in ("coke", "arm_wr1", "arm_f1x")]
    shapes = [(body, each) for body in bodies for each in plant.GetCollisionGeometriesForBody(body)]
    inspector = hall.world.scene_graph.model_inspector()
    lows_m = [
        lowest_m(plant.EvalBodyPoseInWorld(hall.engine.context, body), receivers.shape_row(inspector, each))
        for body, each in shapes
    ]
    assert found_m == min(lows_m) and len(computed) < len(shapes) // 3


def test_the_tray_moves_below_an_offered_object_without_contact(stage):
    _, _, path, _ = stage
    trays_W, cans_W = path[:, 0], path[:, 1]
    assert trays_W[0] == pytest.approx([1.45, 0.0, 1.08], abs=1e-6)
    assert 0.005 < cans_W[-1, 2] - CAN.rest_height_m - trays_W[-1, 2] < 0.08
    assert 0.1 < np.linalg.norm(np.diff(trays_W, axis=0), axis=1).max() / 0.05 < 0.31
    assert cans_W[-1] == pytest.approx(cans_W[0], abs=0.005)


def test_a_gripper_that_holds_on_is_pulled_at_again_after_a_pause(at, monkeypatch):
    monkeypatch.setattr(receivers, "PULL_S", 1.2)
    monkeypatch.setattr(receivers, "PAUSE_S", 0.5)
    assert at(Phase.PULLING).until(Phase.PAUSING).until(Phase.PULLING).robot.gripper().holding


def test_the_person_pulls_again_when_the_object_only_slides_in_the_gripper(at):
    hall = at(Phase.PULLING)
    slide(hall, 0.011)
    hall.until(Phase.RECEIVING).until(Phase.PULLING)
    assert hall.robot.gripper().holding


def test_the_arms_joints_feel_the_pull(at):
    hall = at(Phase.BRINGING)
    name = hall.robot.capabilities().arm.joint_names[1]

    def effort():
        readings = []
        for _ in range(10):
            hall.engine.advance(0.05)
            readings.append(hall.robot.joints().effort_nm[name])
        return np.mean(readings)

    before = effort()
    at(Phase.PULLING).engine.advance(1.0)
    assert abs(effort() - before) > 2.0


def test_the_tray_goes_home_when_the_object_is_drawn_in(at):
    hall = at(Phase.PULLING)
    q = hall.robot.joints().position_rad
    names = hall.robot.capabilities().arm.joint_names
    way = np.vstack([[q[name] for name in names], [0.0, -3.0, 2.85, 0.0, 0.1, 1.57]])
    until_s = hall.engine.now() + 6.0
    hall.robot.move_arm(ArmTrajectory(np.array([0.0, 3.0]), way), until_s=until_s, lease=hall.lease)
    hall.until(Phase.IDLE).engine.advance(6.0)
    assert hall.place_W(hall.world.trays["Kim"]) == pytest.approx([1.45, 0.0, 1.08], abs=1e-6)
    assert not hall.kim.busy


def test_a_person_who_does_not_receive_has_no_tray(at):
    assert set(at().world.trays) == {"Kim"}


def test_a_walking_person_stops_to_take_an_object(tmp_path):
    route = PointRoute((PointStop((1.45, 0.0), 4.0), PointStop((1.45, 3.0))), speed_m_s=1.0, yields=False)
    hall = Hall(tmp_path, Receiving(reaction_s=0.5), route=route).until(Phase.BRINGING)
    person = hall.world.plant.GetBodyByName("person", hall.world.models["Kim"])
    stopped_W = hall.place_W(person)
    hall.engine.advance(2.5)
    assert hall.place_W(person) == pytest.approx(stopped_W, abs=1e-6) and stopped_W[1] < 2.0


def test_an_object_released_under_the_pull_rests_on_the_tray_from_the_same_state_again(at, stage):
    _, states, *_ = stage
    for _ in range(2):
        hall = at(Phase.PULLING)
        assert hall.kim.phase is Phase.PULLING
        assert hall.kim.state() == states[Phase.PULLING][0]["receivers"]["people"]["Kim"]
        assert hall.referee.objects["coke"].on_tray_of is None
        hall.engine.advance(0.4)
        hall.let_go()
        hall.until(Phase.RECEIVING).engine.advance(2.0)
        history = hall.referee.objects["coke"]
        assert (history.on_tray_of, history.drops, hall.referee.collisions) == ("Kim", 0, ())


# how far (m) the object has moved in the hand while the tray still comes -> whether it counts as let go of
@pytest.mark.parametrize(("moved_m", "let_go"), [(0.013, False), (0.02, True)])
def test_a_small_creep_before_the_pull_does_not_count_as_released(at, moved_m, let_go):
    hall = at(Phase.BRINGING)
    slide(hall, moved_m)
    hall.engine.advance(0.3)
    assert (hall.kim.phase is Phase.RECEIVING) is let_go
