"""The referee records the true events and judges goal conditions by them."""

import math
import time
from dataclasses import dataclass, replace

import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from executive.words.goal import GoalCondition, GoalKind, Region, When
from plant.models.catalogue import ModelForm
from plant.referee import Referee
from plant.referee.entities import Kind
from plant.referee.judge import judge
from plant.referee.object_history import TimedPath, Truth
from plant.robots.spot.kind import SPOT
from skills.relations import Landmark, Relation, RelationKind
from skills.robot import Pose2D

FRICTION = CoulombFriction(0.8, 0.8)
HALF = 0.03  # half a side of the objects, which are cubes
TOUCH = 0.001  # depth of a touch
TABLE_Z = 0.75
ON_TABLE, OVER_TABLE = (1.5, 0.0, TABLE_Z + HALF - TOUCH), (1.5, 0.0, TABLE_Z + HALF - TOUCH + 0.3)
ON_TRAY = (0.0, 2.4, 0.9)


def square(name, x, y, half=0.5, **heights):
    return Region(
        name, ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)), **heights
    )


TABLE = square("the table", 1.5, 0.0, z_min_m=0.7, z_max_m=1.0)
SHELF = square("the shelf", -1.5, 0.0, z_min_m=0.7, z_max_m=1.0)
CUBE = ModelForm(file="", half_extents_m=(HALF, HALF), rest_height_m=HALF)


@dataclass(frozen=True)
class Placement:
    name: str
    class_name: str
    form: ModelForm = CUBE


class Stage:
    """A puppet stage: every body is put where the test wants it, and the referee looks on at 20 Hz."""

    LINKS = ("body", "arm_sh0", "arm_wr1", "arm_f1x", "fl_lleg")

    def __init__(self):
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(time_step=0.005, use_sampled_output_ports=False)
        self.plant, _ = AddMultibodyPlant(config, builder)
        self._static("floor", Box(20, 20, 1), (0, 0, -0.5))
        self._static("table", Box(1, 1, 0.05), (1.5, 0, TABLE_Z - 0.025))
        self._static("shelf", Box(1, 1, 0.05), (-1.5, 0, TABLE_Z - 0.025))
        self._static("wall", Box(0.1, 4, 2), (5, 0, 1.2))
        self._static("robin", Cylinder(0.2, 1.6), (0, 3, 0.85))
        self._static("robin's tray", Box(0.3, 0.3, 0.02), np.subtract(ON_TRAY, (0, 0, HALF - TOUCH + 0.01)))
        self.bodies = {}
        for name in ("coke", "coke_2", "hammer"):
            self._free(name, name, Box(2 * HALF, 2 * HALF, 2 * HALF))
        for link in self.LINKS:
            self._free("alice", link, Box(0.1, 0.02, 0.02) if link.startswith("arm") else Box(0.2, 0.1, 0.1))
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyContextFromRoot(self.root)
        self.placements = [Placement("coke", "coke"), Placement("coke_2", "coke"), Placement("hammer", "hammer")]
        self.referee = Referee(self.plant, self.placements, robots={"alice": SPOT}, persons=["robin"])
        self.time = 0.0
        for i, link in enumerate(self.LINKS):
            self.put(link, (-3, -3 - i, 0.6))
        self.put("coke", ON_TABLE)
        self.put("coke_2", (-4, 4, HALF - TOUCH))
        self.put("hammer", (-1.5, 0, TABLE_Z + HALF - TOUCH))
        self.watch()

    def _static(self, name, shape, p_WG):
        body = self.plant.AddRigidBody(
            name, self.plant.AddModelInstance(name), SpatialInertia.SolidSphereWithMass(1, 1)
        )
        self.plant.WeldFrames(self.plant.world_frame(), body.body_frame(), RigidTransform(p_WG))
        self.plant.RegisterCollisionGeometry(body, RigidTransform(), shape, name, FRICTION)

    def _free(self, instance, name, shape):
        if not self.plant.HasModelInstanceNamed(instance):
            self.plant.AddModelInstance(instance)
        index = self.plant.GetModelInstanceByName(instance)
        body = self.plant.AddRigidBody(name, index, SpatialInertia.SolidSphereWithMass(0.3, 0.1))
        self.plant.RegisterCollisionGeometry(body, RigidTransform(), shape, name, FRICTION)
        self.bodies[name] = body

    def put(self, name, p_WB):
        X_WB = RigidTransform(np.asarray(p_WB, dtype=float))
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(self.context, self.bodies[name], X_WB)
        return self

    def watch(self, seconds=0.5):
        for _ in range(round(seconds / 0.05)):
            self.referee.observe(self.context, self.time)
            self.time += 0.05
        return self

    def hold(self, name, p_WB):
        """Put an object with a jaw on either side of it."""
        x, y, z = p_WB
        gap = HALF + 0.01 - TOUCH
        return self.put(name, p_WB).put("arm_wr1", (x, y - gap, z)).put("arm_f1x", (x, y + gap, z))

    def let_go(self):
        return self.put("arm_wr1", (-3, -5, 0.6)).put("arm_f1x", (-3, -6, 0.6))

    def carry(self, name, start, end, speed=0.5):
        """Hold it at start and move it to end with the hand."""
        start, end = np.array(start, dtype=float), np.array(end, dtype=float)
        steps = int(np.ceil(np.linalg.norm(end - start) / (speed * 0.05)))
        for share in np.linspace(0, 1, steps + 1):
            self.hold(name, start + share * (end - start)).watch(0.05)
        return self

    def lift(self, name="coke", p_WO=ON_TABLE, height=0.3):
        up = np.add(p_WO, (0, 0, height))
        return self.hold(name, p_WO).watch(0.3).carry(name, p_WO, up)

    def fall(self, name, start, end):
        """Let an object fall freely."""
        start, end = np.array(start, dtype=float), np.array(end, dtype=float)
        for t in np.arange(0, np.sqrt(2 * (start[2] - end[2]) / 9.81), 0.05):
            self.put(name, start - (0, 0, 4.905 * t * t)).watch(0.05)
        return self.put(name, end).watch(0.6)

    def holds(self, *conditions):
        return self.referee.judge(conditions).success

    def results(self, *conditions):
        """Whether each of the conditions holds by itself."""
        return [self.holds(each) for each in conditions]

    def verdict(self, *conditions):
        """Whether the conditions hold, and why."""
        report = self.referee.judge(conditions)
        return report.success, report.why


GRASPED = GoalCondition(GoalKind.GRASPED, ("coke", "beer"), source=(TABLE,), when=When.SOME_TIME)
HANDED = GoalCondition(GoalKind.HANDED_OVER, ("coke",), person="robin")
PLACED = GoalCondition(GoalKind.PLACED, ("coke",), goal=(SHELF,))
ON_SHELF = (-1.5, 0.3, TABLE_Z + HALF - TOUCH)


def test_lifted_object_counts_as_grasped_even_after_it_was_put_down():
    assert (stage := Stage().lift()).holds(GRASPED)
    assert stage.carry("coke", OVER_TABLE, ON_SHELF).let_go().watch().holds(GRASPED)


def pushed(by):
    return Stage().hold("coke", ON_TABLE).watch(0.3).carry("coke", ON_TABLE, np.add(ON_TABLE, by))


def passed_in_flight():
    stage = Stage().put("arm_wr1", (1.5, -0.039, 1.2))
    for z in np.linspace(0.9, 1.6, 8):
        stage.put("coke", (1.5, 0, z)).watch(0.05)
    return stage


@pytest.mark.parametrize(
    "act",
    [
        pytest.param(Stage, id="untouched"),
        pytest.param(lambda: pushed((0.2, 0, 0)), id="pushed"),
        pytest.param(lambda: pushed((0, 0.45, 0)), id="dragged far along the table"),
        pytest.param(lambda: Stage().lift(height=0.02), id="barely raised"),
        pytest.param(lambda: Stage().put("coke", (1.5, 0, 1.3)).watch(), id="rises without the gripper"),
        pytest.param(passed_in_flight, id="passes the gripper in flight"),
    ],
)
def test_an_object_that_was_not_lifted_is_not_grasped(act):
    success, why = act().verdict(GRASPED)
    assert not success and "coke or beer was lifted from the table" in why


def test_an_object_moved_low_but_far_away_is_grasped():
    stage, barely = pushed((0, 0, 0.015)), np.add(ON_TABLE, (0, 0, 0.015))
    assert not stage.holds(GRASPED)
    assert stage.carry("coke", barely, np.add(barely, (-1.0, 0, 0))).holds(GRASPED)


def test_object_from_elsewhere_or_of_another_class_is_not_grasped():
    hammer = GoalCondition(GoalKind.GRASPED, ("hammer",), source=(TABLE,))
    stage = Stage().lift("hammer", (-1.5, 0, TABLE_Z + HALF - TOUCH))
    assert stage.results(hammer, GRASPED, replace(hammer, source=())) == [False, False, True]


def test_count_asks_for_as_many_objects():
    two, stage = replace(GRASPED, count=2, source=()), Stage().lift()
    success, why = stage.verdict(two)
    assert not success and "1 of 2" in why
    assert stage.let_go().put("coke", ON_TABLE).watch().lift("coke_2", (-4, 4, HALF - TOUCH)).holds(two)


def test_only_the_source_that_it_was_lifted_from_is_named():
    _, why = Stage().lift().verdict(replace(GRASPED, source=(SHELF, TABLE)))
    assert TABLE.name in why and SHELF.name not in why


def test_no_condition_is_not_judged():
    assert Stage().referee.judge([]).success is None


def given():
    """The coke is carried to robin, let go, and sinks by 2 cm onto the tray."""
    above = np.add(ON_TRAY, (0, 0, 0.02))
    return Stage().lift().carry("coke", OVER_TABLE, above).let_go().put("coke", ON_TRAY)


def test_let_go_and_at_rest_on_the_persons_tray_is_handed_over():
    verdict = given().watch().referee.judge([GRASPED, HANDED])
    assert (verdict.success, verdict.drops) == (True, 0), verdict.why
    assert "The coke rests on robin's tray." in verdict.why


def test_an_object_that_falls_off_the_tray_is_dropped_but_not_one_that_tips():
    assert given().watch(0.1).put("coke", np.subtract(ON_TRAY, (0, 0, TOUCH))).watch().referee.drops == 0
    verdict = given().watch(0.1).fall("coke", ON_TRAY, (0.6, 2.4, HALF - TOUCH)).referee.judge([HANDED])
    assert (verdict.success, verdict.drops, "not on the tray" in verdict.why) == (False, 1, True)


def test_taken_from_the_tray_again_it_was_handed_over():
    stage = given().watch()
    passing = replace(HANDED, when=When.END_OF_STEP, ended_s=stage.time)
    assert not stage.hold("coke", np.add(ON_TRAY, (0, 0, 0.2))).watch().holds(HANDED)
    success, why = stage.verdict(passing)
    assert success and "The coke was put on robin's tray." in why


@pytest.mark.parametrize("end", [(0.0, 2.4, 0.9), (0.0, 2.4, 0.3)])
def test_an_object_that_is_never_released_is_not_handed_over(end):
    success, why = Stage().lift().carry("coke", OVER_TABLE, np.add(end, (0.5, 0, 0))).verdict(HANDED)
    assert not success and f"is still in the gripper, {end[2]:.2f} m high, 0.78 m from robin" in why


def test_pressed_against_the_person_is_no_hand_over():
    end = (0.0, 3 - 0.2 - HALF + TOUCH, 0.9)
    assert not Stage().lift().carry("coke", OVER_TABLE, end).holds(HANDED)


def test_object_let_go_near_the_person_is_no_hand_over():
    stage = Stage().lift().carry("coke", OVER_TABLE, ON_TRAY).let_go()
    verdict = stage.fall("coke", ON_TRAY, (0.0, 2.4, HALF - TOUCH)).referee.judge([GRASPED, HANDED])
    assert (verdict.success, verdict.drops) == (False, 1)


def test_an_object_that_leaves_the_world_is_a_fault_of_the_simulation():
    stage = Stage().lift().carry("coke", OVER_TABLE, ON_TRAY).let_go()
    stage.put("coke", (9.0, 2.4, 3.0)).watch(0.1).put("coke", (30.0, 2.4, -2.0)).watch(0.1)
    verdict = stage.referee.judge([GRASPED, HANDED])
    assert (verdict.success, verdict.drops) == (None, 0)
    assert "The simulation lost the coke." in verdict.why
    assert "it left the world." in stage.referee.events[-1]
    hammer = replace(GRASPED, classes=("hammer",))
    assert stage.referee.judge([GRASPED, HANDED, hammer]).success is False


def test_a_hand_over_from_another_source_does_not_count():
    assert given().watch().results(*(replace(HANDED, source=(each,)) for each in (SHELF, TABLE))) == [False, True]


def test_unknown_person_is_said():
    success, why = Stage().verdict(replace(HANDED, person="eve"))
    assert not success and "no person eve" in why


def placed_stage():
    stage = Stage().lift().carry("coke", OVER_TABLE, np.add(ON_SHELF, (0, 0, 0.2)))
    return stage.carry("coke", np.add(ON_SHELF, (0, 0, 0.2)), ON_SHELF)


def test_put_down_and_let_go_is_placed():
    stage = placed_stage().let_go().watch()
    assert (stage.holds(GRASPED, PLACED), stage.referee.drops) == (True, 0)
    success, why = stage.verdict(replace(PLACED, goal=(TABLE,)))
    assert not success and "not resting on the table" in why


def test_an_object_in_the_gripper_or_in_the_goal_from_the_start_is_not_placed():
    assert not placed_stage().watch().holds(PLACED)
    assert not Stage().watch().holds(GoalCondition(GoalKind.PLACED, ("hammer",), goal=(SHELF,)))


def put_then(stage, *taken_s):
    """That the coke was put on the shelf until now, from where later steps take it again in such times."""
    return replace(PLACED, ended_s=stage.time, taken_s=taken_s)


def test_an_object_must_stay_where_it_was_put_until_a_later_step_takes_it():
    stage = placed_stage().let_go().watch()
    put, taken = put_then(stage), put_then(stage, (stage.time, stage.time + 9.0))
    assert stage.holds(put)
    stage.watch(2.0).lift("coke", ON_SHELF)
    assert stage.results(put, taken, replace(put, when=When.END_OF_STEP)) == [False, True, True]


def test_an_object_that_falls_after_its_step_is_missed_though_a_later_step_might_have_taken_it():
    stage = placed_stage().let_go().watch()
    put = put_then(stage, (stage.time, stage.time + 9.0))
    stage.watch(2.0).fall("coke", ON_SHELF, (-1.5, 0.6, HALF - TOUCH))
    assert stage.results(put, replace(put, when=When.END_OF_STEP)) == [False, True]


def test_an_object_that_was_put_there_only_after_its_step_was_not_put_by_it():
    stage = Stage().lift()
    late = put_then(stage)
    stage.watch(2.0).carry("coke", OVER_TABLE, ON_SHELF).let_go().watch()
    assert stage.results(PLACED, late) == [True, False]


def test_a_placement_of_one_round_does_not_count_for_the_next():
    stage = placed_stage().let_go().watch()
    first, second = put_then(stage), replace(PLACED, began_s=stage.time, ended_s=stage.time + 2.0)
    assert stage.watch(3.0).results(first, second) == [True, False]


def test_an_object_that_comes_to_rest_just_after_its_step_was_put_by_it():
    stage = placed_stage().let_go()
    put = put_then(stage)
    assert stage.watch().holds(put)


def test_a_grasped_object_must_be_held_at_the_end_of_its_step():
    stage = Stage().lift()
    held = replace(GRASPED, when=When.END_OF_STEP, ended_s=stage.time)
    stage.let_go().fall("coke", OVER_TABLE, ON_TABLE).watch(2.0)
    now, at_last = replace(held, ended_s=stage.time), replace(held, when=When.END_OF_MISSION)
    assert stage.results(held, now, at_last) == [True, False, False]


def test_an_always_held_object_is_never_released():
    stage = Stage().lift().watch(2.0)
    always = GoalCondition(GoalKind.GRASPED, when=When.ALWAYS, began_s=1.5, ended_s=stage.time)
    assert stage.holds(always)
    stage.let_go().fall("coke", OVER_TABLE, ON_TABLE).lift()
    assert stage.results(always, replace(always, ended_s=stage.time)) == [True, False]


def moved(stage, name, p_WO):
    """Somebody puts an object elsewhere."""
    stage.put(name, p_WO).referee.record_move(name, stage.context, stage.time)
    return stage.watch()


def test_an_object_put_there_by_a_person_was_not_placed_by_the_robot():
    stage = placed_stage().let_go().watch()
    assert not moved(moved(stage, "coke", ON_TABLE), "coke", ON_SHELF).holds(PLACED)


def test_an_object_moved_down_by_a_person_is_neither_dropped_nor_knocked():
    referee = moved(Stage(), "coke", (0.0, 0.0, HALF - TOUCH)).referee
    assert (referee.drops, referee.events) == (0, ("Somebody moved the coke at 0.50 s.",))


def test_a_placement_counts_when_a_person_takes_the_object_away_later():
    stage = placed_stage().let_go().watch()
    put = put_then(stage, (stage.time, stage.time + 9.0))
    moved(stage.watch(2.0), "coke", ON_TABLE)
    assert not stage.holds(put) and stage.lift("coke", ON_TABLE).holds(put)


def released_above_floor(height_m):
    floor, low = (0.0, 0.0, HALF - TOUCH), (0.0, 0.0, HALF - TOUCH + height_m)
    return Stage().lift().carry("coke", OVER_TABLE, low).watch().let_go().fall("coke", low, floor).watch()


def released_above_shelf():
    above = np.add(ON_SHELF, (0, 0, 0.03))
    return placed_stage().carry("coke", ON_SHELF, above).let_go().fall("coke", above, ON_SHELF)


@pytest.mark.parametrize(
    ("act", "drops", "event"),
    [
        pytest.param(
            lambda: Stage().lift().let_go().fall("coke", OVER_TABLE, ON_TABLE), 1, "let the coke fall", id="slips"
        ),
        pytest.param(lambda: released_above_floor(0.0), 0, "", id="set down on the floor"),
        pytest.param(lambda: released_above_floor(0.03), 1, "let the coke fall", id="let go of above the floor"),
        pytest.param(released_above_shelf, 0, "", id="let go of low above a surface"),
        pytest.param(
            lambda: Stage().fall("coke", (1.5, 1.0, TABLE_Z), (1.5, 1.0, HALF - TOUCH)), 0, "knocked down", id="knocked"
        ),
    ],
)
def test_an_object_that_falls_from_the_gripper_is_dropped(act, drops, event):
    referee = act().referee
    assert (referee.drops, any(event in each for each in (*referee.events, ""))) == (drops, True), referee.events


def test_an_object_thrown_into_the_bin_is_placed_and_not_dropped():
    low, over = (-1.5, 1.0, HALF - TOUCH), (-1.5, 1.0, 0.6)
    inside = replace(PLACED, goal=(square("bin", -1.5, 1.0, z_min_m=0.0, z_max_m=0.4, is_bin=True),))
    verdict = Stage().lift().carry("coke", OVER_TABLE, over).let_go().fall("coke", over, low).referee.judge([inside])
    assert (verdict.success, verdict.drops) == (True, 0), verdict.why
    assert "The coke rests in the bin." in verdict.why
    missed = Stage().lift().let_go().fall("coke", OVER_TABLE, (1.5, 1.0, HALF - TOUCH)).referee.judge([inside])
    assert (missed.success, missed.drops, "not resting in the bin" in missed.why) == (False, 1, True)


def test_flickering_contact_of_a_held_object_is_no_drop():
    stage = Stage().lift()
    for _ in range(5):
        stage.let_go().watch(0.05).hold("coke", OVER_TABLE).watch(0.1)
    assert (stage.referee.drops, stage.holds(GRASPED)) == (0, True)


def test_lasting_contact_with_a_wall_is_one_collision():
    (collision,) = Stage().put("body", (4.86, 0, 0.6)).watch(2.0).referee.collisions
    assert (collision.part, "hit the wall" in collision.sentence) == (Kind.BODY, True), collision.sentence


def test_contact_that_comes_back_after_half_a_second_is_another_collision():
    stage = Stage()
    for pause in (0.2, 1.0, 0.2):
        stage.put("body", (4.86, 0, 0.6)).watch(0.2).put("body", (3, 0, 0.6)).watch(pause)
    assert len(stage.referee.collisions) == stage.referee.judge([]).collisions == 2


@pytest.mark.parametrize("link", ["body", "arm_sh0", "arm_wr1", "fl_lleg"])
def test_every_part_that_touches_the_person_collides(link):
    stage = Stage().put(link, (0, 3 - 0.2 - (0.009 if link.startswith("arm") else 0.049), 0.9)).watch()
    (collision,) = stage.referee.collisions
    assert "robin" in collision.sentence


def blame(stage):
    """Collisions, people whom the robot hit, and people who walked into it."""
    verdict = stage.referee.judge([])
    return verdict.collisions, verdict.people_hit, verdict.hit_by_people


def test_contacts_with_one_person_count_once_and_a_standing_robot_causes_none():
    stage = Stage().put("body", (0, 3 - 0.2 - 0.049, 0.9)).put("fl_lleg", (0, 3 + 0.2 + 0.049, 0.9)).watch()
    assert blame(stage) == (0, 0, 1) and "robin walked into alice's" in stage.referee.events[0]


@pytest.mark.parametrize(("speed", "hit"), [(0.3, 1), (0.04, 0)])
def test_a_robot_that_moved_before_it_touched_a_person_caused_it(speed, hit):
    stage, velocity = Stage(), SpatialVelocity([0, 0, 0], [0, speed, 0])
    stage.plant.SetFreeBodySpatialVelocity(context=stage.context, body=stage.bodies["body"], V_JpJc=velocity)
    assert blame(stage.watch(0.3).put("body", (0, 3 - 0.2 - 0.049, 0.9)).watch()) == (hit, hit, 1 - hit)


@pytest.fixture
def truth_of(monkeypatch):
    """Returns the truth by which a referee judges."""
    monkeypatch.setattr("plant.referee.referee.judge", lambda conditions, truth, collisions: truth)
    return lambda referee: referee.judge([])


def hand_turned():
    """A hand that moves at 0.5 s and turns at 1 s."""
    stage = Stage().put("arm_wr1", (1.0, 2.0, 0.7)).watch()
    X_WH = RigidTransform(RollPitchYaw(1.2, 0.0, 0.4), [1.0, 2.0, 0.7])
    stage.plant.SetFloatingBaseBodyPoseInWorldFrame(stage.context, stage.bodies["arm_wr1"], X_WH)
    return stage.watch(), X_WH


def test_the_truth_has_the_pose_of_the_hand_at_any_time(truth_of):
    stage, X_WH = hand_turned()
    hand = truth_of(stage.referee).hands["alice"]
    assert hand.pose_at(0.9).IsNearlyEqualTo(RigidTransform([1.0, 2.0, 0.7]), 1e-9)
    assert hand.pose_at(1.1).IsNearlyEqualTo(X_WH, 1e-9)
    assert len(hand.positions.points) == 3


def test_poses_of_the_hand_outlive_a_restart(truth_of):
    (stage, X_WH), other = hand_turned(), Stage()
    paths = {name: np.array(stage.referee.points(name)) for name in stage.referee.names}
    other.referee.resume(stage.referee.state(), paths)
    assert truth_of(other.referee).hands["alice"].pose_at(1.1).IsNearlyEqualTo(X_WH, 1e-9)


def test_contacts_with_people_outlive_a_restart():
    stage, other = Stage().put("body", (0, 3 - 0.2 - 0.049, 0.9)).watch(), Stage()
    other.referee.resume(stage.referee.state(), {"alice": np.array(stage.referee.points("alice"))})
    assert other.referee.collisions == stage.referee.collisions


@pytest.mark.parametrize(
    ("act", "collisions"),
    [
        pytest.param(lambda: Stage().put("fl_lleg", (0, 0, 0.049)).lift(), 0, id="foot on floor, hand on object"),
        pytest.param(placed_stage, 0, id="held object on furniture"),
        pytest.param(lambda: Stage().put("body", (0, 0, 1.0)).put("arm_sh0", (0, 0, 1.059)).watch(), 0, id="own links"),
        pytest.param(lambda: Stage().put("fl_lleg", (1.5, 0.3, TABLE_Z + 0.049)).watch(), 1, id="leg on a table"),
        pytest.param(lambda: Stage().put("body", (0, 0, 0.049)).watch(), 1, id="body on the floor"),
    ],
)
def test_a_contact_that_the_robot_should_not_make_is_a_collision(act, collisions):
    assert len(act().referee.collisions) == collisions


def test_went_is_judged_where_the_body_is_at_the_end():
    kitchen, hall = square("kitchen", 2.0, -3.0), square("hall", -3.0, -3.0)
    to_kitchen, to_hall = (GoalCondition(GoalKind.WENT, goal=(place,), robot="alice") for place in (kitchen, hall))
    stage = Stage().put("body", (2.0, -3.0, 0.5)).watch()
    early = {"when": When.END_OF_STEP, "ended_s": 0.4}
    assert stage.results(to_kitchen, replace(to_kitchen, **early), to_hall) == [True, False, False]
    assert stage.holds(replace(to_hall, **early), to_kitchen)
    assert stage.results(*(replace(to_kitchen, when=each) for each in (When.SOME_TIME, When.ALWAYS))) == [True, False]
    assert "(2.00, -3.00), not at the hall" in stage.referee.judge([to_hall]).why


# where the body is  -> holds now, and as a step that another one follows
@pytest.mark.parametrize(("place", "now"), [((1.0, 2.0, 0.5), True), ((3.0, -3.0, 0.5), False)])
def test_going_to_a_person_is_judged_by_the_distance_to_them(place, now):
    to_robin = GoalCondition(GoalKind.WENT, goal=(square("hall", 0.0, 0.0),), person="robin", robot="alice")
    stage = Stage().put("body", place).watch()
    assert stage.results(to_robin, replace(to_robin, person="eve")) == [now, False]
    then = replace(to_robin, when=When.END_OF_STEP, ended_s=stage.time - 0.1)
    assert stage.put("body", (-4.0, -4.0, 0.5)).watch().results(then, to_robin) == [now, False]


@pytest.mark.parametrize(("answer", "true_of"), [(True, TABLE), (False, SHELF)])
def test_answer_is_compared_with_the_truth(answer, true_of):
    asked = GoalCondition(GoalKind.ANSWERED, ("coke",), source=(true_of,))
    given = (answer, not answer, None)
    assert Stage().results(*(replace(asked, answer=each) for each in given)) == [True, False, False]


def test_an_answer_may_count_or_miss_what_lies_on_the_floor():
    floor = square("the floor", -4.0, 4.0, z_min_m=-0.05, z_max_m=0.3)
    yes, no = (
        GoalCondition(GoalKind.ANSWERED, ("coke",), source=(SHELF,), maybe=(floor,), answer=answer)
        for answer in (True, False)
    )
    wrong = replace(yes, maybe=()), replace(no, source=(TABLE,))
    assert Stage().results(yes, no, *wrong) == [True, True, False, False]


ROOM, OTHER = square("the kitchen", 0.0, 3.0, half=1.0), square("the hall", 4.0, 4.0)


# room   asked     count  truth  what is said of it
@pytest.mark.parametrize(
    ("room", "person", "count", "fact", "told"),
    [
        (ROOM, None, 1, True, "robin is in the kitchen"),
        (ROOM, "robin", 1, True, "robin is in the kitchen"),
        (ROOM, None, 2, False, "robin is in the kitchen"),
        (OTHER, None, 1, False, "nobody is in the hall"),
        (OTHER, "robin", 1, False, "robin is not in the hall"),
    ],
)
def test_an_answer_about_people_is_judged_by_where_they_stand(room, person, count, fact, told):
    stage = Stage().watch()
    asked = GoalCondition(GoalKind.ANSWERED, ("person",), count, (room,), person=person)
    for answer, right in ((fact, True), (not fact, False), (None, False)):
        verdict = stage.referee.judge([replace(asked, answer=answer)])
        assert (verdict.success, told in verdict.why) == (right, True)


# room, answer to whether nobody is in it -> right
@pytest.mark.parametrize(
    ("room", "answer", "right"), [(ROOM, False, True), (ROOM, True, False), (OTHER, True, True), (OTHER, False, False)]
)
def test_the_referee_says_the_negated_question_that_it_judges(room, answer, right):
    question = f"is nobody in {room.name}"
    asked = GoalCondition(
        GoalKind.ANSWERED, ("person",), source=(room,), question=question, answer=answer, negated=True
    )
    who = "robin" if room is ROOM else "nobody"
    said = f'The answer to "{question}" was {"yes" if answer else "no"}, and {who} is in {room.name}.'
    verdict = Stage().watch().referee.judge([asked])
    assert (verdict.success, verdict.why) == (right, said)


# answer to how many, at least so many -> right where one person stands in the kitchen
@pytest.mark.parametrize(
    ("answer", "at_least", "right"),
    [(1, False, True), (0, False, False), (2, False, False), (1, True, True), (0, True, True), (2, True, False)],
)
def test_the_referee_judges_the_number_of_a_count(answer, at_least, right):
    asked = GoalCondition(GoalKind.ANSWERED, ("person",), 0, (ROOM,), answer=answer, at_least=at_least)
    verdict = Stage().watch().referee.judge([asked])
    assert verdict.success is right
    assert verdict.why == f"The answer was {'at least ' * at_least}{answer}, and robin is in the kitchen."


# objects on the table and on the floor below -> numbers that are right
@pytest.mark.parametrize(("source", "maybe", "right"), [((TABLE,), (), {1}), ((SHELF,), (TABLE,), {0, 1})])
def test_the_referee_judges_the_number_of_objects(source, maybe, right):
    asked = GoalCondition(GoalKind.ANSWERED, ("coke",), 0, source, maybe=maybe)
    answers = [replace(asked, answer=number) for number in range(3)]
    assert {number for number, holds in enumerate(Stage().results(*answers)) if holds} == right


LEFT_AT_10_S = TimedPath(np.array([[0.0, 3.0, 0.0, 0.0], [4.0, 4.0, 0.0, 10.0]]))
"""A person who is in the kitchen for 10 s, and then in the hall."""


# begin and end of the look at the kitchen (s) -> answers that are right, given at 30 s
@pytest.mark.parametrize(
    ("looked_s", "right"),
    [((2.0, 8.0), {"1", "True"}), ((12.0, 20.0), {"0", "False"}), ((8.0, 12.0), {"0", "1", "False", "True"})],
)
def test_the_referee_judges_an_answer_by_the_looks_that_it_rests_on(looked_s, right):
    truth = Truth(40.0, (), {}, {"robin": LEFT_AT_10_S}, {})
    looks = (("the kitchen", *looked_s), ("the hall", 25.0, 29.0))
    asked = GoalCondition(GoalKind.ANSWERED, ("person",), source=(ROOM,), answered_s=30.0, looked_s=looks)
    answers = (0, 1, 2, False, True)
    assert {
        str(each) for each in answers if judge([replace(asked, answer=each)], truth, collisions=()).success
    } == right


def test_a_person_who_walks_from_one_look_to_the_next_is_one_person():
    truth = Truth(40.0, (), {}, {"robin": LEFT_AT_10_S}, {})
    looks = (("the kitchen", 0.0, 5.0), ("the hall", 15.0, 20.0))
    asked = GoalCondition(GoalKind.ANSWERED, ("person",), 0, (ROOM, OTHER), answered_s=30.0, looked_s=looks)
    right = [judge([replace(asked, answer=each)], truth, collisions=()).success for each in (0, 1, 2)]
    assert right == [False, True, False]


DOORWAY = square("door between hall and kitchen", 2.5, 0.0, half=0.3)
OPENS_AND_CLOSES = ((0.0, 1.0), (10.0, 0.5), (12.0, 0.0), (20.0, 0.5), (22.0, 1.0))


DOOR_TRUTH = Truth(40.0, (), {"alice": TimedPath(np.zeros((0, 4)))}, {}, {}, {(2.5, 0.0): OPENS_AND_CLOSES})
BOTH = {True, False}


# When the answer was given (s), after how the door was -> the answers that are right
@pytest.mark.parametrize(
    ("answered_s", "right"), [(5.0, {False}), (11.0, BOTH), (13.0, BOTH), (15.0, {True}), (21.0, BOTH), (30.0, {False})]
)
def test_an_answer_about_a_door_is_judged_by_how_it_was_while_the_robot_looked(answered_s, right):
    asked = GoalCondition(GoalKind.DOOR_OPEN, source=(DOORWAY,), answered_s=answered_s)
    answers = (True, False, None)
    judged = {each: judge([replace(asked, answer=each)], DOOR_TRUTH, collisions=()).success for each in answers}
    assert {answer for answer, success in judged.items() if success} == right
    shut = replace(asked, negated=True)
    judged = {each: judge([replace(shut, answer=each)], DOOR_TRUTH, collisions=()).success for each in answers}
    assert {not answer for answer, success in judged.items() if success} == right


@pytest.mark.parametrize(("ended_s", "opened"), [(5.0, False), (15.0, True), (30.0, False)])
def test_a_door_is_opened_when_it_is_open_at_the_end_of_the_step(ended_s, opened):
    asked = GoalCondition(GoalKind.DOOR_OPENED, source=(DOORWAY,), began_s=0.0, ended_s=ended_s)
    assert judge([asked], DOOR_TRUTH, collisions=()).success is opened


def test_a_door_that_never_moves_is_open():
    stage, asked = Stage().watch(), GoalCondition(GoalKind.DOOR_OPEN, source=(DOORWAY,), answer=True)
    said = "The answer was no, and the door between hall and kitchen was open."
    assert (stage.holds(asked), stage.verdict(replace(asked, answer=False))) == (True, (False, said))


def test_the_path_is_recorded():
    stage = Stage()
    for x in np.linspace(0, 1, 21):
        stage.put("body", (x, 0, 0.5)).watch(0.05)
    path = stage.referee.path("alice")
    assert (len(path), list(path[-1])) == (22, pytest.approx([1, 0, 0.5]))


@pytest.mark.parametrize(("name", "robot", "said"), [("coke", "eve", "'eve'"), ("cup", "alice", "'cup'")])
def test_unknown_robot_and_object_are_refused_by_name(name, robot, said):
    with pytest.raises(ValueError, match=said):
        Referee(Stage().plant, [Placement(name, name)], robots={robot: SPOT})


def test_judging_before_looking_is_refused():
    with pytest.raises(ValueError, match="not observed"):
        Referee(Stage().plant, [Placement("coke", "coke")], robots={"alice": SPOT}).judge([])


def test_region_with_a_notch_knows_its_inside():
    region = Region("L", ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)), 0.0, 1.0)
    points = {(0.5, 1.5, 0.5): True, (1.5, 0.5, 0.5): True, (1.5, 1.5, 0.5): False, (0.5, 0.5, 1.5): False}
    assert {point: region.contains(point) for point in points} == points


def test_impossible_region_is_refused():
    with pytest.raises(ValueError, match="'nook'"):
        Region("nook", ((0, 0), (1, 0)))


def test_a_look_is_cheap():
    stage = Stage().lift()
    stage.watch(0.05)
    times = []
    for _ in range(20):
        start = time.perf_counter()
        stage.watch(0.05)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.001


def put_away():
    return placed_stage().let_go().watch()


LEFT = GoalCondition(GoalKind.CLEARED, source=(TABLE,))
THERE = GoalCondition(GoalKind.CLEARED, source=(TABLE,), goal=(SHELF,))


@pytest.mark.parametrize(
    ("act", "source", "success", "why"),
    [
        (put_away, TABLE, True, "Nothing is left on the table. The coke stands on the shelf."),
        (Stage, TABLE, False, "The coke is left on the table. The coke does not stand on the shelf."),
        (Stage, square("the bench", 6.0, 6.0), True, "Nothing stood on the bench."),
    ],
)
def test_a_table_is_cleared_when_all_that_stood_there_rests_on_the_other(act, source, success, why):
    there = replace(THERE, source=(source,))
    assert act().verdict(*[LEFT] * (source is TABLE), there) == (success, why)


def test_a_fallen_object_is_missing_and_not_left():
    assert Stage().fall("coke", (1.5, 1.0, TABLE_Z), (1.5, 1.0, HALF - TOUCH)).results(LEFT, THERE) == [True, False]


def test_an_object_in_the_gripper_does_not_stand_there():
    assert not placed_stage().watch().holds(THERE)


def since_now(stage, *conditions):
    return [replace(condition, since_s=stage.time) for condition in conditions]


def test_lifts_and_placements_of_the_first_mission_do_not_count_for_the_second():
    stage = Stage().lift().carry("coke", OVER_TABLE, ON_SHELF).let_go().watch()
    assert stage.holds(GRASPED, PLACED)
    second = since_now(stage.watch(0.1), GRASPED, PLACED)
    assert stage.results(*second) == [False, False]
    stage.lift("coke", ON_SHELF).carry("coke", np.add(ON_SHELF, (0, 0, 0.3)), ON_SHELF).let_go().watch()
    assert stage.results(*second) == [False, True]  # it was not on the table any more


AT_GATE = GoalCondition(GoalKind.WENT, goal=(square("the gate", 0.0, 0.0),), when=When.SOME_TIME)


def test_hand_overs_and_visits_of_the_first_mission_do_not_count_for_the_second():
    stage = given().watch()
    assert stage.results(HANDED, *since_now(stage, HANDED)) == [True, False]
    stage.put("body", (0, 0, 0.6)).watch(0.1).put("body", (-3, -3, 0.6)).watch(0.1)
    assert stage.results(AT_GATE, *since_now(stage, AT_GATE)) == [True, False]


def test_the_start_of_a_mission_counts_as_a_passed_place():
    stage = Stage().put("body", (0, 0, 0.6)).watch(1.0)
    began = since_now(stage, AT_GATE)
    assert stage.put("body", (-3, -3, 0.6)).watch(0.1).holds(*began)


def test_bumps_and_drops_before_a_mission_are_not_its_own():
    stage = given().watch(0.1).fall("coke", ON_TRAY, (0.6, 2.4, HALF - TOUCH))
    assert [stage.referee.judge(each).drops for each in ([GRASPED], since_now(stage, GRASPED))] == [1, 0]


HAMMER = Landmark("hammer", classes=("hammer",))
SEEN_TABLE, SEEN_SHELF = (
    replace(region, viewer=Pose2D(0.0, 0.0, yaw)) for region, yaw in ((TABLE, 0.0), (SHELF, math.pi))
)


def stage_with_two_cokes():
    """A coke right of the hammer and one left of it on the table, as seen from the origin."""
    stage = Stage().put("hammer", np.add(ON_TABLE, (0, 0.2, 0))).put("coke_2", np.add(ON_TABLE, (0, 0.4, 0)))
    return stage.watch()


@pytest.mark.parametrize(
    ("relation", "holds"),
    [
        (Relation(RelationKind.RIGHT_OF, (HAMMER,)), True),
        (Relation(RelationKind.LEFT_OF, (HAMMER,)), False),
        (Relation(RelationKind.RIGHT), True),
        (Relation(RelationKind.LEFT, nth=2), True),
        (Relation(RelationKind.LEFT), False),
    ],
    ids=str,
)
def test_the_lifted_object_is_judged_by_its_relations_before_the_lift(relation, holds):
    stage = stage_with_two_cokes().lift()
    meant = replace(GRASPED, source=(SEEN_TABLE,), relations=(relation,))
    assert stage.results(GRASPED, meant) == [True, holds]


@pytest.mark.parametrize(
    ("y_m", "kind", "holds"),
    [
        (0.2, RelationKind.NEXT_TO, True),
        (0.2, RelationKind.RIGHT_OF, True),
        (0.2, RelationKind.LEFT_OF, False),
        (0.29, RelationKind.NEXT_TO, True),  # within the tolerance
        (0.4, RelationKind.NEXT_TO, False),
    ],
)
def test_a_placed_object_is_judged_by_where_it_rests(y_m, kind, holds):
    at = (-1.5, y_m, TABLE_Z + HALF - TOUCH)
    stage = Stage().lift().carry("coke", OVER_TABLE, at).let_go().watch()
    success, why = stage.verdict(replace(PLACED, goal=(SEEN_SHELF,), relations=(Relation(kind, (HAMMER,)),)))
    assert success is holds, why
    assert holds or f"the coke was put on the shelf, but not {kind.value} the hammer" in why.lower()


@pytest.mark.parametrize(("kind", "count", "right"), [("LEFT_OF", 1, True), ("BEHIND", 1, False), ("NEXT_TO", 2, True)])
def test_an_answer_is_judged_by_the_objects_that_are_meant(kind, count, right):
    meant = (Relation(RelationKind[kind], (HAMMER,)),)
    asked = GoalCondition(GoalKind.ANSWERED, ("coke",), count, (SEEN_TABLE,), answer=True, relations=meant)
    assert stage_with_two_cokes().holds(asked) is right
