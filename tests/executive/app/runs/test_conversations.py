"""What is said in a run with several robots: who of them is meant."""

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.conversations import Conversations
from executive.conversation import ReplyKind
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.control_state import Mode
from executive.words.robot_config import RobotConfig
from tests.tables import yaml_beside

SAID = yaml_beside(__file__, "remarks_to_robots.yaml")

TWO = (RobotConfig("Alice", "spot"), RobotConfig("Bob", "spot"))


@pytest.fixture(scope="module")
def prepared():
    return prepare(Request("Alice, go to the kitchen, and Bob, go to the office", robots=TWO), ask=None)


@pytest.fixture
def control(prepared):
    control = Control(attended=True)
    control.begin({each.mission.robot_name: each.tree for each in prepared.all})
    return control


@pytest.fixture
def talk(prepared, control):
    talk = Conversations(prepared, control)
    talk.set_missions()
    return talk


def modes(control):
    return {name: each.mode.value for name, each in control.state.robots.items()}


@pytest.mark.parametrize(("text", "robot", "expected"), SAID["remarks"])
def test_a_remark_is_for_the_robot_that_it_names_and_without_a_name_for_all(talk, control, text, robot, expected):
    assert talk.hear(text, robot).kind is ReplyKind.DONE
    assert modes(control) == expected
    assert control.state.mode is Mode.RUNNING


def test_one_robot_is_told_to_go_on_and_the_other_stays(talk, control):
    talk.hear("wait")
    assert (talk.hear("Bob, go on").text, modes(control)) == ("I go on", {"Alice": "paused", "Bob": "running"})


def test_one_robot_does_not_go_on_while_all_are_paused(talk, control):
    control.pause("a fire drill")
    reply = talk.hear("go on", "Bob")
    assert (reply.kind, reply.text) == (ReplyKind.REFUSED, "a fire drill, as all robots are; say so to all of them")


@pytest.mark.parametrize(
    ("text", "robot", "expected"),
    SAID["requests"],
)
def test_a_request_becomes_a_mission_of_the_robot_that_is_meant(talk, control, text, robot, expected):
    talk.hear(text, robot)
    trees = [request.tree for request in control.poll().missions]
    assert {tree.robot_name: tree.commands[0].goal for tree in trees} == expected


def test_the_question_of_a_robot_is_answered_to_it(talk, control):
    asked = []
    talk.listen(lambda name, waiting: asked.append((name, waiting is not None)))
    talk.hear("put the cube on the table", "Bob")
    talk.hear("the coffee table", "Bob")
    assert asked == [("Bob", True), ("Bob", False)]
    (tree,) = (request.tree for request in control.poll().missions)
    assert (tree.robot_name, tree.commands[-1].goal) == ("Bob", "coffee table")


def test_a_robot_with_nothing_to_do_hears_nothing(talk):
    assert talk.hear("wait", "Carl").kind is ReplyKind.REFUSED
