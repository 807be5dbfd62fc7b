"""The referee records the true events and judges goal conditions by them."""

import dataclasses
import time

import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from executive.words.goal import GoalCondition, GoalKind, Region, When
from plant.referee import Referee
from plant.referee.entities import Kind
from plant.referee.judge import judge
from plant.referee.object_history import TimedPath, Truth
from plant.robots.spot.kind import SPOT

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


@dataclasses.dataclass(frozen=True)
class Placement:
    name: str
    class_name: str


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

    def verdict(self, *conditions):
        """Whether the conditions hold, and why."""
        report = self.referee.judge(conditions)
        return report.success, report.why


GRASPED = GoalCondition(GoalKind.GRASPED, ("coke", "beer"), source=(TABLE,), when=When.SOME_TIME)
HANDED = GoalCondition(GoalKind.HANDED_OVER, ("coke",), person="robin")
PLACED = GoalCondition(GoalKind.PLACED, ("coke",), goal=(SHELF,))
ON_SHELF = (-1.5, 0.3, TABLE_Z + HALF - TOUCH)


def test_lifted_object_counts_as_grasped_even_after_it_was_put_down():
    stage = Stage().lift()
    assert stage.holds(GRASPED)
    assert stage.carry("coke", OVER_TABLE, ON_SHELF).let_go().watch().holds(GRASPED)


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
    assert not success
    assert "coke or beer was lifted from the table" in why


def pushed(by):
    return Stage().hold("coke", ON_TABLE).watch(0.3).carry("coke", ON_TABLE, np.add(ON_TABLE, by))


def test_an_object_moved_low_but_far_away_is_grasped():
    stage, barely = pushed((0, 0, 0.015)), np.add(ON_TABLE, (0, 0, 0.015))
    assert not stage.holds(GRASPED)
    assert stage.carry("coke", barely, np.add(barely, (-1.0, 0, 0))).holds(GRASPED)


def test_object_from_elsewhere_or_of_another_class_is_not_grasped():
    hammer = GoalCondition(GoalKind.GRASPED, ("hammer",), source=(TABLE,))
    stage = Stage().lift("hammer", (-1.5, 0, TABLE_Z + HALF - TOUCH))
    held = [stage.holds(each) for each in (hammer, GRASPED, dataclasses.replace(hammer, source=()))]
    assert held == [False, False, True]


def test_count_asks_for_as_many_objects():
    two, stage = dataclasses.replace(GRASPED, count=2, source=()), Stage().lift()
    success, why = stage.verdict(two)
    assert not success and "1 of 2" in why
    stage.let_go().put("coke", ON_TABLE).watch().lift("coke_2", (-4, 4, HALF - TOUCH))
    assert stage.holds(two)


def test_only_the_source_that_it_was_lifted_from_is_named():
    _, why = Stage().lift().verdict(dataclasses.replace(GRASPED, source=(SHELF, TABLE)))
    assert TABLE.name in why and SHELF.name not in why


def test_no_condition_is_not_judged():
    assert Stage().referee.judge([]).success is None


def given():
    """The coke is carried to robin, let go, and sinks by 2 cm onto the tray."""
    above = np.add(ON_TRAY, (0, 0, 0.02))
    return Stage().lift().carry("coke", OVER_TABLE, above).let_go().put("coke", ON_TRAY)


def test_let_go_and_at_rest_on_the_persons_tray_is_handed_over():
    verdict = given().watch().referee.judge([GRASPED, HANDED])
    assert verdict.success, verdict.why
    assert "The coke rests on robin's tray." in verdict.why
    assert verdict.drops == 0


def test_an_object_that_falls_off_the_tray_is_dropped_but_not_one_that_tips():
    stage = given().watch(0.1)
    assert stage.put("coke", np.subtract(ON_TRAY, (0, 0, TOUCH))).watch().referee.drops == 0
    stage = given().watch(0.1).fall("coke", ON_TRAY, (0.6, 2.4, HALF - TOUCH))
    verdict = stage.referee.judge([HANDED])
    assert (verdict.success, verdict.drops) == (False, 1)
    assert "not on the tray" in verdict.why


def test_taken_from_the_tray_again_it_was_handed_over():
    stage = given().watch()
    given_s = stage.time
    stage.hold("coke", np.add(ON_TRAY, (0, 0, 0.2))).watch()
    assert not stage.holds(HANDED)
    passing = stage.referee.judge([dataclasses.replace(HANDED, when=When.END_OF_STEP, ended_s=given_s)])
    assert passing.success
    assert "The coke was put on robin's tray." in passing.why


@pytest.mark.parametrize("end", [(0.0, 2.4, 0.9), (0.0, 2.4, 0.3)])
def test_an_object_that_is_never_released_is_not_handed_over(end):
    success, why = Stage().lift().carry("coke", OVER_TABLE, np.add(end, (0.5, 0, 0))).verdict(HANDED)
    assert not success
    assert f"is still in the gripper, {end[2]:.2f} m high, 0.78 m from robin" in why


def test_pressed_against_the_person_is_no_hand_over():
    end = (0.0, 3 - 0.2 - HALF + TOUCH, 0.9)
    assert not Stage().lift().carry("coke", OVER_TABLE, end).holds(HANDED)


def test_object_let_go_near_the_person_is_no_hand_over():
    stage = Stage().lift().carry("coke", OVER_TABLE, ON_TRAY).let_go()
    stage.fall("coke", ON_TRAY, (0.0, 2.4, HALF - TOUCH))
    verdict = stage.referee.judge([GRASPED, HANDED])
    assert (verdict.success, verdict.drops) == (False, 1)


def test_a_hand_over_from_another_source_does_not_count():
    stage = given().watch()
    assert not stage.holds(dataclasses.replace(HANDED, source=(SHELF,)))
    assert stage.holds(dataclasses.replace(HANDED, source=(TABLE,)))


def test_unknown_person_is_said():
    success, why = Stage().verdict(dataclasses.replace(HANDED, person="eve"))
    assert not success and "no person eve" in why


def placed_stage():
    stage = Stage().lift().carry("coke", OVER_TABLE, np.add(ON_SHELF, (0, 0, 0.2)))
    return stage.carry("coke", np.add(ON_SHELF, (0, 0, 0.2)), ON_SHELF)


def test_put_down_and_let_go_is_placed():
    stage = placed_stage().let_go().watch()
    assert stage.holds(GRASPED, PLACED)
    assert stage.referee.drops == 0
    success, why = stage.verdict(dataclasses.replace(PLACED, goal=(TABLE,)))
    assert not success and "not resting on the table" in why


def test_an_object_in_the_gripper_or_in_the_goal_from_the_start_is_not_placed():
    assert not placed_stage().watch().holds(PLACED)
    assert not Stage().watch().holds(GoalCondition(GoalKind.PLACED, ("hammer",), goal=(SHELF,)))


def put_then(stage, *taken_s):
    """That the coke was put on the shelf until now, from where later steps take it again in such times."""
    return dataclasses.replace(PLACED, ended_s=stage.time, taken_s=taken_s)


def test_an_object_must_stay_where_it_was_put_until_a_later_step_takes_it():
    stage = placed_stage().let_go().watch()
    put = put_then(stage)
    assert stage.holds(put)
    taken = dataclasses.replace(put, taken_s=((stage.time, stage.time + 9.0),))
    stage.watch(2.0).lift("coke", ON_SHELF)
    assert not stage.holds(put)
    assert stage.holds(taken)
    assert stage.holds(dataclasses.replace(put, when=When.END_OF_STEP))


def test_an_object_that_falls_after_its_step_is_missed_though_a_later_step_might_have_taken_it():
    stage = placed_stage().let_go().watch()
    put = put_then(stage, (stage.time, stage.time + 9.0))
    stage.watch(2.0).fall("coke", ON_SHELF, (-1.5, 0.6, HALF - TOUCH))
    assert not stage.holds(put)
    assert stage.holds(dataclasses.replace(put, when=When.END_OF_STEP))


def test_an_object_that_was_put_there_only_after_its_step_was_not_put_by_it():
    stage = Stage().lift()
    late = put_then(stage)
    stage.watch(2.0).carry("coke", OVER_TABLE, ON_SHELF).let_go().watch()
    assert stage.holds(PLACED)
    assert not stage.holds(late)


def test_a_placement_of_one_round_does_not_count_for_the_next():
    stage = placed_stage().let_go().watch()
    first = put_then(stage)
    second = dataclasses.replace(PLACED, began_s=stage.time, ended_s=stage.time + 2.0)
    stage.watch(3.0)
    assert stage.holds(first)
    assert not stage.holds(second)


def test_an_object_that_comes_to_rest_just_after_its_step_was_put_by_it():
    stage = placed_stage().let_go()
    put = put_then(stage)
    assert stage.watch().holds(put)


def test_a_grasped_object_must_be_held_at_the_end_of_its_step():
    stage = Stage().lift()
    held = dataclasses.replace(GRASPED, when=When.END_OF_STEP, ended_s=stage.time)
    stage.let_go().fall("coke", OVER_TABLE, ON_TABLE).watch(2.0)
    assert stage.holds(held)
    assert not stage.holds(dataclasses.replace(held, ended_s=stage.time))
    assert not stage.holds(dataclasses.replace(held, when=When.END_OF_MISSION))


def test_an_always_held_object_is_never_released():
    stage = Stage().lift().watch(2.0)
    always = GoalCondition(GoalKind.GRASPED, when=When.ALWAYS, began_s=1.5, ended_s=stage.time)
    assert stage.holds(always)
    stage.let_go().fall("coke", OVER_TABLE, ON_TABLE).lift()
    assert stage.holds(always)
    assert not stage.holds(dataclasses.replace(always, ended_s=stage.time))


def moved(stage, name, p_WO):
    """Somebody puts an object elsewhere."""
    stage.put(name, p_WO).referee.record_move(name, stage.context, stage.time)
    return stage.watch()


def test_an_object_put_there_by_a_person_was_not_placed_by_the_robot():
    stage = placed_stage().let_go().watch()
    assert not moved(moved(stage, "coke", ON_TABLE), "coke", ON_SHELF).holds(PLACED)


def test_an_object_moved_down_by_a_person_is_neither_dropped_nor_knocked():
    stage = moved(Stage(), "coke", (0.0, 0.0, HALF - TOUCH))
    assert stage.referee.drops == 0
    assert stage.referee.events == ("Somebody moved the coke at 0.50 s.",)


def test_a_placement_counts_when_a_person_takes_the_object_away_later():
    stage = placed_stage().let_go().watch()
    put = put_then(stage, (stage.time, stage.time + 9.0))
    moved(stage.watch(2.0), "coke", ON_TABLE)
    assert not stage.holds(put)
    assert stage.lift("coke", ON_TABLE).holds(put)


def test_slipping_out_of_the_gripper_is_one_drop():
    stage = Stage().lift()
    stage.let_go().fall("coke", OVER_TABLE, ON_TABLE)
    assert stage.referee.drops == 1
    assert any("dropped the coke" in event for event in stage.referee.events)


@pytest.mark.parametrize(("over_floor_m", "drops"), [(0.0, 0), (0.03, 1)])
def test_an_object_set_down_on_the_floor_is_no_drop_and_one_let_go_of_above_it_is(over_floor_m, drops):
    floor = (0.0, 0.0, HALF - TOUCH)
    low = np.add(floor, (0, 0, over_floor_m))
    stage = Stage().lift().carry("coke", OVER_TABLE, low).watch().let_go()
    assert stage.fall("coke", low, floor).watch().referee.drops == drops


def test_low_release_onto_a_surface_is_no_drop():
    above = np.add(ON_SHELF, (0, 0, 0.03))
    stage = placed_stage().carry("coke", ON_SHELF, above).let_go().fall("coke", above, ON_SHELF)
    assert stage.referee.drops == 0


def test_flickering_contact_of_a_held_object_is_no_drop():
    stage = Stage().lift()
    top = OVER_TABLE
    for _ in range(5):
        stage.let_go().watch(0.05).hold("coke", top).watch(0.1)
    assert stage.referee.drops == 0
    assert stage.holds(GRASPED)


def test_a_knocked_object_is_reported_but_no_drop():
    stage = Stage().fall("coke", (1.5, 1.0, TABLE_Z), (1.5, 1.0, HALF - TOUCH))
    assert stage.referee.drops == 0
    assert any("knocked down" in event for event in stage.referee.events)


def test_lasting_contact_with_a_wall_is_one_collision():
    stage = Stage().put("body", (4.86, 0, 0.6)).watch(2.0)
    assert stage.referee.judge([]).collisions == 1
    assert stage.referee.collisions[0].part is Kind.BODY
    assert "hit the wall" in stage.referee.collisions[0].sentence


def test_contact_that_comes_back_after_half_a_second_is_another_collision():
    stage = Stage()
    for pause in (0.2, 1.0, 0.2):
        stage.put("body", (4.86, 0, 0.6)).watch(0.2).put("body", (3, 0, 0.6)).watch(pause)
    assert len(stage.referee.collisions) == 2


@pytest.mark.parametrize("link", ["body", "arm_sh0", "arm_wr1", "fl_lleg"])
def test_every_part_that_touches_the_person_collides(link):
    stage = Stage().put(link, (0, 3 - 0.2 - (0.009 if link.startswith("arm") else 0.049), 0.9)).watch()
    assert len(stage.referee.collisions) == 1
    assert "robin" in stage.referee.collisions[0].sentence


def test_contacts_with_one_person_count_once_and_a_standing_robot_causes_none():
    stage = Stage().put("body", (0, 3 - 0.2 - 0.049, 0.9)).put("fl_lleg", (0, 3 + 0.2 + 0.049, 0.9)).watch()
    verdict = stage.referee.judge([])
    assert (verdict.collisions, verdict.people_hit, verdict.hit_by_people) == (0, 0, 1)
    assert "robin walked into alice's" in stage.referee.events[0]


@pytest.mark.parametrize(("speed", "hit"), [(0.3, 1), (0.04, 0)])
def test_a_robot_that_moved_before_it_touched_a_person_caused_it(speed, hit):
    stage = Stage()
    velocity = SpatialVelocity([0, 0, 0], [0, speed, 0])
    stage.plant.SetFreeBodySpatialVelocity(context=stage.context, body=stage.bodies["body"], V_JpJc=velocity)
    stage.watch(0.3).put("body", (0, 3 - 0.2 - 0.049, 0.9)).watch()
    verdict = stage.referee.judge([])
    assert (verdict.collisions, verdict.people_hit, verdict.hit_by_people) == (hit, hit, 1 - hit)


def test_contacts_with_people_outlive_a_restart():
    stage, other = Stage().put("body", (0, 3 - 0.2 - 0.049, 0.9)).watch(), Stage()
    other.referee.resume(stage.referee.state(), {"alice": np.array(stage.referee.points("alice"))})
    assert other.referee.collisions == stage.referee.collisions


@pytest.mark.parametrize(
    ("act", "collisions"),
    [
        pytest.param(
            lambda: Stage().put("fl_lleg", (0, 0, 0.049)).lift(), 0, id="foot on the floor, hand on an object"
        ),
        pytest.param(lambda: placed_stage(), 0, id="held object on furniture"),
        pytest.param(lambda: Stage().put("body", (0, 0, 1.0)).put("arm_sh0", (0, 0, 1.059)).watch(), 0, id="own links"),
        pytest.param(lambda: Stage().put("fl_lleg", (1.5, 0.3, TABLE_Z + 0.049)).watch(), 1, id="leg on a table"),
        pytest.param(lambda: Stage().put("body", (0, 0, 0.049)).watch(), 1, id="body on the floor"),
    ],
)
def test_a_contact_that_the_robot_should_not_make_is_a_collision(act, collisions):
    assert len(act().referee.collisions) == collisions


def test_went_is_judged_where_the_body_is_at_the_end():
    kitchen, hall = square("kitchen", 2.0, -3.0), square("hall", -3.0, -3.0)
    stage = Stage()
    to_kitchen, to_hall = (GoalCondition(GoalKind.WENT, goal=(place,), robot="alice") for place in (kitchen, hall))
    stage.put("body", (2.0, -3.0, 0.5)).watch()
    assert stage.holds(to_kitchen)
    assert not stage.holds(to_hall)
    assert stage.holds(dataclasses.replace(to_hall, when=When.END_OF_STEP, ended_s=0.4), to_kitchen)
    assert not stage.holds(dataclasses.replace(to_kitchen, when=When.END_OF_STEP, ended_s=0.4))
    assert stage.holds(dataclasses.replace(to_kitchen, when=When.SOME_TIME))
    assert not stage.holds(dataclasses.replace(to_kitchen, when=When.ALWAYS))
    assert "(2.00, -3.00), not at the hall" in stage.referee.judge([to_hall]).why


# where the body is  -> holds now, and as a step that another one follows
@pytest.mark.parametrize(("place", "now"), [((1.0, 2.0, 0.5), True), ((3.0, -3.0, 0.5), False)])
def test_going_to_a_person_is_judged_by_the_distance_to_them(place, now):
    stage, goal = Stage(), square("hall", 0.0, 0.0)
    to_robin = GoalCondition(GoalKind.WENT, goal=(goal,), person="robin", robot="alice")
    stage.put("body", place).watch()
    assert stage.holds(to_robin) is now
    assert not stage.holds(dataclasses.replace(to_robin, person="eve"))
    then_s = stage.time - 0.1
    stage.put("body", (-4.0, -4.0, 0.5)).watch()
    assert stage.holds(dataclasses.replace(to_robin, when=When.END_OF_STEP, ended_s=then_s)) is now
    assert not stage.holds(to_robin)


@pytest.mark.parametrize(("answer", "true_of"), [(True, TABLE), (False, SHELF)])
def test_answer_is_compared_with_the_truth(answer, true_of):
    stage = Stage()
    asked = GoalCondition(GoalKind.ANSWERED, ("coke",), source=(true_of,), answer=answer)
    assert stage.holds(asked)
    assert not stage.holds(dataclasses.replace(asked, answer=not answer))
    assert not stage.holds(dataclasses.replace(asked, answer=None))


def test_an_answer_may_count_or_miss_what_lies_on_the_floor():
    stage = Stage()
    floor = square("the floor", -4.0, 4.0, z_min_m=-0.05, z_max_m=0.3)
    asked = GoalCondition(GoalKind.ANSWERED, ("coke",), source=(SHELF,), maybe=(floor,))
    assert stage.holds(dataclasses.replace(asked, answer=True))
    assert stage.holds(dataclasses.replace(asked, answer=False))
    assert not stage.holds(dataclasses.replace(asked, answer=True, maybe=()))
    assert not stage.holds(dataclasses.replace(asked, answer=False, source=(TABLE,)))


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
        verdict = stage.referee.judge([dataclasses.replace(asked, answer=answer)])
        assert (verdict.success, told in verdict.why) == (right, True)


DOORWAY = square("door between hall and kitchen", 2.5, 0.0, half=0.3)
OPENS_AND_CLOSES = ((0.0, 1.0), (10.0, 0.5), (12.0, 0.0), (20.0, 0.5), (22.0, 1.0))


# When the answer was given (s), after how the door was -> the answers that are right
@pytest.mark.parametrize(
    ("answered_s", "right"),
    [
        (5.0, {False}),
        (11.0, {True, False}),
        (13.0, {True, False}),
        (15.0, {True}),
        (21.0, {True, False}),
        (30.0, {False}),
    ],
)
def test_an_answer_about_a_door_is_judged_by_how_it_was_while_the_robot_looked(answered_s, right):
    nothing = np.zeros((0, 4))
    truth = Truth(40.0, (), {"alice": TimedPath(nothing)}, {}, {}, {(2.5, 0.0): OPENS_AND_CLOSES})
    asked = GoalCondition(GoalKind.DOOR_OPEN, source=(DOORWAY,), answered_s=answered_s)
    told = {
        answer: judge([dataclasses.replace(asked, answer=answer)], truth, collisions=())
        for answer in (True, False, None)
    }
    assert {answer for answer, verdict in told.items() if verdict.success} == right


@pytest.mark.parametrize(("ended_s", "opened"), [(5.0, False), (15.0, True), (30.0, False)])
def test_a_door_is_opened_when_it_is_open_at_the_end_of_the_step(ended_s, opened):
    truth = Truth(40.0, (), {"alice": TimedPath(np.zeros((0, 4)))}, {}, {}, {(2.5, 0.0): OPENS_AND_CLOSES})
    asked = GoalCondition(GoalKind.DOOR_OPENED, source=(DOORWAY,), began_s=0.0, ended_s=ended_s)
    assert judge([asked], truth, collisions=()).success is opened


def test_a_door_that_never_moves_is_open():
    stage = Stage().watch()
    asked = GoalCondition(GoalKind.DOOR_OPEN, source=(DOORWAY,), answer=True)
    assert stage.holds(asked)
    said = "The answer was no, and the door between hall and kitchen was open."
    assert stage.verdict(dataclasses.replace(asked, answer=False)) == (False, said)


def test_the_path_is_recorded():
    stage = Stage()
    for x in np.linspace(0, 1, 21):
        stage.put("body", (x, 0, 0.5)).watch(0.05)
    path = stage.referee.path("alice")
    assert path[-1] == pytest.approx([1, 0, 0.5])
    assert len(path) == 22


def test_names_that_the_plant_lacks_and_judging_before_looking_are_refused():
    stage = Stage()
    for placements, robot, said in (
        (stage.placements, "eve", "'eve'"),
        ([Placement("cup", "cup")], "alice", "'cup'"),
        (stage.placements, "alice", "not observed"),
    ):
        with pytest.raises(ValueError, match=said):
            Referee(stage.plant, placements, robots={robot: SPOT}).judge([])


def test_impossible_region_is_refused():
    with pytest.raises(ValueError, match="'nook'"):
        Region("nook", ((0, 0), (1, 0)))


def test_region_with_a_notch_knows_its_inside():
    region = Region("L", ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)), 0.0, 1.0)
    points = {(0.5, 1.5, 0.5): True, (1.5, 0.5, 0.5): True, (1.5, 1.5, 0.5): False, (0.5, 0.5, 1.5): False}
    assert {point: region.contains(point) for point in points} == points


def test_a_look_is_cheap():
    stage = Stage().lift()
    stage.watch(0.05)
    times = []
    for _ in range(20):
        start = time.perf_counter()
        stage.watch(0.05)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.001


LEFT = GoalCondition(GoalKind.CLEARED, source=(TABLE,))
THERE = GoalCondition(GoalKind.CLEARED, source=(TABLE,), goal=(SHELF,))


@pytest.mark.parametrize(
    ("act", "source", "verdict"),
    [
        (
            lambda: placed_stage().let_go().watch(),
            TABLE,
            (True, "Nothing is left on the table. The coke stands on the shelf."),
        ),
        (Stage, TABLE, (False, "The coke is left on the table. The coke does not stand on the shelf.")),
        (Stage, square("the bench", 6.0, 6.0), (True, "Nothing stood on the bench.")),
    ],
)
def test_a_table_is_cleared_when_all_that_stood_there_rests_on_the_other(act, source, verdict):
    stage, there = act(), dataclasses.replace(THERE, source=(source,))
    assert stage.verdict(*[LEFT] * (source is TABLE), there) == verdict


def test_a_fallen_object_and_one_in_the_gripper_do_not_stand_there():
    stage = Stage().fall("coke", (1.5, 1.0, TABLE_Z), (1.5, 1.0, HALF - TOUCH))
    assert (stage.holds(LEFT), stage.holds(THERE)) == (True, False)
    assert not placed_stage().watch().holds(THERE)


def since_now(stage, *conditions):
    return [dataclasses.replace(condition, since_s=stage.time) for condition in conditions]


def test_lifts_and_placements_of_the_first_mission_do_not_count_for_the_second():
    stage = Stage().lift().carry("coke", OVER_TABLE, ON_SHELF).let_go().watch()
    assert stage.holds(GRASPED, PLACED)
    second = since_now(stage.watch(0.1), GRASPED, PLACED)
    assert not stage.holds(second[0])
    assert not stage.holds(second[1])
    stage.lift("coke", ON_SHELF).carry("coke", np.add(ON_SHELF, (0, 0, 0.3)), ON_SHELF).let_go().watch()
    assert stage.holds(second[1])
    assert not stage.holds(second[0])  # it was not on the table any more


def test_hand_overs_and_visits_of_the_first_mission_do_not_count_for_the_second():
    stage = given().watch()
    second = since_now(stage, HANDED)
    assert stage.holds(HANDED)
    assert not stage.holds(*second)
    there = GoalCondition(GoalKind.WENT, goal=(square("the gate", 0.0, 0.0),), when=When.SOME_TIME)
    stage.put("body", (0, 0, 0.6)).watch(0.1).put("body", (-3, -3, 0.6)).watch(0.1)
    assert stage.holds(there)
    assert not stage.holds(*since_now(stage, there))


def test_the_start_of_a_mission_counts_as_a_passed_place():
    stage = Stage().put("body", (0, 0, 0.6)).watch(1.0)
    there = GoalCondition(GoalKind.WENT, goal=(square("the gate", 0.0, 0.0),), when=When.SOME_TIME)
    began = since_now(stage, there)
    stage.put("body", (-3, -3, 0.6)).watch(0.1)
    assert stage.holds(*began)


def test_bumps_and_drops_before_a_mission_are_not_its_own():
    stage = given().watch(0.1).fall("coke", ON_TRAY, (0.6, 2.4, HALF - TOUCH))
    assert stage.referee.judge([GRASPED]).drops == 1
    assert stage.referee.judge(since_now(stage, GRASPED)).drops == 0
