"""Pictures: from where, of what, and what a referee wants of them, with scripted skills."""

import math

import pytest

from executive.mission.load import load_mission
from executive.run.outcome import Outcome
from executive.tree.board import Constant, FromBoard
from executive.tree.compiler import compile_mission
from executive.words.goal import GoalKind
from executive.words.knowledge import Place, Pose
from executive.words.leaf_steps import Picture, Subject
from executive.words.mission import Mission
from skills.api import Cause, Failed, Succeeded
from skills.robot import Pose2D


@pytest.fixture
def knowledge(knowledge):
    pump = Place(pose=Pose(x=4.0, y=0.5, yaw=0.5 * math.pi))
    gauge = Place(pose=Pose(x=4.0, y=-0.5), shows=(5.5, -0.5, 1.2))
    return knowledge.model_copy(update={"places": {**knowledge.places, "pump": pump, "gauge": gauge}})


@pytest.fixture
def pictured(knowledge, registry):
    """The tree of a mission with one picture."""

    def compile_picture(**subject):
        steps = (Picture(subject=Subject(**subject)),)
        return compile_mission(Mission(name="look", robot="Alice", steps=steps), knowledge=knowledge, registry=registry)

    return compile_picture


def inputs(tree, skill):
    """The inputs of the skill's leaves, without those of the battery's watch."""
    leaves = (node for node in tree.root.walk() if node.name == skill and "/watch/" not in node.path_id)
    return [
        {port: bound.value for port, bound in leaf.options["inputs"].items() if isinstance(bound, Constant)}
        for leaf in leaves
    ]


def goal(tree):
    (part,) = tree.parts
    assert part.goal.kind is GoalKind.PICTURED
    return part.goal


def test_a_picture_of_a_named_pose_shows_its_point(pictured):
    tree = pictured(of="gauge")
    (drive,), (shot,) = inputs(tree, "navigate"), inputs(tree, "take_picture")
    assert (drive["goal"], drive["position_tolerance_m"]) == (Pose2D(4.0, -0.5, 0.0), 0.08)
    assert (shot["of"], shot["point_W"], shot["camera"]) == ("the gauge", (5.5, -0.5, 1.2), "")
    (there,) = goal(tree).goal
    assert there.contains((5.46, -0.54, 1.16)) and not there.contains((5.5, -0.5, 1.3))
    assert goal(tree).source == ()


def test_a_picture_of_a_named_pose_without_a_point_shows_what_is_ahead_of_it(pictured):
    tree = pictured(of="pump")
    (shot,) = inputs(tree, "take_picture")
    assert shot["point_W"] == pytest.approx((4.0, 3.0, 0.9))
    (near,) = goal(tree).source
    assert near.contains((4.0, 1.2, 1.2)) and not near.contains((4.0, 2.0, 1.2))


def test_robot_turns_until_a_named_camera_sees_the_point(pictured, run_tree, script):
    tree = pictured(of="gauge", camera="back")
    shots, drives = inputs(tree, "take_picture"), inputs(tree, "navigate")
    assert {(shot["point_W"], shot["camera"]) for shot in shots} == {((5.5, -0.5, 1.2), "back")}
    assert [round(math.degrees(drive["goal"].yaw_rad)) % 360 for drive in drives] == [0, 90, 180, 270]
    failures = iter([Failed(Cause.PLANNING, "no view")] * 2)
    script.ends["take_picture"] = lambda skill: next(failures, None) or script_success(skill)
    assert run_tree(tree).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "take_picture"] * 3 + ["stow"]


def test_a_picture_of_a_surface_is_taken_from_its_viewpoints_in_turn(pictured, run_tree, script):
    tree = pictured(of="counter")
    assert [drive["goal"].x_m for drive in inputs(tree, "navigate")] == [4.5, 5.0]
    assert [shot["point_W"] for shot in inputs(tree, "take_picture")] == [pytest.approx((17 / 3, -5 / 3, 0.9))] * 2
    failures = iter([Failed(Cause.PLANNING, "no view")])
    script.ends["take_picture"] = lambda skill: next(failures, None) or script_success(skill)
    assert run_tree(tree).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "take_picture", "navigate", "take_picture", "stow"]


def script_success(_):
    return Succeeded("took a picture of the counter")


def test_a_picture_from_a_named_place_is_taken_there(pictured):
    tree = pictured(of="counter", at="pump")
    assert [drive["goal"] for drive in inputs(tree, "navigate")] == [Pose2D(4.0, 0.5, 0.5 * math.pi)]


def test_a_room_is_looked_at_in_four_directions(pictured):
    tree = pictured(of="kitchen")
    turns = [drive["goal"].yaw_rad for drive in inputs(tree, "navigate")]
    assert sorted(round(math.degrees(turn)) % 360 for turn in turns) == [0, 90, 180, 270]
    assert [shot["of"] for shot in inputs(tree, "take_picture")] == [f"the kitchen ({n} of 4)" for n in (1, 2, 3, 4)]
    assert (goal(tree).count, goal(tree).source[0].name) == (4, "kitchen")


def test_an_object_is_searched_and_then_pictured_where_it_was_seen(pictured):
    tree = pictured(of="coke")
    (leaf,) = (node for node in tree.root.walk() if node.name == "take_picture")
    found = leaf.options["inputs"]["object"]
    looks = [node for node in tree.root.walk() if node.name == "detect"]
    assert looks and isinstance(found, FromBoard)
    assert {look.options["outputs"]["observation"] for look in looks} == {found.key}
    assert (goal(tree).classes, goal(tree).wanted) == (("coke",), "coke")


def test_an_object_is_pictured_from_a_named_pose_if_that_is_said(pictured):
    assert inputs(pictured(of="coke", at="pump"), "navigate")[-1]["goal"] == Pose2D(4.0, 0.5, 0.5 * math.pi)


def test_a_picture_is_an_answer_of_the_mission(pictured, run_tree, script, published):
    script.ends["take_picture"] = script_success
    result = run_tree(pictured(of="counter")).robots[0]
    (finding,) = result.findings
    assert (finding.question, finding.answer) == ("A picture of the counter", "taken")
    assert finding.sentence == result.message == "took a picture of the counter"


def test_a_failed_picture_is_no_answer(pictured, run_tree, script):
    script.ends["take_picture"] = lambda skill: Failed(Cause.EXECUTION, "it is dark")
    result = run_tree(pictured(of="pump")).robots[0]
    assert (result.outcome, result.findings, script.begun[-1]) == (Outcome.FAILURE, (), "stow")


def test_a_file_names_what_the_picture_shows(tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text("name: m\nsteps: [{picture: {of: stove, at: kitchen}}]\n", encoding="utf-8")
    (step,) = load_mission(file).steps
    assert (step.subject, step.words) == (Subject(of="stove", at="kitchen"), "take a picture of the stove")


def test_the_step_of_a_picture_or_a_search_is_named_after_it(pictured, compiled):
    picture = next(node for node in pictured(of="gauge").root.walk() if node.kind == "afterwards")
    asked = compiled("Take [Nothing] to [kitchen] and do [find] to [coke]")
    search = next(node for node in asked.root.walk() if node.kind == "afterwards")
    assert (picture.name, search.name) == ("take a picture of the gauge", "is there a coke in the kitchen?")
