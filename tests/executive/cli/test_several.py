"""What several robots are asked for becomes a mission for each."""

import pytest

from executive.cli.requests import prepare
from executive.mission.errors import InputError
from executive.mission.request import Request
from executive.mission.robots import RobotSetup
from skills.robot import Pose2D

TWO = {"alice": RobotSetup("spot"), "bob": RobotSetup("spot")}

# Sentence, and the commands of each robot.
MEANT = [
    ("Hey Bob, go to the kitchen", {"Bob": ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"]}),
    (
        "Alice, go to the kitchen, and Bob, go to the office",
        {
            "Alice": ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"],
            "Bob": ["Take [Nothing] to [office] and do [Nothing] to [Nothing]"],
        },
    ),
    (
        "Hey everyone, go to the kitchen",
        {
            "Alice": ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"],
            "Bob": ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"],
        },
    ),
]


def asked(sentence, robots=TWO):
    return prepare(Request(sentence, robots=robots), ask=None)


@pytest.mark.parametrize(("sentence", "expected"), MEANT)
def test_each_robot_that_is_meant_gets_its_part(sentence, expected):
    prepared = asked(sentence)
    assert {each.mission.robot_name: [*map(str, each.tree.commands)] for each in prepared.all} == expected


def test_all_robots_of_the_run_are_known_also_one_with_nothing_to_do():
    assert list(asked("Hey Bob, go to the kitchen").robots) == ["Alice", "Bob"]


def test_path_ids_carry_the_robots_name():
    trees = [each.tree for each in asked("Alice, go to the kitchen, and Bob, go to the office").all]
    ids = {node.path_id.partition("/")[0] for tree in trees for node in tree.root.walk()}
    assert ids == {"alice", "bob"}


def test_what_is_for_nobody_goes_to_the_robot_that_is_there_first():
    near_the_office = {**TWO, "bob": RobotSetup("spot", start=asked_pose())}
    assert asked("go to the office", near_the_office).mission.robot_name == "Bob"


def asked_pose():
    prepared = asked("Hey Bob, go to the office")
    pose = prepared.knowledge.place_pose("office")
    return Pose2D(pose.x, pose.y, pose.yaw)


def test_one_who_needs_what_another_brings_begins_when_that_one_is_done():
    prepared = asked("Alice, put the coke on the kitchen table, then let Bob bring it to Robin")
    waits = {each.mission.robot_name: each.after for each in prepared.all}
    assert waits == {"Alice": (), "Bob": ("Alice",)}


def test_a_mission_file_goes_to_the_robot_that_is_done_first(tmp_path):
    file = tmp_path / "go.yaml"
    file.write_text("name: go\nsteps:\n  - to: office\n", encoding="utf-8")
    robots = {**TWO, "bob": RobotSetup("fetch", start=asked_pose())}
    prepared = prepare(Request(file=file, robots=robots), ask=None)
    assert (prepared.mission.robot_name, prepared.kind) == ("Bob", "fetch")


def test_a_sentence_to_a_robot_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="Carl"):
        asked("Hey Carl, go to the kitchen")
