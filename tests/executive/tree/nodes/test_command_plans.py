"""Several objects by count: one trip for each."""

from executive.app.runs.goal_conditions import conditions_of
from executive.run.outcome import Outcome
from executive.tree.board import Constant
from executive.tree.compiler import compile_mission
from executive.words.command import Command
from executive.words.goal import GoalKind
from executive.words.knowledge import Place, Pose
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from skills.api import Succeeded
from skills.robot import Pose2D

TWO = (
    "Take [Nothing] to [kitchen] and do [grasp] to [2 drink]",
    "Take [2 drink] to [bedside table] and do [Nothing] to [Nothing]",
)
BASE = "alice/fetch-drink/1-kitchen"


def test_two_things_are_two_trips(compiled):
    ids = compiled(*TWO).path_ids
    assert {f"{BASE}/trip-1/get", f"{BASE}/trip-1/bring", f"{BASE}/trip-2/get", f"{BASE}/trip-2/bring"} <= set(ids)
    assert not any("/trip-3" in path_id for path_id in ids)


def test_a_brought_object_is_not_looked_for_again(compiled):
    finds = [node for node in compiled(*TWO).root.walk() if node.kind == "skill" and "/get/find/" in node.path_id]
    bound = [node.options["inputs"]["surfaces"] for node in finds if node.name == "detect"]
    named = {surface.name for binding in bound if isinstance(binding, Constant) for surface in binding.value}
    assert named == {"counter", "shelf"}


def test_each_trip_grasps_and_puts_down(compiled, run_tree, script, robot):
    def place(skill):
        skill.context.robot._robot.holding = False
        return Succeeded("put down")

    script.ends["place"] = place
    result = run_tree(compiled(*TWO)).robots[0]
    assert result.outcome is Outcome.SUCCESS
    assert (script.begun.count("grasp"), script.begun.count("place")) == (2, 2)


def test_the_condition_is_one_of_two_things(compiled, run_tree, knowledge, script):
    tree = compiled(*TWO)
    grasped, placed = conditions_of(tree, run_tree(tree).robots[0])
    assert (grasped.kind, grasped.count, placed.kind, placed.count) == (GoalKind.GRASPED, 2, GoalKind.PLACED, 2)


def test_a_named_pose_is_taken_exactly_and_a_room_nearly(knowledge, registry):
    pump = Place(pose=Pose(x=4.0, y=0.5, yaw=1.0))
    knowledge = knowledge.model_copy(update={"places": {**knowledge.places, "pump": pump}})
    steps = steps_of_commands([Command(goal="pump"), Command(goal="kitchen")])
    tree = compile_mission(Mission(name="go", robot="Alice", steps=steps), knowledge=knowledge, registry=registry)
    steps = (node for node in tree.root.walk() if node.name == "navigate" and "/watch/" not in node.path_id)
    drives = [node.options["inputs"] for node in steps]
    assert (drives[0]["goal"], drives[0]["position_tolerance_m"]) == (Constant(Pose2D(4.0, 0.5, 1.0)), Constant(0.08))
    assert drives[1:] and not any("position_tolerance_m" in each for each in drives[1:])
    (at_pump, _) = (part.goal.goal[0] for part in tree.parts)
    assert at_pump.contains((4.2, 0.5, 0.5)) and not at_pump.contains((4.4, 0.5, 0.5))


GET = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
PUT = (
    "Take [Nothing] to [Nothing] and do [grasp] to [coke]",
    "Take [coke] to [bedside table] and do [Nothing] to [Nothing]",
)


def test_an_object_grasped_by_an_earlier_step_is_not_looked_for(compiled, run_tree, script):
    assert run_tree(compiled(GET, *PUT)).outcome is Outcome.SUCCESS
    assert script.begun.count("grasp") == 1


def test_an_object_that_left_the_gripper_is_looked_for_again(compiled, run_tree, script, robot):
    def drop(skill):
        skill.context.robot._robot.holding = False
        return Succeeded("there")

    script.ends["navigate"] = drop
    go = "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"
    run_tree(compiled(GET, go, *PUT))
    assert script.begun.count("grasp") > 1
