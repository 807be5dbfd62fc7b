"""The small leaves and the blackboard."""

import pytest
from py_trees.common import Status

from executive.behaviours.board import Board
from executive.behaviours.context import leaf_seed
from executive.behaviours.leaves import Known, RememberPose
from skills.api import Cause
from skills.robot import Pose2D


def test_remember_pose_writes_the_pose(context):
    leaf = RememberPose(path_id="alice/m/start", name="start", key="alice/m/pose", context=context)
    leaf.tick_once()
    assert leaf.status == Status.SUCCESS
    assert context.board.get("alice/m/pose") == Pose2D(0.0, 0.0, 0.0)


def test_remember_pose_waits_until_localised_and_gives_up(context, clock):
    context.localiser.localised = False
    leaf = RememberPose(path_id="alice/m/start", name="start", key="alice/m/pose", context=context, patience_s=1.0)
    leaf.tick_once()
    assert leaf.status == Status.RUNNING
    clock.advance(1.1)
    leaf.tick_once()
    assert (leaf.status, leaf.cause) == (Status.FAILURE, Cause.PRECONDITION)


def test_known_looks_for_a_key(context):
    leaf = Known(path_id="alice/k", name="k", key="alice/x", missing="no x", context=context)
    leaf.tick_once()
    assert (leaf.status, leaf.cause, leaf.message) == (Status.FAILURE, Cause.PRECONDITION, "no x")
    context.board.put("alice/x", 1)
    leaf.tick_once()
    assert (leaf.status, leaf.cause) == (Status.SUCCESS, None)


@pytest.mark.parametrize("key", ["bob/x", "alice/a.b", "alice"])
def test_board_refuses_foreign_and_dotted_keys(key):
    with pytest.raises(ValueError, match="blackboard key"):
        Board("alice").put(key, 1)


def test_board_says_what_was_not_written():
    with pytest.raises(KeyError, match="alice/x"):
        Board("alice").get("alice/x")


def test_leaf_seeds_differ_by_path_and_run_and_stay():
    assert leaf_seed(1, "alice/a") == leaf_seed(1, "alice/a") == 885863618
    assert len({leaf_seed(1, "alice/a"), leaf_seed(2, "alice/a"), leaf_seed(1, "alice/b")}) == 3
