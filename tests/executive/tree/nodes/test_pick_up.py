"""Recovery in compiled trees with skills that fail by their scripts: chosen by cause, bounded, without leaks."""

from pathlib import Path

import pytest

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.visitor import RunSettings
from executive.tree.board import FromBoard
from executive.tree.compiler import compile_mission
from executive.tree.nodes.search import surfaces_elsewhere
from executive.tree.registry import built_in_skills
from executive.words.command import parse_command
from executive.words.knowledge import load_knowledge
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from skills.api import Cause, Failed, ObjectKind, Succeeded
from skills.robot import Pose2D

GO = "Take [Nothing] to [hall] and do [Nothing] to [Nothing]"
GRASP = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
FIND = "Take [Nothing] to [kitchen] and do [find] to [coke]"
PUT = "Take [coke] to [bedroom] and do [Nothing] to [Nothing]"
STOWED = ["stow"]


def held(skill):
    """The grasp works."""
    skill.context.robot._robot.holding = True
    return Succeeded("held", {"tried": (*skill.inputs.avoid, len(skill.inputs.avoid) + 1)})


class Script1:
    """Ends of one skill in order, then its usual end."""

    def __init__(self, script, name, *causes, then=None):
        self.left, self.name, self.inputs = list(causes), name, []
        usual = then or (held if name == "grasp" else lambda skill: Succeeded("done"))

        def end(skill):
            self.inputs.append(skill.inputs)
            cause = self.left.pop(0) if self.left else None
            return usual(skill) if cause is None else Failed(cause, f"{name} {cause.value}")

        script.ends[name] = end


@pytest.fixture
def fails(script):
    """Let a skill fail with causes, then work."""
    return lambda name, *causes, then=None: Script1(script, name, *causes, then=then)


# ---- planning blocked


@pytest.mark.parametrize("cause", [Cause.PLANNING, Cause.EXECUTION])
def test_a_blocked_drive_clears_the_costmap_then_backs_off(compiled, run_tree, script, fails, cause):
    fails("navigate", cause, cause)
    assert run_tree(compiled(GO)).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "clear_costmap", "navigate", "back_off", "navigate"]


@pytest.mark.parametrize("cause", [Cause.PRECONDITION, Cause.POSTCONDITION, Cause.TIMEOUT, Cause.ERROR])
def test_other_failures_to_go_somewhere_need_no_other_costmap(compiled, run_tree, script, fails, cause):
    fails("navigate", *[cause] * 9)
    assert run_tree(compiled(GO)).worst.cause in (cause, Cause.POSTCONDITION)
    assert {"clear_costmap", "back_off"}.isdisjoint(script.begun)


def test_a_pose_nearby_is_tried_when_there_is_no_path_to_the_goal(compiled, run_tree, fails):
    navigate = fails("navigate", *[Cause.PLANNING] * 3)
    assert run_tree(compiled(GO)).outcome is Outcome.SUCCESS
    assert [inputs.goal for inputs in navigate.inputs[:3]] == [Pose2D(0.0, 0.0, 0.0)] * 3
    assert navigate.inputs[3].goal == Pose2D(-0.5, 0.0, 0.0)


def test_going_is_given_up_after_all_poses_nearby(compiled, run_tree, script, fails):
    fails("navigate", *[Cause.PLANNING] * 99)
    worst = run_tree(compiled(GO)).worst
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, Cause.PLANNING)
    assert script.begun.count("navigate") == 3 * 4
    assert script.begun.count("clear_costmap") == script.begun.count("back_off") == 4


def test_nothing_else_is_tried_when_all_poses_are_out_of_reach(compiled, run_tree, script):
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "the door is closed", final=True)
    worst = run_tree(compiled(GO)).worst
    assert (worst.cause, worst.message) == (Cause.PLANNING, "the door is closed")
    assert script.begun == ["navigate"]


def test_an_object_is_put_down_from_beside_the_goal_pose_when_there_is_no_path_to_it(compiled, run_tree, fails, robot):
    robot.holding = True
    navigate = fails("navigate", *[Cause.PLANNING] * 3)
    run_tree(compiled("Take [coke] to [counter] and do [Nothing] to [Nothing]"))
    assert [inputs.goal for inputs in navigate.inputs] == [Pose2D(4.5, -1.0, 0.0)] * 3 + [Pose2D(4.0, -1.0, 0.0)]


# ---- not seen


def test_an_object_that_is_not_seen_is_searched_from_aside_and_elsewhere(compiled, run_tree, fails, script):
    script.seen_on = ("bedside table",)
    tree = compiled(GRASP)
    navigate = fails("navigate")
    assert run_tree(tree).outcome is Outcome.SUCCESS
    goals = [(inputs.goal.x_m, inputs.goal.y_m) for inputs in navigate.inputs]
    assert goals == [(4.5, -1.0), (5.0, -0.5), (4.5, 1.0), (-4.5, 1.0)]


def test_a_status_check_looks_only_where_it_was_asked_to(compiled, run_tree, script):
    script.seen_on = ("bedside table",)
    tree = compiled(FIND)
    worst = run_tree(tree).worst
    assert (worst.outcome, list(worst.answers.values())) == (Outcome.SUCCESS, [False])
    assert script.begun[-1] == "stow"


def test_places_elsewhere_are_few_and_the_usual_ones_first(knowledge):
    assert surfaces_elsewhere(knowledge, "coke", "bedroom") == ("counter", "shelf")
    assert surfaces_elsewhere(knowledge, "coke", "shelf") == ("counter", "bedside table")
    assert surfaces_elsewhere(knowledge, "coke", None) == ()


def test_places_elsewhere_are_the_nearest_ones_where_none_is_usual():
    knowledge = load_knowledge(Path(__file__).parents[4] / "plant" / "worlds" / "lab" / "knowledge.yaml")
    assert surfaces_elsewhere(knowledge, "cube", "workshop") == ("kitchen table", "lab bench", "kitchen counter")


def test_in_a_good_run_no_node_fails(compiled, run_tree, make, published):
    assert run_tree(compiled(*make.FETCH)).outcome is Outcome.SUCCESS
    changes = [message for topic, message in published if topic == "transitions"]
    assert not [change for change in changes if change["to"] == "FAILURE"]


def test_after_a_failed_search_the_arm_is_stowed(compiled, run_tree, script):
    script.seen_on = ()
    assert run_tree(compiled(GRASP)).worst.cause is Cause.PRECONDITION
    assert script.begun[-1] == "stow"


# ---- standing before it, and grasping


def test_a_grasp_that_slips_is_followed_by_another_grasp(compiled, run_tree, script, fails):
    def slips(skill):
        tried = (*skill.inputs.avoid, len(skill.inputs.avoid) + 1)
        return Failed(Cause.POSTCONDITION, "slipped", {"tried": tried}) if len(tried) < 3 else held(skill)

    grasp = fails("grasp", then=slips)
    assert run_tree(compiled(GRASP)).outcome is Outcome.SUCCESS
    assert [inputs.avoid for inputs in grasp.inputs] == [(), (1,), (1, 2)]
    assert script.begun.count("navigate") == 1


def test_tried_grasps_are_forgotten_when_the_step_begins_again(compiled, run_tree, fails):
    def slips(skill):
        skill.context.robot._robot.holding = False
        return Failed(Cause.POSTCONDITION, "slipped", {"tried": (*skill.inputs.avoid, 1)})

    grasp = fails("grasp", then=slips)
    tree = compiled(GRASP, name="first")
    run_tree(tree)
    count = len(grasp.inputs)
    run_tree(tree)
    assert [inputs.avoid for inputs in grasp.inputs[count:]] == [inputs.avoid for inputs in grasp.inputs[:count]]
    assert grasp.inputs[count].avoid == ()


def test_without_a_grasp_the_robot_looks_again_then_backs_off(compiled, run_tree, script, fails):
    fails("grasp", Cause.PLANNING, Cause.PLANNING)
    assert run_tree(compiled(GRASP)).outcome is Outcome.SUCCESS
    round_ = ["approach", "grasp"]
    assert script.begun == ["navigate", "detect", *round_, "detect", *round_, "back_off", "detect", *round_, *STOWED]


def test_without_an_approach_the_robot_clears_the_costmap_then_backs_off(compiled, run_tree, script, fails, make):
    fails("approach", Cause.PLANNING, Cause.PLANNING, then=lambda skill: Succeeded("near", {"observation": make.COKE}))
    assert run_tree(compiled(GRASP)).outcome is Outcome.SUCCESS
    again = ["detect", "approach"]
    assert script.begun[2:] == ["approach", "clear_costmap", *again, "back_off", *again, "grasp", *STOWED]


@pytest.mark.parametrize("cause", [Cause.PRECONDITION, Cause.EXECUTION, Cause.POSTCONDITION])
def test_grasping_is_bounded(compiled, run_tree, script, fails, cause):
    fails("grasp", *[cause] * 99)
    worst = run_tree(compiled(GRASP)).worst
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, cause)
    assert script.begun.count("grasp") == 3
    assert script.begun[-1] == "stow"


def test_all_recoveries_together_are_bounded(compiled, run_tree, script, fails):
    causes = [Cause.POSTCONDITION, Cause.PLANNING] * 20
    fails("grasp", *causes)
    assert run_tree(compiled(GRASP)).outcome is Outcome.FAILURE
    assert script.begun.count("grasp") == 4


def test_a_failed_stow_after_a_good_grasp_is_tried_once_more(compiled, run_tree, script, fails):
    fails("stow", Cause.PLANNING)
    assert run_tree(compiled(GRASP)).outcome is Outcome.SUCCESS
    assert script.begun[-3:] == ["grasp", "stow", "stow"]


def test_an_arm_that_cannot_be_drawn_in_carries_the_object_as_it_is(compiled, run_tree, script, fails, robot):
    fails("stow", *[Cause.PLANNING] * 9)
    assert run_tree(compiled(GRASP)).outcome is Outcome.SUCCESS
    assert (script.begun.count("stow"), script.begun.count("grasp"), robot.holding) == (2, 1, True)


# ---- fallen while carrying


class Loses:
    """Loses the object whenever one of some times has come and it is held."""

    def __init__(self, robot, *at_s):
        self.robot, self.left = robot, list(at_s)

    def __call__(self, progress):
        if self.left and progress.now_s > self.left[0] and self.robot.holding:
            self.robot.holding, self.left = False, self.left[1:]


TAKEN = ["approach", "grasp", "stow"]


@pytest.fixture
def carrying(compiled, run_tree, script, robot):
    """Carry the coke to the bedroom and lose it at some times; the robot's result."""

    def go(*at_s, text=PUT):
        script.steps, robot.holding, robot.standing = 40, True, Pose2D(-2.0, 0.0, 0.0)
        return run_tree(compiled(text), observer=Loses(robot, *at_s)).worst

    return go


def test_a_dropped_object_is_picked_up_from_the_floor_and_carried_on(carrying, script, published):
    script.seen_on = ("floor",)
    worst = carrying(0.5)
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert script.begun == ["navigate", "stow", "back_off", "detect", *TAKEN, "navigate", "place"]
    told = [message["message"] for topic, message in published if topic == "transitions"]
    assert "the coke fell on the way to the bedroom; it is picked up again" in told


def test_an_object_of_an_earlier_step_is_picked_up_again_when_it_falls_later(
    compiled, run_tree, script, robot, published
):
    script.seen_on = ("counter", "floor")
    tree = compiled(GRASP, "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")
    script.steps, robot.standing = 40, Pose2D(-2.0, 0.0, 0.0)

    def observer(progress):
        if script.begun[-1:] == ["navigate"] and script.begun.count("grasp") == 1 and robot.holding:
            robot.holding = False

    assert run_tree(tree, observer=observer).worst.outcome is Outcome.SUCCESS
    assert script.begun[script.begun.index("grasp") :].count("grasp") == 2
    told = [message["message"] for topic, message in published if topic == "transitions"]
    assert "the coke fell on the way to the bedroom; it is picked up again" in told


def test_a_drive_with_an_empty_gripper_has_no_guard(compiled):
    tree = compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")
    assert "holding" not in " ".join(node.name for node in tree.root.walk())


def test_a_loss_ends_the_running_skill_within_three_ticks(carrying, script, published):
    carrying(0.5)
    ended = next(m["t"] for topic, m in published if topic == "transitions" and m["cause"] is Cause.EXECUTION)
    assert ended - 0.55 <= 0.15
    assert script.ended[0] == "navigate"


def test_a_dropped_object_is_searched_where_the_robot_was(carrying, script, fails, make):
    detect = fails("detect", then=lambda skill: Succeeded("seen", {"observation": make.COKE, "observations": ()}))
    assert carrying(0.5).outcome is Outcome.SUCCESS
    (floor,) = detect.inputs[0].surfaces
    assert (floor.name, floor.height_m) == ("floor", 0.0)
    xs, ys = zip(*floor.polygon_W, strict=True)
    assert (min(xs), max(xs), min(ys), max(ys)) == pytest.approx((-2.6, -0.2, -1.2, 1.2))


def test_a_dropped_object_is_picked_up_twice_and_then_given_up(carrying, script):
    script.seen_on = ("floor",)
    worst = carrying(0.5, 15.0, 30.0)
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, Cause.EXECUTION)
    assert worst.message == "the coke was lost on the way to the bedroom (after 3 attempts)"
    assert script.begun.count("grasp") == 2


def test_an_object_lost_twice_is_picked_up_twice(carrying, script):
    script.seen_on = ("floor",)
    worst = carrying(0.5, 15.0)
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert (script.begun.count("grasp"), script.begun[-1]) == (2, "place")


def test_an_object_that_falls_while_it_is_put_down_is_picked_up_again(carrying, script):
    script.seen_on = ("floor",)
    assert carrying(3.0).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "place", "stow", "back_off", "detect", *TAKEN, "navigate", "place"]


def test_an_object_that_falls_while_it_is_handed_over_is_picked_up_again(carrying, script):
    script.seen_on = ("floor",)
    text = "Take [coke] to [Robin] and do [Nothing] to [Nothing]"
    assert carrying(3.0, text=text).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "hand_over", "stow", "back_off", "detect", *TAKEN, "navigate", "hand_over"]


def test_the_robot_looks_first_at_the_spot_where_the_object_fell(knowledge):
    mission = Mission(name="m", robot="Alice", steps=(Do.from_command(parse_command(PUT)),))
    tree = compile_mission(mission, knowledge=knowledge, registry=built_in_skills())
    (find,) = [node for node in tree.mission.walk() if node.path_id.endswith("carry-on/again/find")]
    looks = [node.options["inputs"] for node in find.walk() if node.name == "detect"]
    assert [inputs.get("expected_W") for inputs in looks[:2]] == [
        FromBoard("alice/m/1-bedroom/carry-on/again/spot"),
        None,
    ]


def test_without_space_to_back_off_the_robot_looks_from_where_it_stands(carrying, script, fails):
    script.seen_on = ("floor",)
    fails("back_off", Cause.PLANNING)
    assert carrying(0.5).outcome is Outcome.SUCCESS
    assert script.begun[2:4] == ["back_off", "detect"]


def test_an_object_that_fell_onto_a_surface_is_found_there(compiled, run_tree, script, robot):
    script.steps, robot.holding, script.seen_on = 40, True, ("bedside table",)
    robot.standing = Pose2D(-4.5, 0.5, 0.0)
    worst = run_tree(compiled(PUT), observer=Loses(robot, 0.5)).worst
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert script.begun == ["navigate", "stow", "back_off", "detect", "detect", *TAKEN, "navigate", "place"]


def test_a_dropped_object_that_is_not_found_is_a_failure(carrying, script):
    script.seen_on = ()
    worst = carrying(0.5)
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, Cause.EXECUTION)
    assert worst.message.startswith("the coke was lost on the way to the bedroom; pick the coke up again: ")
    assert "the coke is not found again where it fell: not seen" in worst.message
    assert script.begun[3:] == ["detect", "navigate", "detect", "navigate", "detect", "stow"]


@pytest.fixture
def slipping(compiled, run_tree, script, robot):
    """Carry the coke to the bedroom while the gripper closes about it at some times; the robot's result."""

    def go(*at_s):
        left = list(at_s)

        def slip(progress):
            if left and progress.now_s > left[0]:
                robot.opening -= 0.06
                left.pop(0)

        script.steps, robot.holding = 40, True
        return run_tree(compiled(PUT), observer=slip).worst

    return go


def test_an_object_that_begins_to_slip_is_gripped_again_and_carried_on(slipping, script, robot, published):
    assert slipping(0.5).outcome is Outcome.SUCCESS
    assert (script.begun, robot.calls.count("set_gripper")) == (["navigate", "place"], 1)
    told = [message["message"] for topic, message in published if topic == "control"]
    assert told == ["the coke began to slip and is gripped again, more firmly"]


def test_an_object_that_slips_twice_is_set_down_on_the_floor_and_grasped_again(
    slipping, script, robot, fails, published
):
    script.seen_on = ("floor",)
    place = fails("place", then=lambda skill: (setattr(robot, "holding", False), Succeeded("down"))[1])
    worst = slipping(0.3, 1.2)
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert script.begun == ["navigate", "place", "back_off", "detect", *TAKEN, "navigate", "place"]
    assert [inputs.surface.name for inputs in place.inputs] == ["floor", "bedside table"]
    told = [message["message"] for topic, message in published if topic == "transitions"]
    assert "the coke slips in the gripper on the way to the bedroom; it is set down and gripped again" in told


def test_an_object_that_slips_and_cannot_be_set_down_is_carried_as_it_is(slipping, script, fails):
    fails("place", Cause.PLANNING)
    assert slipping(0.3, 1.2).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "place", "stow", "navigate", "place"]


@pytest.mark.parametrize("step", ["stow", "back_off", "detect", "approach", "grasp", "stow "])
def test_cancelled_at_any_step_of_it_the_skill_ends_and_nothing_more_begins(compiled, run_tree, script, robot, step):
    control, lose = Control(pace=None), Loses(robot, 0.5)
    script.seen_on, script.steps, robot.holding = ("floor",), 40, True
    index = {"stow": 2, "back_off": 3, "detect": 4, "approach": 5, "grasp": 6, "stow ": 7}[step]

    def observe(progress):
        lose(progress)
        if len(script.begun) == index:
            control.cancel()

    worst = run_tree(compiled(PUT), observer=observe, control=control).worst
    assert (worst.outcome, worst.cause) == (Outcome.CANCELLED, Cause.CANCELLED)
    assert (len(script.begun), script.begun[-1], script.ended) == (index, step.strip(), script.begun)


def test_a_failed_drive_with_the_object_still_held_is_no_fall(compiled, run_tree, script, robot, fails):
    robot.holding = True
    fails("navigate", *[Cause.EXECUTION] * 99)
    assert run_tree(compiled(PUT)).worst.cause is Cause.EXECUTION
    assert "detect" not in script.begun


def test_an_object_that_falls_while_the_arm_is_drawn_in_is_searched_on_the_floor_too(
    compiled, run_tree, script, robot, fails, make
):
    script.steps = 40
    detect = fails("detect", then=lambda skill: Succeeded("seen", {"observation": make.COKE, "observations": ()}))
    assert run_tree(compiled(GRASP), observer=Loses(robot, 0.0)).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "detect", *TAKEN, "detect", *TAKEN]
    assert [inputs.floor for inputs in detect.inputs] == [False, True]


# ---- interrupts


def test_a_low_battery_sends_it_to_the_dock_and_back_and_the_mission_goes_on(compiled, run_tree, script, robot, fails):
    def charged(skill):
        robot.charge = skill.inputs.level
        return Succeeded("charged")

    script.ends["charge"] = charged
    navigate = fails("navigate")
    robot.charge, robot.standing = 0.1, Pose2D(1.0, 0.5, 0.0)
    assert run_tree(compiled(GO)).outcome is Outcome.SUCCESS
    assert script.begun == ["stow", "navigate", "charge", "navigate", "navigate"]
    goals = [inputs.goal for inputs in navigate.inputs]
    assert goals == [Pose2D(0.0, -1.0, 0.0), Pose2D(1.0, 0.5, 0.0), Pose2D(0.0, 0.0, 0.0)]


def test_the_mission_continues_where_it_was(compiled, run_tree, script, robot, make):
    script.ends["charge"] = lambda skill: (setattr(robot, "charge", 0.9), Succeeded("charged"))[1]

    def runs_down(progress):
        if progress.states["Alice"]["alice/fetch-drink/1-kitchen/approach"].status.value == "RUNNING":
            robot.charge = min(robot.charge, 0.1) if "charge" not in script.begun else robot.charge

    assert run_tree(compiled(*make.FETCH), observer=runs_down).outcome is Outcome.SUCCESS
    before, interrupt = ["navigate", "detect", "approach"], ["stow", "navigate", "charge", "navigate"]
    assert script.begun == [*before, *interrupt, "approach", "grasp", "stow", "navigate", "hand_over"]


def test_a_robot_that_does_not_charge_docks_again_three_times_at_most(compiled, run_tree, script, robot):
    script.ends["charge"] = lambda skill: Failed(Cause.POSTCONDITION, "it does not charge here")
    robot.charge = 0.1
    worst = run_tree(compiled(GO)).worst
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, Cause.POSTCONDITION)
    assert (script.begun.count("charge"), script.begun.count("back_off")) == (3, 2)
    assert worst.message.startswith("the battery is at 10%, less than 15%: it does not charge here")


def test_a_lost_place_is_found_again_and_the_mission_goes_on(compiled, run_tree, script, lost_runs):
    script.steps = 120
    worst, localiser = lost_runs(compiled(GO))
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert script.begun == ["navigate", "relocalise", "navigate"]
    assert localiser.localised


def test_a_place_that_is_not_found_again_ends_the_mission_and_says_why(compiled, script, lost_runs):
    script.steps = 120
    script.ends["relocalise"] = lambda skill: Failed(Cause.POSTCONDITION, "no place on the map fits")
    worst, _ = lost_runs(compiled(GO))
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, Cause.POSTCONDITION)
    assert worst.message == "the robot does not know where it is: no place on the map fits"


@pytest.fixture
def lost_runs(clock, robot, script, make, run_tree):
    """Run a tree whose localiser gets lost after a second, until `relocalise` has worked."""

    def go(tree):
        localiser = make.StillLocaliser()
        script.ends.setdefault(
            "relocalise", lambda skill: (setattr(localiser, "localised", True), Succeeded("found"))[1]
        )

        def loses(progress):
            if progress.now_s > 1.0 and "relocalise" not in script.begun:
                localiser.localised = False

        return run_tree(tree, observer=loses, localiser=localiser).worst, localiser

    return go


def test_thresholds_come_from_the_knowledge(compiled, knowledge, registry):
    battery, lost = (node.options["condition"] for node in compiled(GO).root.walk() if node.kind == "interrupt")
    assert (battery.charge, battery.dock) == (0.15, Pose2D(0.0, -1.0, 0.0))
    assert lost.patience_s < RunSettings().time_limit_s


# ---- the hand is felt before anything is searched for


def test_an_object_held_after_a_failed_grasp_is_used_and_not_searched_again(compiled, run_tree, script, robot):
    def closes(skill):
        robot.holding, skill.context.payload.kind = True, ObjectKind("coke")
        return Failed(Cause.EXECUTION, "the arm was stopped while carrying the coke")

    script.ends["grasp"] = closes
    worst = run_tree(compiled(GRASP)).worst
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert script.begun == ["navigate", "detect", "approach", "grasp", "stow"]


def test_an_object_lost_while_the_arm_is_drawn_in_is_grasped_again(compiled, run_tree, script, robot):
    def closes(skill):
        robot.holding, skill.context.payload.kind = True, ObjectKind("coke")
        first = script.begun.count("grasp") == 1
        return Failed(Cause.EXECUTION, "the gripper closed on nothing") if first else Succeeded("taken", {"tried": ()})

    def loses(skill):
        robot.holding = script.begun.count("grasp") > 1
        return Succeeded("the arm is stowed")

    script.ends["grasp"], script.ends["stow"] = closes, loses
    worst = run_tree(compiled(GRASP)).worst
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert script.begun.count("grasp") == 2


def test_an_object_of_an_earlier_step_is_not_searched(compiled, run_tree, script, robot, context):
    def holds_it(skill):
        robot.holding, skill.context.payload.kind = True, ObjectKind("coke")
        return Succeeded("gone")

    script.ends["navigate"] = holds_it
    assert run_tree(compiled(GO, GRASP)).worst.outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "stow"]


def test_with_another_object_in_the_gripper_nothing_is_searched_for(compiled, run_tree, script, robot):
    def holds_another(skill):
        robot.holding, skill.context.payload.kind = True, ObjectKind("beer")
        return Succeeded("gone")

    script.ends["navigate"] = holds_another
    worst = run_tree(compiled(GO, GRASP)).worst
    assert (worst.cause, worst.message) == (Cause.PRECONDITION, "the gripper holds the beer already; put it down first")
    assert script.begun == ["navigate"]


def test_an_object_dropped_in_a_hand_over_is_picked_up_and_handed_over_again(
    compiled, run_tree, script, robot, make, fails
):
    def drops(skill):
        robot.let_go()
        if script.begun.count("hand_over") == 1:
            return Failed(Cause.POSTCONDITION, "the coke fell to the floor before Robin")
        return Succeeded("given")

    fails("grasp")
    script.ends["hand_over"], script.seen_on = drops, ("counter", "floor")
    worst = run_tree(compiled(*make.FETCH)).worst
    assert worst.outcome is Outcome.SUCCESS, worst.message
    assert (script.begun.count("hand_over"), script.begun.count("grasp")) == (2, 2)
