"""Free spots on a seen surface, and hand poses that put an object down there."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from plant.robots.spot.kind import spot_capabilities
from skills.api import Detection, Surface
from skills.geometry import SPOT_EDGE_M, surface_spots
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.held_object import HeldObject
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.motion import RrtConnect
from skills.manipulation.place.free_spots import (
    BESIDE_M,
    CLEARANCE_M,
    SpotSearch,
    above_goal,
    clear_heights,
    clear_spots,
    free_area,
    free_spots,
    hold_on_path,
    longest_edge_rad,
    spaced_spots,
    unseen_view,
)
from skills.perception.detection_3d import Detection3D
from skills.perception.fitting import LevelPlane, SeenShape
from skills.perception.point_cloud import PointCloud
from skills.perception.surface_segmentation import Cluster, SurfaceView
from skills.relations import Landmark, Relation, RelationKind

TABLE = Surface("table", ((1.0, -0.5), (1.6, -0.5), (1.6, 0.5), (1.0, 0.5)), 0.7)
SPOTS = surface_spots(TABLE.polygon_W)
DOWN = RotationMatrix.MakeYRotation(np.pi / 2)
SCREWDRIVER = HeldObject(
    DOWN, np.array([[x, y, z] for x in (0.21, 0.24) for y in (-0.1, 0.1) for z in (-0.015, 0.015)])
)
"""A screwdriver that lies along the y axis of a hand that points down."""
PLANE = LevelPlane((1.3, 0.0), 0.7, (0.0, 0.0), 0.002)
MODEL = arm_model(spot_capabilities())
LEVEL_FORWARD = RotationMatrix.MakeXRotation(np.pi / 2)
"""A hand that points ahead and closes level, as after a grasp from the side."""
KITCHEN_TABLE = Surface("kitchen table", ((0.75, -0.5), (1.3, -0.5), (1.3, 0.5), (0.75, 0.5)), 0.7)
CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])


def _cloud(xy, z=0.7):
    points = np.column_stack([xy, np.full(len(xy), z)])
    return PointCloud(points, np.zeros((len(xy), 2), np.int64), np.zeros((len(xy), 3), np.uint8))


def _view(seen_y=(-0.5, 0.5), things=()):
    grid = np.stack(np.meshgrid(np.arange(1.0, 1.6, 0.01), np.arange(*seen_y, 0.01)), -1).reshape(-1, 2)
    clusters = tuple(
        Cluster(
            _cloud(np.array([thing]), 0.8), "table", PLANE, SeenShape(thing, 0.07, 0.07, 0.1, 0.0, True), (0, 0, 1, 1)
        )
        for thing in things
    )
    return SurfaceView(PLANE, _cloud(grid), clusters)


def test_spots_keep_off_the_edges():
    found = SPOTS
    assert found[:, 0].min() == pytest.approx(1.0 + SPOT_EDGE_M)  # no nearer to the robot than need be
    assert found[:, 0].max() <= 1.6 - SPOT_EDGE_M + 1e-9


def test_a_small_surface_has_its_middle_as_spot():
    small = Surface("stool", ((0.0, 0.0), (0.12, 0.0), (0.12, 0.12), (0.0, 0.12)), 0.4)
    assert surface_spots(small.polygon_W) == pytest.approx(np.array([[0.06, 0.06]]))


def test_spots_within_a_forbidden_circle_are_left_out():
    found = clear_spots(SPOTS, [(1.3, 0.0, 0.25), (1.1, -0.4, 0.1)])
    assert 0 < len(found) < len(SPOTS)
    assert np.linalg.norm(found - [1.3, 0.0], axis=1).min() > 0.25
    assert np.linalg.norm(found - [1.1, -0.4], axis=1).min() > 0.1


def test_spots_near_an_object_are_not_free():
    free = free_spots(_view(things=((1.3, 0.0),)), SPOTS)
    assert len(free) > 0
    assert np.linalg.norm(free - [1.3, 0.0], axis=1).min() > CLEARANCE_M


def test_an_unseen_spot_is_not_free():
    free = free_spots(_view(seen_y=(0.0, 0.5)), SPOTS)
    assert free[:, 1].min() > -0.04


def test_a_full_table_has_no_free_spot():
    things = tuple((x, y) for x in np.arange(1.05, 1.6, 0.1) for y in np.arange(-0.45, 0.5, 0.1))
    assert len(free_spots(_view(things=things), SPOTS)) == 0


def test_a_clear_spot_comes_before_a_nearer_one_beside_an_object_and_a_tried_one_is_left_out():
    search = SpotSearch(TABLE, SCREWDRIVER)
    search.add(_view(things=[(1.3, -0.15)]), np.array([1.3, -0.4]))
    best, *_ = search.others(np.array([0.5, -0.2]))
    assert np.linalg.norm(best - [1.3, -0.15]) > 0.25
    search.pass_over([best])
    assert np.linalg.norm(search.others(np.array([0.5, -0.2]))[0] - best) > 0.19


def test_the_part_of_a_surface_that_no_picture_shows_comes_after_the_free_part():
    search = SpotSearch(TABLE, SCREWDRIVER)
    search.add(_view(seen_y=(-0.5, 0.0), things=[(x, -0.25) for x in (1.1, 1.2, 1.3, 1.4, 1.5)]), np.array([1.1, -0.4]))
    ends = [spot[1] for spot in search.others(np.array([0.5, -0.2]))]
    assert ends[0] < 0.0 < 0.1 < ends[-1]
    assert not search.tight


def test_a_hidden_surface_is_free_except_near_known_objects():
    free = free_spots(unseen_view(TABLE, np.array([[1.3, 0.0, 0.78]])), SPOTS)
    assert 0 < len(free) < len(SPOTS)
    assert np.linalg.norm(free - [1.3, 0.0], axis=1).min() > CLEARANCE_M - 0.04
    assert len(free_spots(unseen_view(TABLE, np.empty((0, 3))), SPOTS)) == len(SPOTS)


def test_a_narrow_object_fits_on_a_tight_spot_at_the_end_and_a_full_surface_says_what_stands_there():
    things = [(x, y) for x in (1.1, 1.25, 1.4, 1.55) for y in np.arange(-0.4, 0.4, 0.15)]
    search = SpotSearch(TABLE, SCREWDRIVER)
    search.add(_view(things=things), np.array([1.2, -0.4]))
    assert len(search.others(np.array([0.5, 0.0]))) > 0
    assert search.tight
    search.pass_over(search.others(np.array([0.5, 0.0])))
    assert search.others(np.array([0.5, 0.0])) == []
    wide = SpotSearch(TABLE, HeldObject(DOWN, SCREWDRIVER.corners_H * [1.0, 1.0, 12.0]))
    wide.add(_view(things=things), np.array([1.2, -0.4]))
    assert wide.others(np.array([0.5, 0.0])) == []
    assert wide.why_none() == "the table is full: 24 objects, the largest free spot is 20 cm"


def _above(held, xy, *, along_rad=None):
    """Hand poses over a spot of the table, by the direction of the object's long axis."""
    poses = list(held.above(np.array([*xy, 0.7]), np.zeros(3), 0.1, along_rad=along_rad))
    return {round(math.degrees(math.atan2(*X.rotation().matrix()[[1, 0], 1])) % 180.0, 1): X for X in poses}


def test_a_long_object_fits_along_the_edge_of_a_narrow_board_only():
    board = Surface("board", ((1.0, -0.5), (1.1, -0.5), (1.1, 0.5), (1.0, 0.5)), 0.7)
    area, edge_rad = free_area(board, SCREWDRIVER), longest_edge_rad(board)
    poses = _above(SCREWDRIVER, (1.05, 0.1), along_rad=edge_rad)
    assert [angle for angle, X in poses.items() if area.takes(X)] == [90.0]


def test_an_object_that_is_larger_than_the_surface_may_stick_out():
    stool = Surface("stool", ((0.0, 0.0), (0.12, 0.0), (0.12, 0.12), (0.0, 0.12)), 0.4)
    assert free_area(stool, SCREWDRIVER).top is None


def test_an_outline_keeps_off_others_and_off_the_edge():
    area = free_area(TABLE, SCREWDRIVER, _view(things=[(1.3, 0.0)]))
    (lying,) = (X for angle, X in _above(SCREWDRIVER, (1.3, 0.3), along_rad=math.pi / 2).items() if angle == 90.0)
    for shift_m, free in ((0.0, True), (-0.3 + 0.1 + BESIDE_M - 0.005, False), (0.1, False)):
        assert area.takes(RigidTransform(lying.rotation(), lying.translation() + [0.0, shift_m, 0.0])) is free


def test_spaced_spots_keep_their_order_and_distance():
    free = np.array([[0.0, 0.0], [0.1, 0.0], [0.3, 0.0], [0.4, 0.0], [0.0, 0.25]])
    assert np.array_equal(spaced_spots(free), free[[0, 2, 4]])


def test_a_held_object_reaches_below_the_hand_as_far_as_its_lowest_corner():
    bottle_H = np.array([[0.15, -0.14, -0.03], [0.22, 0.08, 0.03]])
    held = HeldObject(LEVEL_FORWARD, bottle_H)  # the hand's y axis points up
    assert held.drop_m(LEVEL_FORWARD) == pytest.approx(0.14)
    assert [held.drop_m(each) for each in held.rotations(0.7)] == pytest.approx([0.14] * 3)
    assert held.p_HO == pytest.approx([0.185, -0.03, 0.0])


def test_an_object_taken_from_above_is_placed_with_the_fingers_down_at_any_turn():
    turned = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.zeros((2, 3))).rotations(0.3)
    assert len(turned) == 8
    assert [each.matrix()[2, 0] for each in turned] == pytest.approx([-1.0] * 8)


# What stands beside the first of two spots (m to its side) -> the spot that is taken
@pytest.mark.parametrize(("beside_m", "taken"), [(None, 0), (0.35, 0), (0.12, 1), (-0.12, 1)])
def test_a_spot_is_left_out_where_the_open_hand_would_touch_a_tall_neighbour(beside_m, taken):
    spots_B = [np.array([0.85, y, 0.02]) for y in (0.0, -0.5)]
    beside = [] if beside_m is None else [Box(RigidTransform([0.8, beside_m, 0.2]), (0.1, 0.1, 0.3))]
    scene = ArmScene(spot_capabilities(), MODEL, {})
    can_H = np.array([[0.15, -0.05, -0.03], [0.22, 0.06, 0.03]])
    goal = above_goal(spots_B, HeldObject(LEVEL_FORWARD, can_H), RrtConnect(), beside, 0.7)
    above = MODEL.X_BH(goal(scene, CARRYING)).translation()
    assert int(np.argmin([abs(above[1] - spot[1]) for spot in spots_B])) == taken


# How high (m) a surface below the hand at its goal is -> whether the path is planned with the object in the hand
@pytest.mark.parametrize(("top_m", "held"), [(-0.3, True), (0.1, False)])
def test_the_held_object_is_checked_on_the_path_unless_it_touches_at_an_end(top_m, held):
    scene, can = ArmScene(spot_capabilities(), MODEL, {}), Box(RigidTransform([0.2, -0.08, 0.0]), (0.06, 0.16, 0.06))
    (q_goal, *_) = MODEL.inverse(RigidTransform(LEVEL_FORWARD, [0.8, 0.0, 0.25]))
    scene.set_boxes([Box(RigidTransform([1.0, 0.0, top_m - 0.05]), (0.3, 0.6, 0.1))])
    hold_on_path(lambda scene, q: q_goal, can)(scene, CARRYING)
    lower = MODEL.inverse(RigidTransform(LEVEL_FORWARD, [0.8, 0.0, top_m + 0.1]))[0]
    assert scene.free(q_goal)
    assert scene.free(lower) is not held


HAMMER = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.array([[0.22, -0.15, -0.05], [0.26, 0.15, 0.05]]))
BOTTLE = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.array([[0.1, -0.04, -0.04], [0.3, 0.04, 0.04]]))


# Held by fingers that point down -> (how far over the surface in m, how tilted in rad) it is brought, the best first
@pytest.mark.parametrize(
    ("held", "ways"), [(HAMMER, [(0.10, 0.0), (0.05, 0.0), (0.05, 0.3)]), (BOTTLE, [(0.10, 0.0), (0.05, 0.0)])]
)
def test_only_flat_objects_are_put_down_tilted(held, ways):
    assert held.approaches() == ways


# A spot ahead (m), 0.1 m above the shoulder -> how far over it and how tilted a hammer is brought
@pytest.mark.parametrize(("ahead_m", "way"), [(0.75, (0.10, 0.0)), (0.82, (0.05, 0.0)), (0.95, (0.05, 0.3))])
def test_a_far_spot_is_reached_from_lower_and_then_tilted(ahead_m, way):
    scene, spot_B = ArmScene(spot_capabilities(), MODEL, {}), np.array([ahead_m, 0.0, 0.3])
    X_BH = MODEL.X_BH(above_goal([spot_B], HAMMER, RrtConnect(), [], 0.7)(scene, CARRYING))
    fingers = X_BH.rotation().matrix()[:, 0]
    lowest_m = X_BH.translation()[2] - HAMMER.drop_m(X_BH.rotation()) - spot_B[2]
    assert (lowest_m, math.asin(fingers[0])) == pytest.approx(way, abs=1e-6)


# Where the held object is (x, and its lowest z, with the body 0.76 m high) -> the heights that are tried.
@pytest.mark.parametrize(
    ("x_m", "low_m", "tried_m"),
    [
        (0.9, 0.9, (0.76, 0.6)),  # over the table of 0.7 m: 0.2 m of room, 1 cm of it is kept
        (0.7, 0.9, (0.76, 0.6)),  # its edge
        (0.4, 0.9, (0.76, 0.6, 0.5, 0.4)),  # before it
        (0.9, 0.5, (0.76, 0.6, 0.5, 0.4)),  # under it
    ],
)
def test_the_body_is_not_lowered_until_the_held_object_presses_on_the_surface(x_m, low_m, tried_m):
    corners_W = np.array([[x_m, y, z] for y in (-0.03, 0.03) for z in (low_m, low_m + 0.1)])
    assert tuple(clear_heights((0.76, 0.6, 0.5, 0.4), 0.76, corners_W, KITCHEN_TABLE)) == tried_m


def _seen(name, x, y, surface="table", colours=()):
    """A detection in 3D of an object on a surface."""
    detection = Detection(name, 0.9, (0.0, 0.0, 10.0, 10.0))
    covariance, colours = np.eye(3), np.array(colours, dtype=np.uint8).reshape(-1, 3)
    pixels = np.zeros((len(colours), 2), np.int64)
    at = (
        np.array([x, y, 0.76]),
        covariance,
        covariance,
        (0.07, 0.07, 0.12),
        0.0,
        np.zeros(3),
        pixels,
        colours,
        surface,
    )
    return Detection3D(0.0, detection, *at)


BEER = Landmark("beer", classes=("beer",))
RELATED = SpotSearch(TABLE, SCREWDRIVER, relations=(Relation(RelationKind.LEFT_OF, (BEER,)),))


def test_no_spot_is_free_before_the_landmark_is_seen():
    search = replace(RELATED, _seen={})
    search.add(_view(), np.array([1.2, 0.0]))
    assert len(search.spots()) > 0 and len(search.free(_view())) == 0
    search.see([_seen("coke", 1.3, 0.0), _seen("beer", 1.3, 0.0, "shelf")])
    assert search.missing() == (BEER,)
    assert search.why_none() == "no beer is seen on the table"


def test_spots_have_the_relations_once_the_landmark_is_seen():
    search = replace(RELATED, _seen={})
    search.see([_seen("beer", 1.3, -0.1)])
    free = search.free(_view(things=[(1.3, -0.1)]))
    assert len(free) > 0
    assert np.all(free[:, 1] + 0.1 > np.abs(free[:, 0] - 1.3))


def test_a_part_of_the_surface_needs_no_landmark():
    search = SpotSearch(TABLE, SCREWDRIVER, relations=(Relation(RelationKind.RIGHT_HALF),))
    assert np.max(search.free(_view())[:, 1]) < 0.0
    things = [(x, y) for x in np.arange(1.05, 1.6, 0.1) for y in np.arange(-0.45, 0.1, 0.1)]
    search.add(_view(things=things), np.array([1.2, -0.4]))
    assert search.why_none() == "no free spot of the table is on the right half"


def test_a_landmark_has_its_colour():
    red = Landmark("beer", ("red",), ("beer",))
    search = SpotSearch(TABLE, SCREWDRIVER, relations=(Relation(RelationKind.NEXT_TO, (red,)),))
    search.see([_seen("beer", 1.3, 0.0, colours=[(20, 200, 20)] * 9)])
    assert search.missing() == (red,)
    search.see([_seen("beer", 1.3, 0.0, colours=[(200, 20, 20)] * 9)])
    assert search.missing() == ()


def test_between_two_of_a_kind_needs_two_objects():
    search = SpotSearch(TABLE, SCREWDRIVER, relations=(Relation(RelationKind.BETWEEN, (BEER, BEER)),))
    search.see([_seen("beer", 1.3, 0.3), _seen("beer", 1.31, 0.32)])
    assert search.missing() == (BEER, BEER)
    search.see([_seen("beer", 1.3, -0.3)])
    assert 0 < len(search.spots()) < len(SPOTS)
