"""The blackboard of a run, and what ports read from it."""

import math

import pytest

from executive.tree.board import BesideBoard, Board, FromBoardOr, SurfaceOfDetection
from skills.api import Surface
from skills.robot import Pose2D


def test_a_board_forgets():
    board = Board("alice")
    board.put("alice/a", 1)
    board.forget(["alice/a", "alice/never"])
    assert "alice/a" not in board


def test_a_port_may_have_a_value_until_something_is_written():
    board, port = Board("alice"), FromBoardOr("alice/a", 5)
    assert port.read(board) == 5
    board.put("alice/a", 6)
    assert port.read(board) == 6


def test_a_port_may_be_a_pose_beside_one_on_the_board():
    board = Board("alice")
    board.put("alice/pose", Pose2D(1.0, 2.0, math.pi / 2))
    pose = BesideBoard("alice/pose", 0.5, 0.25).read(board)
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((0.75, 2.5, math.pi / 2))


def test_a_port_may_be_the_surface_of_a_detection(make):
    board = Board("alice")
    board.put("alice/seen", make.COKE)
    tops = tuple(Surface(name, ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), 0.9) for name in ("shelf", "counter"))
    assert SurfaceOfDetection("alice/seen", tops).read(board) == tops[1:]
    assert SurfaceOfDetection("alice/seen", tops[:1]).read(board) == tops[:1]


@pytest.mark.parametrize("key", ["bob/x", "alice/a.b", "alice"])
def test_board_refuses_foreign_and_dotted_keys(key):
    with pytest.raises(ValueError, match="blackboard key"):
        Board("alice").put(key, 1)


def test_board_says_what_was_not_written():
    with pytest.raises(KeyError, match="alice/x"):
        Board("alice").get("alice/x")
