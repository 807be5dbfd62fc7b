"""What several robots are asked for becomes a mission for each."""

import re
import shutil
from pathlib import Path

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.prepare.worlds import open_world
from executive.cli.run_command import refuse_unaddressed
from executive.mission.request import Request
from executive.words.robot_config import RobotConfig
from executive.words.variation import Variation
from plant.worlds.seeding import place_people
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from tests.tables import yaml_beside

MEANT = yaml_beside(__file__, "sentences_to_robots.yaml")

TWO = (RobotConfig("Alice", "spot"), RobotConfig("Bob", "spot"))


def asked(sentence, robots=TWO):
    return prepare(Request(sentence, robots=robots), ask=None)


@pytest.mark.parametrize(("sentence", "goals"), MEANT.items())
def test_each_robot_that_is_meant_gets_its_part(sentence, goals):
    prepared = asked(sentence)
    expected = {
        name: [f"Take [Nothing] to [{goal}] and do [Nothing] to [Nothing]" for goal in each]
        for name, each in goals.items()
    }
    assert {each.mission.robot_name: [*map(str, each.tree.commands)] for each in prepared.all} == expected


def test_all_robots_of_the_run_are_known_also_one_with_nothing_to_do():
    assert list(asked("Hey Bob, go to the kitchen").robots) == ["Alice", "Bob"]


def test_path_ids_carry_the_robots_name():
    trees = [each.tree for each in asked("Alice, go to the kitchen, and Bob, go to the office").all]
    ids = {node.path_id.partition("/")[0] for tree in trees for node in tree.root.walk()}
    assert ids == {"alice", "bob"}


def test_a_sentence_without_a_name_goes_to_the_fastest_robot():
    near_the_office = (TWO[0], RobotConfig("Bob", "spot", start=asked_pose()))
    assert asked("go to the office", near_the_office).mission.robot_name == "Bob"


def asked_pose():
    prepared = asked("Hey Bob, go to the office")
    pose = prepared.knowledge.place_pose("office")
    return Pose2D(pose.x, pose.y, pose.yaw)


def test_a_robot_that_needs_what_another_brings_waits_for_it():
    prepared = asked("Alice, put the coke on the kitchen table, then let Bob bring it to Robin")
    waits = {each.mission.robot_name: each.after for each in prepared.all}
    assert waits == {"Alice": (), "Bob": ("Alice",)}


def test_a_mission_file_goes_to_the_robot_that_is_done_first(tmp_path):
    file = tmp_path / "go.yaml"
    file.write_text("name: go\nsteps:\n  - to: office\n", encoding="utf-8")
    robots = (TWO[0], RobotConfig("Bob", "fetch", start=asked_pose()))
    prepared = prepare(Request(file=file, robots=robots), ask=None)
    assert (prepared.mission.robot_name, prepared.robot.kind) == ("Bob", "fetch")


@pytest.mark.parametrize(
    ("sentence", "require_wake", "says"),
    [
        ("sing", False, "sing"),
        ("fetch me a drink", True, "Hey Alice"),
        ("put the coke on the table", False, "kitchen table or coffee table"),
    ],
)
def test_a_sentence_that_is_not_understood_is_refused_with_the_reason(sentence, require_wake, says):
    with pytest.raises(InputError, match=says):
        prepare(Request(sentence=sentence, world="flat", require_wake=require_wake))


def test_a_sentence_to_a_robot_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="Carl"):
        asked("Hey Carl, go to the kitchen")


PARTS = """name: two
robots:
  alice: spot
  bob: fetch
parts:
  bob:
    after: alice
    steps: [{to: office}]
  alice:
    steps: [{to: kitchen}]
"""


@pytest.fixture
def asked_file(tmp_path):
    def of(text, **request):
        (tmp_path / "two.yaml").write_text(text, encoding="utf-8")
        return prepare(Request(file=tmp_path / "two.yaml", **request), ask=None)

    return of


def test_a_file_with_parts_has_a_mission_for_each_robot_in_the_order_of_the_robots(asked_file):
    every = asked_file(PARTS).all
    goals = {each.mission.robot_name: [command.goal for command in each.tree.commands] for each in every}
    assert list(goals.items()) == [("Alice", ["kitchen"]), ("Bob", ["office"])]
    assert [(each.robot.kind, each.after) for each in every] == [("spot", ()), ("fetch", ("Alice",))]


def test_the_option_replaces_the_robots_of_a_file(asked_file):
    every = asked_file(PARTS, robots=TWO).all
    assert [each.robot.kind for each in every] == ["spot", "spot"]


def test_a_file_with_robots_and_steps_goes_to_the_robot_that_it_names(asked_file):
    prepared = asked_file("name: go\nrobots: {alice: spot, bob: spot}\nrobot: bob\nsteps: [{to: kitchen}]\n")
    assert (prepared.mission.robot_name, list(prepared.robots)) == ("Bob", ["Alice", "Bob"])


@pytest.fixture
def world_of_two(tmp_path):
    """A world that names two robots; what is written into its knowledge before is changed."""

    def of(said="", instead=""):
        world = tmp_path / "world"
        shutil.copytree(open_world("flat").folder, world)
        known = world / "knowledge.yaml"
        text = known.read_text(encoding="utf-8").replace(said, instead)
        known.write_text(f"robots: {{eve: spot, bob: fetch}}\n{text}", encoding="utf-8")
        return str(world)

    return of


def test_a_world_may_name_its_robots(world_of_two):
    prepared = prepare(Request("Hey Bob, go to the kitchen", world=world_of_two()), ask=None)
    assert (prepared.mission.robot_name, prepared.robot.kind, list(prepared.robots)) == ("Bob", "fetch", ["Eve", "Bob"])


def test_a_world_may_ask_that_one_of_its_robots_is_called(world_of_two):
    world = world_of_two("robot: {name: Alice}", "robot: {name: Alice, require_wake: true}")
    refuse_unaddressed(Request("Hey Bob, go to the kitchen", world=world))
    assert prepare(Request("Hey Bob, go to the kitchen", world=world), ask=None).mission.robot_name == "Bob"
    with pytest.raises(InputError, match='begin with "Hey Eve" or "Hey Bob"'):
        prepare(Request("go to the kitchen", world=world), ask=None)


def test_any_of_the_robots_of_the_option_may_be_called():
    robots = (RobotConfig("Alice", "spot"), RobotConfig("Bob", "spot"))
    refuse_unaddressed(Request("Hey Bob, go to the kitchen", require_wake=True, robots=robots))


REFUSED = yaml_beside(__file__, "refused_parts.yaml")


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case["message"])
def test_errors_in_the_robots_of_a_file_name_their_line(asked_file, case):
    assert case["old"] in PARTS
    with pytest.raises(InputError, match=re.escape(case["message"])) as error:
        asked_file(PARTS.replace(case["old"], case["new"]))
    assert error.value.line == case["line"]


def test_all_parts_that_are_wrong_are_told_at_once(asked_file):
    with pytest.raises(InputError) as error:
        asked_file(PARTS.replace("kitchen", "kichen").replace("office", "ofice"))
    assert [each.line for each in (error.value, *error.value.others)] == [10, 8]


def test_parts_without_robots_are_refused(asked_file):
    with pytest.raises(InputError, match="parts are for several robots"):
        asked_file(PARTS.replace("robots:\n  alice: spot\n  bob: fetch\n", ""))


@pytest.mark.parametrize("own", [{"start": Pose2D(2.0, 4.5, 0.0)}, {"stack": Path("stack.yaml")}])
def test_a_start_or_stack_for_one_robot_is_refused(own):
    with pytest.raises(InputError, match="are for a run with one robot"):
        prepare(Request("Hey Bob, go to the kitchen", robots=TWO, **own), ask=None)


def test_the_parts_of_different_files_have_different_prints(asked_file):
    texts = (PARTS, PARTS.replace("[{to: office}]", "[{to: office}, {dock: }]"))
    assert len({asked_file(text).request.fingerprint for text in texts}) == 2


def test_a_mask_is_read_again_before_each_run_and_refused_where_it_cannot_be(tmp_path):
    zones = "knowledge: {zones: {wet: {kind: keep_out, mask: mask.yaml}}}"
    (tmp_path / "go.yaml").write_text(f"name: go\n{zones}\nsteps: [{{say: go to the kitchen}}]\n", encoding="utf-8")
    text = "image: mask.pgm\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    (tmp_path / "mask.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "mask.pgm").write_bytes(b"P5 2 2 255\n" + bytes(4))
    prepare(Request(file=tmp_path / "go.yaml"), ask=None)
    (tmp_path / "mask.pgm").unlink()
    with pytest.raises(InputError) as caught:
        prepare(Request(file=tmp_path / "go.yaml"), ask=None)
    assert (caught.value.file, caught.value.line) == (tmp_path / "mask.yaml", 1)


# the third pose is free ground, but Spot's body would stand in the wall beside it
@pytest.mark.parametrize(
    ("at", "right"),
    [("x: 8.4, y: 6.5", True), ("x: 7.5, y: 8.6", False), ("x: 3.0, y: 4.0, yaw: 1.57", False), ("x: -3, y: 1", False)],
)
def test_a_named_pose_of_a_mission_is_on_free_ground(tmp_path, at, right):
    pump = f"knowledge:\n  places:\n    pump: {{pose: {{{at}}}}}\n"
    file = tmp_path / "go.yaml"
    file.write_text(f"name: go\n{pump}steps: [{{to: pump}}]\n", encoding="utf-8")
    if right:
        (command,) = prepare(Request(file=file), ask=None).tree.commands
        assert command.goal == "pump"
        return
    with pytest.raises(InputError, match=r"places\.pump: .* stands in an obstacle or outside of the map") as caught:
        prepare(Request(file=file), ask=None)
    assert (caught.value.file, caught.value.line) == (file, 4)


def test_people_of_a_variation_walk_in_the_world(tmp_path):
    request = Request("bring me a beer", world="flat", seed=2, out=tmp_path, variation=Variation(people=2))
    walking = {each.name for each in place_people(prepare(request, ask=None).world, 2) if each.route is not None}
    assert {"passer-by 1", "passer-by 2"} <= walking


def broken_knowledge(world):
    file = world / "knowledge.yaml"
    file.write_text(file.read_text().replace("places:\n", "places:\n  pump: {polygon: [[1, 1], [2, 1], [2, 2]]}\n", 1))
    return f"{file}:8: key 'pose' is missing in places.pump (used by {{mission}}:2); add 'pose'"


def missing_knowledge(world):
    (world / "knowledge.yaml").unlink()
    return f"{world / 'knowledge.yaml'}: there is no such file (used by {{mission}}:2); every world needs this file"


def broken_model(world):
    (world / "gauge").mkdir()
    (world / "gauge" / "object.yaml").write_text("name: [gauge]\n")
    lines = (world / "objects.yaml").read_text().count("\n") + 1
    with (world / "objects.yaml").open("a") as file:
        file.write("imports: [gauge]\n")
    users = f"(used by {world / 'objects.yaml'}:{lines}) (used by {{mission}}:2)"
    return f"{world / 'gauge' / 'object.yaml'}:1: name: should be a text {users}; it reads a list now"


@pytest.mark.parametrize("breaks", [broken_knowledge, missing_knowledge, broken_model])
def test_a_fault_in_a_file_of_the_world_is_named_in_that_file(breaks, tmp_path):
    world = tmp_path / "depot"
    shutil.copytree(open_world("flat").folder, world)
    mission = tmp_path / "round.yaml"
    mission.write_text(f"name: round\nworld: {world}\nsteps: [{{to: hall}}]\n")
    says = breaks(world).format(mission=mission)
    with pytest.raises(InputError) as refused:
        prepare(Request(file=mission))
    assert str(refused.value).removesuffix(", or make it by `errand object import`") == says
