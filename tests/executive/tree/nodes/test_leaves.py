"""The small leaves and the blackboard."""

import math
from types import MappingProxyType

import pytest
from py_trees.common import Status

from executive.tree.board import BesideBoard, Board, FromBoardOr, SurfaceOfDetection
from executive.tree.context import leaf_seed
from executive.tree.nodes.fallen import SurfacesNear
from executive.tree.nodes.policies import RememberPose
from executive.tree.nodes.wait import Pause
from skills.api import Cause, Surface
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


def test_a_pause_lasts_on_the_robots_clock(context, clock):
    # time  0.0 RUNNING   0.4 RUNNING   0.5 SUCCESS
    leaf = Pause(path_id="alice/p", name="p", duration_s=0.5, clock=context.clock)
    said = []
    for step_s in (0.4, 0.1, 0.0):
        leaf.tick_once()
        said.append(leaf.status)
        clock.advance(step_s)
    assert said == [Status.RUNNING, Status.RUNNING, Status.SUCCESS]


def near_plan(context, within_m, rooms=MappingProxyType({})):
    tops = [
        Surface("far", ((3.0, 0.0), (4.0, 0.0), (4.0, 1.0)), 0.9),
        Surface("near", ((1.0, -1.0), (2.0, 0.0), (1.0, 1.0)), 0.9),
    ]
    return SurfacesNear(
        path_id="alice/n", name="n", surfaces=tops, within_m=within_m, key="alice/near", otherwise="so what",
        context=context, rooms=rooms,
    )  # fmt: skip


@pytest.mark.parametrize(("within_m", "names"), [(2.0, ["near"]), (5.0, ["near", "far"])])
def test_surfaces_near_are_written_the_nearest_first(context, within_m, names):
    leaf = near_plan(context, within_m)
    leaf.tick_once()
    assert leaf.status == Status.SUCCESS
    assert [surface.name for surface in context.board.get("alice/near")] == names


@pytest.mark.parametrize(("here", "names"), [("far", ["far"]), ("neither", ["near", "far"])])
def test_of_a_room_with_the_robot_only_its_surfaces_are_near(context, here, names):
    around, away = ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)), ((8.0, 8.0), (9.0, 8.0), (9.0, 9.0))
    leaf = near_plan(context, 5.0, {name: around if name == here else away for name in ("near", "far")})
    leaf.tick_once()
    assert [surface.name for surface in context.board.get("alice/near")] == names


def test_no_surface_near_says_what_that_means(context):
    leaf = near_plan(context, 0.5)
    leaf.tick_once()
    assert (leaf.status, leaf.cause) == (Status.FAILURE, Cause.POSTCONDITION)
    assert leaf.message == "there is no surface within 0.5 m of (0.00, 0.00) m; so what"


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


def test_leaf_seeds_differ_by_path_and_run_and_stay():
    assert leaf_seed(1, "alice/a") == leaf_seed(1, "alice/a") == 885863618
    assert len({leaf_seed(1, "alice/a"), leaf_seed(2, "alice/a"), leaf_seed(1, "alice/b")}) == 3
