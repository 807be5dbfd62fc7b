"""Recovery in compiled trees with skills that fail by their scripts: chosen by cause, bounded, without leaks."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from py_trees.common import Status

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.visitor import RunSettings
from executive.tree.board import FromBoard
from executive.tree.compiler import compile_mission
from executive.tree.goals import surfaces_to_search
from executive.tree.nodes.pick_up import FreePlace
from executive.tree.nodes.search import surfaces_elsewhere
from executive.words.command import parse_command
from executive.words.knowledge import load_knowledge
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.outlines import inside
from skills.api import Cause, Failed, ObjectKind, Succeeded
from skills.relations import Landmark, Relation, RelationKind
from skills.robot import Pose2D
from tests.executive.conftest import COKE
from tests.executive.tree.scripted import CAUSES, told
from tests.project import core_skills

GO = "Take [Nothing] to [hall] and do [Nothing] to [Nothing]"
COUNTER = "Take [Nothing] to [counter] and do [Nothing] to [Nothing]"
KITCHEN = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"
GRASP = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
FIND = "Take [Nothing] to [kitchen] and do [find] to [coke]"
PUT = "Take [coke] to [bedroom] and do [Nothing] to [Nothing]"
GIVE = "Take [coke] to [Robin] and do [Nothing] to [Nothing]"
NEAR, TAKEN = "detect approach", "approach grasp stow"


def held(skill):
    """The grasp works."""
    skill.context.robot._robot.holding = True
    return Succeeded("held", {"tried": (*skill.inputs.avoid, len(skill.inputs.avoid) + 1)})


@pytest.fixture
def fails(script):
    """Lets a skill fail with causes (their letters), then work; the list of the skill's inputs."""

    def let_fail(name, causes="", then=None):
        left, inputs = [CAUSES[letter] for letter in causes], []
        usual = then or (held if name == "grasp" else lambda skill: Succeeded("done"))

        def end(skill):
            inputs.append(skill.inputs)
            cause = left.pop(0) if left else None
            return usual(skill) if cause is None else Failed(cause, f"{name} {cause.value}")

        script.ends[name] = end
        return inputs

    return let_fail


@pytest.fixture
def worst(compiled, run_tree):
    """Runs commands; the worst result."""
    return lambda *texts, **options: run_tree(compiled(*texts), **options).worst


def near_coke(skill):
    return Succeeded("near", {"observation": COKE})


# a skill fails with causes: skills in the order in which they begin
@pytest.mark.parametrize(
    ("text", "skill", "causes", "begun"),
    [
        (GO, "navigate", "FF", "navigate clear_costmap navigate back_off navigate"),
        (GO, "navigate", "PP", "navigate clear_costmap navigate back_off navigate"),
        (GRASP, "approach", "PP", f"navigate {NEAR} clear_costmap {NEAR} back_off {NEAR} grasp stow"),
        (GRASP, "grasp", "PP", f"navigate {NEAR} grasp {NEAR} grasp back_off {NEAR} grasp stow"),
        (GRASP, "stow", "P", f"navigate {NEAR} grasp stow stow"),
    ],
)
def test_a_failure_is_followed_by_its_recoveries_in_order(worst, script, fails, text, skill, causes, begun):
    fails(skill, causes, then=near_coke if skill == "approach" else None)
    assert worst(text).outcome is Outcome.SUCCESS
    assert " ".join(script.begun) == begun


# a skill always fails with a cause: how often some skills begin until the mission fails with it
@pytest.mark.parametrize(
    ("text", "skill", "causes", "counts", "last"),
    [
        (GO, "navigate", "P" * 99, {"navigate": 6, "clear_costmap": 2, "back_off": 2}, "navigate"),
        (COUNTER, "navigate", "P" * 99, {"navigate": 12, "clear_costmap": 4, "back_off": 4}, "navigate"),
        (GRASP, "grasp", "B" * 99, {"grasp": 3}, "stow"),
        (GRASP, "grasp", "F" * 99, {"grasp": 3}, "stow"),
        (GRASP, "grasp", "O" * 99, {"grasp": 3}, "stow"),
        (GRASP, "grasp", "OP" * 20, {"grasp": 4}, "stow"),
    ],
)
def test_recoveries_are_bounded_alone_and_together(worst, script, fails, text, skill, causes, counts, last):
    fails(skill, causes)
    result = worst(text)
    assert result.outcome is Outcome.FAILURE
    assert len(set(causes)) > 1 or result.cause is CAUSES[causes[0]]
    assert ({name: script.begun.count(name) for name in counts}, script.begun[-1]) == (counts, last)


# ---- planning blocked


@pytest.mark.parametrize("letter", "BOTE")
def test_other_failures_to_go_somewhere_need_no_other_costmap(worst, script, fails, letter):
    fails("navigate", letter * 9)
    assert worst(GO).cause in (CAUSES[letter], Cause.POSTCONDITION)
    assert {"clear_costmap", "back_off"}.isdisjoint(script.begun)


def test_a_pose_nearby_is_tried_when_there_is_no_path_to_the_goal(worst, fails):
    navigate = fails("navigate", "PPP")
    assert worst(COUNTER).outcome is Outcome.SUCCESS
    assert [inputs.goal for inputs in navigate[:4]] == [Pose2D(4.5, -1.0, 0.0)] * 3 + [Pose2D(4.0, -1.0, 0.0)]


def test_a_free_place_in_the_room_is_taken_when_its_pose_is_blocked(worst, fails, knowledge):
    navigate = fails("navigate", "PPP")
    assert worst(KITCHEN).outcome is Outcome.SUCCESS
    goal, pose = navigate[3].goal, knowledge.place_pose("kitchen").pose_2d()
    assert inside(knowledge.rooms["kitchen"], (goal.x_m, goal.y_m)) and goal.yaw_rad == pose.yaw_rad
    assert math.dist((goal.x_m, goal.y_m), (pose.x_m, pose.y_m)) < 0.5


class CostmapWithPerson:
    """A costmap with somebody at (4, 0), or full of obstacles."""

    def __init__(self, full: bool) -> None:
        self._full = full

    def clearance_m(self, points_W):
        return np.zeros(len(points_W)) if self._full else np.hypot(*(points_W - [4.0, 0.0]).T) - 0.2


# is the whole room blocked? -> the status, and whether a pose is written
@pytest.mark.parametrize("full", [False, True])
def test_the_free_place_is_beside_a_person_on_the_rooms_pose_on_the_robots_side(context, full):
    here = replace(context, costmap=CostmapWithPerson(full))
    area_W = ((2.0, -2.0), (6.0, -2.0), (6.0, 2.0), (2.0, 2.0))
    pose = Pose2D(4.0, 0.0, 1.0)
    leaf = FreePlace(path_id="alice/f", name="f", room="hall", pose=pose, area_W=area_W, key="alice/pose", context=here)
    leaf.tick_once()
    if full:
        assert (leaf.status, leaf.cause) == (Status.FAILURE, Cause.PLANNING)
        return
    free = context.board.get("alice/pose")
    assert leaf.status == Status.SUCCESS and free.yaw_rad == 1.0
    assert free.x_m < 4.0 and 0.7 < math.dist((free.x_m, free.y_m), (4.0, 0.0)) < 1.2


def test_nothing_else_is_tried_when_all_poses_are_out_of_reach(worst, script):
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "the door is closed", final=True)
    result = worst(GO)
    assert (result.cause, result.message) == (Cause.PLANNING, "the door is closed")
    assert script.begun == ["navigate"]


def test_an_object_is_put_down_from_beside_the_goal_pose_when_there_is_no_path_to_it(worst, fails, robot):
    robot.holding = True
    navigate = fails("navigate", "PPP")
    worst("Take [coke] to [counter] and do [Nothing] to [Nothing]")
    assert [inputs.goal for inputs in navigate] == [Pose2D(4.5, -1.0, 0.0)] * 3 + [Pose2D(4.0, -1.0, 0.0)]


# ---- not seen


def test_an_object_that_is_not_seen_is_searched_from_aside_and_elsewhere(worst, fails, script):
    script.seen_on = ("bedside table",)
    navigate = fails("navigate")
    assert worst(GRASP).outcome is Outcome.SUCCESS
    goals = [(inputs.goal.x_m, inputs.goal.y_m) for inputs in navigate]
    assert goals == [(4.5, -1.0), (5.0, -0.5), (4.5, 1.0), (-4.5, 1.0)]


def test_a_status_check_looks_only_where_it_was_asked_to(worst, script):
    script.seen_on = ("bedside table",)
    result = worst(FIND)
    assert (result.outcome, list(result.answers.values())) == (Outcome.SUCCESS, [False])
    assert script.begun[-1] == "stow"


def test_places_elsewhere_are_few_and_the_usual_ones_first(knowledge):
    assert surfaces_elsewhere(knowledge, ObjectKind("coke"), "bedroom") == ("counter", "shelf")
    assert surfaces_elsewhere(knowledge, ObjectKind("coke"), "shelf") == ("counter", "bedside table")
    assert surfaces_elsewhere(knowledge, ObjectKind("coke"), None) == ()


def test_places_elsewhere_are_the_nearest_ones_where_none_is_usual():
    knowledge = load_knowledge(Path(__file__).parents[4] / "plant" / "worlds" / "lab" / "knowledge.yaml")
    found = surfaces_elsewhere(knowledge, ObjectKind("cube"), "workshop")
    assert found == ("kitchen table", "lab bench", "kitchen counter")


def test_in_a_good_run_no_node_fails(worst, make, published):
    assert worst(*make.FETCH).outcome is Outcome.SUCCESS
    assert "FAILURE" not in [message["to"] for topic, message in published if topic == "transitions"]


def test_after_a_failed_search_the_arm_is_stowed(worst, script):
    script.seen_on = ()
    assert worst(GRASP).cause is Cause.PRECONDITION
    assert script.begun[-1] == "stow"


# ---- standing before it, and grasping


def slips(skill):
    """The object slips out of the first two grasps."""
    tried = (*skill.inputs.avoid, len(skill.inputs.avoid) + 1)
    return Failed(Cause.POSTCONDITION, "slipped", {"tried": tried}) if len(tried) < 3 else held(skill)


def test_a_grasp_that_slips_is_followed_by_another_grasp(worst, script, fails):
    grasp = fails("grasp", then=slips)
    assert worst(GRASP).outcome is Outcome.SUCCESS
    assert [inputs.avoid for inputs in grasp] == [(), (1,), (1, 2)]
    assert script.begun.count("navigate") == 1


def test_tried_grasps_are_forgotten_when_the_step_begins_again(compiled, run_tree, fails):
    def always_slips(skill):
        skill.context.robot._robot.holding = False
        return Failed(Cause.POSTCONDITION, "slipped", {"tried": (*skill.inputs.avoid, 1)})

    grasp = fails("grasp", then=always_slips)
    tree = compiled(GRASP, name="first")
    run_tree(tree)
    count = len(grasp)
    run_tree(tree)
    assert [inputs.avoid for inputs in grasp[count:]] == [inputs.avoid for inputs in grasp[:count]]
    assert grasp[count].avoid == ()


def test_an_arm_that_cannot_be_drawn_in_carries_the_object_as_it_is(worst, script, fails, robot):
    fails("stow", "P" * 9)
    assert worst(GRASP).outcome is Outcome.SUCCESS
    assert (script.begun.count("stow"), script.begun.count("grasp"), robot.holding) == (2, 1, True)


# ---- fallen while carrying


class Loses:
    """Loses the object whenever one of some times has come and it is held."""

    def __init__(self, robot, *at_s):
        self.robot, self.left = robot, list(at_s)

    def __call__(self, progress):
        if self.left and progress.now_s > self.left[0] and self.robot.holding:
            self.robot.holding, self.left = False, self.left[1:]


@pytest.fixture
def carrying(worst, script, robot):
    """Carries the coke to the bedroom and loses it at some times; the robot's result."""

    def go(*at_s, text=PUT, seen_on=("floor",)):
        script.steps, robot.holding, robot.standing, script.seen_on = 40, True, Pose2D(-2.0, 0.0, 0.0), seen_on
        return worst(text, observer=Loses(robot, *at_s))

    return go


AGAIN = f"stow back_off detect {TAKEN}"


# times of the losses (s): skills in the order in which they begin
@pytest.mark.parametrize(
    ("text", "at_s", "begun"),
    [
        (GIVE, (3.0,), f"navigate hand_over {AGAIN} navigate hand_over"),
        (PUT, (0.5, 15.0), f"navigate {AGAIN} navigate place {AGAIN} navigate place"),
        (PUT, (0.5,), f"navigate {AGAIN} navigate place"),
        (PUT, (3.0,), f"navigate place {AGAIN} navigate place"),
    ],
)
def test_a_dropped_object_is_picked_up_from_the_floor_and_carried_on(carrying, script, text, at_s, begun):
    result = carrying(*at_s, text=text)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert " ".join(script.begun) == begun


def test_an_object_of_an_earlier_step_is_picked_up_again_when_it_falls_later(worst, script, robot, published):
    script.steps, robot.standing, script.seen_on = 40, Pose2D(-2.0, 0.0, 0.0), ("counter", "floor")

    def observer(progress):
        if script.begun[-1:] == ["navigate"] and script.begun.count("grasp") == 1 and robot.holding:
            robot.holding = False

    there = "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"
    assert worst(GRASP, there, observer=observer).outcome is Outcome.SUCCESS
    assert script.begun[script.begun.index("grasp") :].count("grasp") == 2
    assert "the coke has left the gripper on the way to the bedroom; it is looked for" in told(published)


def test_a_drive_with_an_empty_gripper_has_no_guard(compiled):
    tree = compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")
    assert "holding" not in " ".join(node.name for node in tree.root.walk())


def test_a_loss_ends_the_running_skill_within_three_ticks_and_is_told(carrying, script, published):
    carrying(0.5)
    ended = next(m["t"] for topic, m in published if topic == "transitions" and m["cause"] is Cause.EXECUTION)
    assert ended - 0.55 <= 0.15
    assert script.ended[0] == "navigate"
    assert "the coke has left the gripper on the way to the bedroom; it is looked for" in told(published)


def test_a_dropped_object_is_searched_where_the_robot_was(carrying, fails):
    detect = fails(
        "detect", then=lambda skill: Succeeded("seen", {"observation": COKE, "observations": (), "unexplained": ()})
    )
    assert carrying(0.5).outcome is Outcome.SUCCESS
    (floor,) = detect[0].surfaces
    assert (floor.name, floor.height_m) == ("floor", 0.0)
    xs, ys = zip(*floor.polygon_W, strict=True)
    assert (min(xs), max(xs), min(ys), max(ys)) == pytest.approx((-2.6, -0.2, -1.2, 1.2))


def test_a_dropped_object_is_picked_up_twice_and_then_given_up(carrying, script):
    result = carrying(0.5, 15.0, 30.0)
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.EXECUTION)
    assert result.message == "the coke was lost on the way to the bedroom (after 3 attempts)"
    assert script.begun.count("grasp") == 2


def test_the_robot_looks_first_at_the_spot_where_the_object_fell(knowledge):
    mission = Mission(name="m", robot="Alice", steps=(Do.from_command(parse_command(PUT)),))
    tree = compile_mission(mission, knowledge=knowledge, registry=core_skills())
    (find,) = [node for node in tree.mission.walk() if node.path_id.endswith("carry-on/again/find")]
    looks = [node.options["inputs"] for node in find.walk() if node.name == "detect"]
    assert [inputs.get("expected_W") for inputs in looks[:2]] == [
        FromBoard("alice/m/1-bedroom/carry-on/again/spot"),
        None,
    ]


def test_without_space_to_back_off_the_robot_looks_from_where_it_stands(carrying, script, fails):
    fails("back_off", "P")
    assert carrying(0.5).outcome is Outcome.SUCCESS
    assert script.begun[2:4] == ["back_off", "detect"]


def test_an_object_that_fell_onto_a_surface_is_found_there(worst, script, robot):
    script.steps, robot.holding, script.seen_on = 40, True, ("bedside table",)
    robot.standing = Pose2D(-4.5, 0.5, 0.0)
    result = worst(PUT, observer=Loses(robot, 0.5))
    assert result.outcome is Outcome.SUCCESS, result.message
    assert " ".join(script.begun) == f"navigate stow back_off detect detect {TAKEN} navigate place"


def test_a_dropped_object_that_is_not_found_is_a_failure(carrying, script):
    result = carrying(0.5, seen_on=())
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.EXECUTION)
    assert result.message.startswith("the coke was lost on the way to the bedroom; pick the coke up again: ")
    assert "the coke is not found again where it was lost: not seen" in result.message
    assert script.begun[3:] == ["detect", "navigate", "detect", "navigate", "detect", "stow"]


@pytest.fixture
def slipping(worst, script, robot):
    """Carries the coke to the bedroom while the gripper closes about it at some times; the robot's result."""

    def go(*at_s):
        left = list(at_s)

        def slip(progress):
            if left and progress.now_s > left[0]:
                robot.opening -= 0.06
                left.pop(0)

        script.steps, robot.holding = 40, True
        return worst(PUT, observer=slip)

    return go


def test_an_object_that_begins_to_slip_is_gripped_again_and_carried_on(slipping, script, robot, published):
    assert slipping(0.5).outcome is Outcome.SUCCESS
    assert (script.begun, robot.calls.count("set_gripper")) == (["navigate", "place"], 1)
    assert told(published, "control") == ["the coke began to slip and is gripped again, more firmly"]


def test_an_object_that_slips_twice_is_set_down_on_the_floor_and_grasped_again(
    slipping, script, robot, fails, published
):
    script.seen_on = ("floor",)
    place = fails("place", then=lambda skill: (setattr(robot, "holding", False), Succeeded("down"))[1])
    result = slipping(0.3, 1.2)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert " ".join(script.begun) == f"navigate place back_off detect {TAKEN} navigate place"
    assert [inputs.surface.name for inputs in place] == ["floor", "bedside table"]
    said = "the coke slips in the gripper on the way to the bedroom; it is set down and gripped again"
    assert said in told(published)


def test_an_object_that_slips_and_cannot_be_set_down_is_carried_as_it_is(slipping, script, fails):
    fails("place", "P")
    assert slipping(0.3, 1.2).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "place", "stow", "navigate", "place"]


@pytest.mark.parametrize("index", range(2, 8))
def test_cancelled_at_any_step_of_it_the_skill_ends_and_nothing_more_begins(worst, script, robot, index):
    control, lose = Control(pace=None), Loses(robot, 0.5)
    script.seen_on, script.steps, robot.holding = ("floor",), 40, True

    def observe(progress):
        lose(progress)
        if len(script.begun) == index:
            control.cancel()

    result = worst(PUT, observer=observe, control=control)
    assert (result.outcome, result.cause) == (Outcome.CANCELLED, Cause.CANCELLED)
    assert script.begun == f"navigate {AGAIN}".split()[:index]
    assert script.ended == script.begun


def test_a_failed_drive_with_the_object_still_held_is_no_fall(worst, script, robot, fails):
    robot.holding = True
    fails("navigate", "F" * 99)
    assert worst(PUT).cause is Cause.EXECUTION
    assert "detect" not in script.begun


def test_an_object_that_falls_while_the_arm_is_drawn_in_is_searched_on_the_floor_too(worst, script, robot, fails):
    script.steps = 40
    detect = fails(
        "detect", then=lambda skill: Succeeded("seen", {"observation": COKE, "observations": (), "unexplained": ()})
    )
    assert worst(GRASP, observer=Loses(robot, 0.0)).outcome is Outcome.SUCCESS
    assert " ".join(script.begun) == f"navigate detect {TAKEN} detect {TAKEN}"
    assert [inputs.floor for inputs in detect] == [False, True]


# ---- interrupts


def charged(skill):
    skill.context.robot._robot.charge = skill.inputs.level
    return Succeeded("charged")


def test_a_low_battery_sends_it_to_the_dock_and_back_and_the_mission_goes_on(worst, script, robot, fails):
    script.ends["charge"] = charged
    navigate = fails("navigate")
    robot.charge, robot.standing = 0.1, Pose2D(1.0, 0.5, 0.0)
    assert worst(GO).outcome is Outcome.SUCCESS
    assert script.begun == ["stow", "navigate", "charge", "navigate", "navigate"]
    goals = [inputs.goal for inputs in navigate]
    assert goals == [Pose2D(0.0, -1.0, 0.0), Pose2D(1.0, 0.5, 0.0), Pose2D(0.0, 0.0, 0.0)]


def test_the_mission_continues_where_it_was(worst, script, robot, make):
    script.ends["charge"] = charged

    def runs_down(progress):
        if progress.states["Alice"]["alice/fetch-drink/1-kitchen/approach"].status.value == "RUNNING":
            robot.charge = min(robot.charge, 0.1) if "charge" not in script.begun else robot.charge

    assert worst(*make.FETCH, observer=runs_down).outcome is Outcome.SUCCESS
    interrupt = "stow navigate charge navigate"
    assert " ".join(script.begun) == f"navigate detect approach {interrupt} {TAKEN} navigate hand_over"


def test_a_robot_that_does_not_charge_docks_again_three_times_at_most(worst, script, robot):
    script.ends["charge"] = lambda skill: Failed(Cause.POSTCONDITION, "it does not charge here")
    robot.charge = 0.1
    result = worst(GO)
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.POSTCONDITION)
    assert (script.begun.count("charge"), script.begun.count("back_off")) == (3, 2)
    assert result.message.startswith("the battery is at 10%, less than 15%: it does not charge here")


@pytest.fixture
def lost(script, make, worst):
    """Goes somewhere with a localiser that gets lost after a second, until `relocalise` works; result, localiser."""
    localiser, script.steps = make.StillLocaliser(), 120

    def found(skill):
        localiser.localised = True
        return Succeeded("found")

    def loses(progress):
        if progress.now_s > 1.0 and "relocalise" not in script.begun:
            localiser.localised = False

    script.ends["relocalise"] = found
    return lambda: (worst(GO, observer=loses, localiser=localiser), localiser)


def test_a_lost_place_is_found_again_and_the_mission_goes_on(script, lost):
    result, localiser = lost()
    assert result.outcome is Outcome.SUCCESS, result.message
    assert script.begun == ["navigate", "relocalise", "navigate"]
    assert localiser.localised


def test_a_place_that_is_not_found_again_ends_the_mission_and_says_why(script, lost):
    script.ends["relocalise"] = lambda skill: Failed(Cause.POSTCONDITION, "no place on the map fits")
    result, _ = lost()
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.POSTCONDITION)
    assert result.message == "the robot does not know where it is: no place on the map fits"


def test_thresholds_come_from_the_knowledge(compiled, knowledge, registry):
    battery, lost = (node.options["condition"] for node in compiled(GO).root.walk() if node.kind == "interrupt")
    assert (battery.charge, battery.dock) == (0.15, Pose2D(0.0, -1.0, 0.0))
    assert lost.patience_s < RunSettings().time_limit_s


# ---- the hand is felt before anything is searched for


def holds(skill, name="coke"):
    skill.context.robot._robot.holding, skill.context.payload.kind = True, ObjectKind(name)


def test_an_object_held_after_a_failed_grasp_is_used_and_not_searched_again(worst, script):
    def closes(skill):
        holds(skill)
        return Failed(Cause.EXECUTION, "the arm was stopped while carrying the coke")

    script.ends["grasp"] = closes
    result = worst(GRASP)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert " ".join(script.begun) == f"navigate detect {TAKEN}"


def test_an_object_lost_while_the_arm_is_drawn_in_is_grasped_again(worst, script, robot):
    def closes(skill):
        holds(skill)
        first = script.begun.count("grasp") == 1
        return Failed(Cause.EXECUTION, "the gripper closed on nothing") if first else Succeeded("taken", {"tried": ()})

    def loses(skill):
        robot.holding = script.begun.count("grasp") > 1
        return Succeeded("the arm is stowed")

    script.ends["grasp"], script.ends["stow"] = closes, loses
    result = worst(GRASP)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert script.begun.count("grasp") == 2


# what is in the gripper before the coke is to be picked up
@pytest.mark.parametrize(
    ("name", "begun", "cause", "message"),
    [
        ("beer", ["navigate"], Cause.PRECONDITION, "the gripper holds the beer already; put it down first"),
        ("coke", ["navigate", "stow"], None, "stow done"),
    ],
)
def test_with_an_object_in_the_gripper_nothing_is_searched_for(worst, script, name, begun, cause, message):
    def drives(skill):
        holds(skill, name)
        return Succeeded("gone")

    script.ends["navigate"] = drives
    result = worst(GO, GRASP)
    assert (result.cause, result.message, script.begun) == (cause, message, begun)


def test_an_object_dropped_in_a_hand_over_is_picked_up_and_handed_over_again(worst, script, robot, make, fails):
    def drops(skill):
        robot.let_go()
        if script.begun.count("hand_over") == 1:
            return Failed(Cause.POSTCONDITION, "the coke fell to the floor before Robin")
        return Succeeded("given")

    fails("grasp")
    script.ends["hand_over"], script.seen_on = drops, ("counter", "floor")
    result = worst(*make.FETCH)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert (script.begun.count("hand_over"), script.begun.count("grasp")) == (2, 2)


def test_no_surface_where_the_object_is_not_to_be_taken_from_is_searched():
    knowledge = load_knowledge(Path(__file__).parents[4] / "plant" / "worlds" / "lab" / "knowledge.yaml")
    cube = ObjectKind("cube", relations=(Relation(RelationKind.NOT_AT, (Landmark("kitchen"),)),))
    asked = (surfaces_elsewhere(knowledge, cube, "workshop"), surfaces_to_search(knowledge, cube, None))
    assert all(found and {*found}.isdisjoint({"kitchen table", "kitchen counter"}) for found in asked)
