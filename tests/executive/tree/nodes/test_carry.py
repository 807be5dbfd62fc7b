"""Where an object is looked for that fell on the way, and what is said about it."""

import math
from dataclasses import replace
from types import MappingProxyType

import pytest
from py_trees.common import Status

from executive.tree.nodes.carry import Fallen, SurfacesNear
from skills.api import Cause, Surface
from skills.robot import Pose2D
from skills.testing.blocks import Block
from skills.testing.estimators import BlockCostmap

NEAR = Surface("bench", ((1.0, 0.5), (2.0, 0.5), (2.0, 1.0)), 0.8)
FAR = Surface("shelf", ((4.0, 0.0), (5.0, 0.0), (5.0, 1.0)), 0.8)


@pytest.fixture
def leaf(context):
    keys = {f"{name}_key": f"alice/{name}" for name in ("pose", "spot", "floor", "around", "set_down")}
    return Fallen(
        path_id="alice/fell", name="fell", item="hammer", to="to the kitchen", surfaces=(NEAR, FAR), context=context,
        **keys,
    )  # fmt: skip


def ended(leaf, clock):
    """Tick it to its end."""
    while leaf.status is not Status.SUCCESS:
        leaf.tick_once()
        clock.advance(0.1)
    return leaf


def test_it_says_what_happened(leaf, clock):
    assert ended(leaf, clock).message == "the hammer has left the gripper on the way to the kitchen; it is looked for"


def test_an_object_that_is_felt_after_all_has_slipped(leaf, clock, robot):
    leaf.tick_once()
    robot.holding = True
    told = "the hammer slips in the gripper on the way to the kitchen; it is set down and gripped again"
    assert ended(leaf, clock).message == told


def test_the_floor_is_that_about_the_point_where_it_fell_and_the_surfaces_are_those_near(leaf, clock, robot, context):
    robot.standing = Pose2D(1.0, 0.0, math.pi / 2)
    leaf.tick_once()
    robot.standing = Pose2D(1.0, 0.5, math.pi / 2)
    ended(leaf, clock)
    (floor,) = context.board.get("alice/floor")
    middle = [sum(axis) / 4 for axis in zip(*floor.polygon_W, strict=True)]
    assert middle == pytest.approx([1.0, 0.6])
    assert context.board.get("alice/spot") == pytest.approx((1.0, 0.6, 0.0))
    assert [surface.name for surface in context.board.get("alice/around")] == ["floor", "bench"]
    assert context.board.get("alice/pose") == Pose2D(1.0, 0.0, math.pi / 2)


def test_it_is_set_down_before_where_the_robot_has_come_to_rest(leaf, clock, robot, context):
    leaf.tick_once()
    robot.standing = Pose2D(0.5, 0.0, 0.0)
    ended(leaf, clock)
    xs, _ = zip(*context.board.get("alice/set_down").polygon_W, strict=True)
    assert (min(xs), max(xs)) == pytest.approx((1.35, 1.95))


def test_a_slipped_object_is_looked_for_where_it_is_set_down(leaf, clock, robot, context):
    robot.holding = True
    leaf.context = replace(context, costmap=BlockCostmap([Block(0.75, -0.4, 1.55, 0.4, z1=1.0)]))
    ended(leaf, clock)
    turn = math.radians(60)
    middle = [1.15 * math.cos(turn), 1.15 * math.sin(turn)]
    (floor,) = context.board.get("alice/floor")
    assert [sum(axis) / 4 for axis in zip(*floor.polygon_W, strict=True)] == pytest.approx(middle)
    assert context.board.get("alice/spot") == pytest.approx((*middle, 0.0))
    assert context.board.get("alice/pose").yaw_rad == pytest.approx(turn)
    assert [surface.name for surface in context.board.get("alice/around")] == ["floor", "bench"]


def test_it_begins_again_with_where_the_robot_is_then(leaf, clock, robot, context):
    ended(leaf, clock)
    robot.standing = Pose2D(3.0, 0.0, 0.0)
    leaf.tick_once()
    assert (leaf.status, context.board.get("alice/pose")) == (Status.RUNNING, Pose2D(3.0, 0.0, 0.0))


# Where obstacles stand (their middles), each 0.8 m wide -> the turn (degrees) of the floor on which it is set down.
@pytest.mark.parametrize(
    ("obstacles", "turn_deg"),
    [
        ([], 0),
        ([(1.15, 0.0)], 60),
        ([(1.15, 0.0), (0.6, 1.0)], -60),
        ([(1.15 * math.cos(k * math.pi / 6), 1.15 * math.sin(k * math.pi / 6)) for k in range(12)], 0),
    ],
)
def test_it_is_set_down_where_nothing_stands_as_straight_ahead_as_may_be(
    leaf, clock, robot, context, obstacles, turn_deg
):
    blocks = [Block(x - 0.4, y - 0.4, x + 0.4, y + 0.4, z1=1.0) for x, y in obstacles]
    leaf.context = replace(context, costmap=BlockCostmap(blocks))
    ended(leaf, clock)
    middle = [sum(axis) / 4 for axis in zip(*context.board.get("alice/set_down").polygon_W, strict=True)]
    turn = math.radians(turn_deg)
    assert middle == pytest.approx([1.15 * math.cos(turn), 1.15 * math.sin(turn)])


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
