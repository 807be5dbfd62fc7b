import pytest
from py_trees.common import Status

from executive.conversation.replies import doing_in_words, place_in_words
from executive.run.control import Control
from executive.run.visitor import Progress
from executive.tree.node import NodeState
from skills.api import Cause
from skills.robot import Pose2D


@pytest.mark.parametrize(
    ("x_m", "y_m", "words"),
    [
        (0.0, 0.3, "I am in the hall"),
        (5.5, -1.0, "I am in the kitchen, next to the counter"),
        (5.9, 1.9, "I am in the kitchen, next to the shelf"),
        (4.0, -1.5, "I am in the kitchen, next to the counter"),
        (20.0, 2.0, "I am 14.0 m from the kitchen"),
    ],
)
def test_place_is_described_by_its_room_and_the_nearest_surface(knowledge, x_m, y_m, words):
    assert place_in_words(Pose2D(x_m, y_m, 0.0), knowledge) == words


def test_a_lost_robot_says_so(knowledge):
    assert "do not know where I am" in place_in_words(None, knowledge)


@pytest.fixture
def progress(compiled, make):
    tree = compiled(*make.FETCH)

    def at(**states):
        nodes = {path_id: NodeState() for path_id in tree.path_ids}
        nodes |= {f"alice/fetch-drink/1-kitchen/{name}": state for name, state in states.items()}
        return Progress(3.0, 60, 0, {"Alice": nodes}, {"Alice": tree})

    return at


@pytest.fixture
def control(compiled, make):
    control = Control()
    control.begin({"Alice": compiled(*make.FETCH)})
    return control


def test_reply_gives_the_step_with_its_message(progress, control):
    now = progress(grasp=NodeState(Status.RUNNING, None, "closing the gripper", 0.5))
    words = doing_in_words(now, control.state, "Alice")
    assert words == "I am busy with 'fetch drink': grasp, closing the gripper (50 %)"


def test_reply_says_why_the_robot_stands_still(progress, control):
    control.pause("somebody walks by")
    words = doing_in_words(progress(grasp=NodeState(Status.RUNNING)), control.state, "Alice")
    assert words == "I stand still (somebody walks by); then I go on with 'fetch drink': grasp"


def test_reply_gives_the_last_failure_with_its_cause(progress, control):
    failed = NodeState(Status.FAILURE, Cause.EXECUTION, "it slipped")
    words = doing_in_words(progress(grasp=failed), control.state, "Alice")
    assert "before, grasp failed (EXECUTION: it slipped)" in words


def test_after_the_run_there_is_nothing_to_do(progress, control):
    control.end()
    assert "nothing to do" in doing_in_words(progress(), control.state, "Alice")
