"""Planned arm paths: free of contact, within limits, refused where they must be."""

from contextlib import suppress
from itertools import pairwise

import numpy as np
import pytest
from pydrake.math import RigidTransform

from plant.robots.fetch.kind import FETCH
from plant.robots.spot.kind import spot_capabilities
from skills.api import PlanningError
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.motion import RrtConnect
from skills.manipulation.arm.releasing_skill import retreats_B

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
LEFT = np.array([0.9, -1.6, 1.6, 0.0, 0.4, 0.0])
RIGHT = np.array([-0.9, -1.6, 1.6, 0.0, 0.4, 0.0])
PLANNER = RrtConnect()


@pytest.fixture(scope="module")
def scene():
    return ArmScene(CAPABILITIES, MODEL, {})


@pytest.fixture(autouse=True)
def nothing_around(scene):
    scene.set_boxes(())
    scene.hold(())


def _wall_ahead():
    return Box(RigidTransform([0.85, 0.0, 0.35]), (0.7, 0.1, 0.9))


def test_other_boxes_stand_around_for_a_while_only(scene):
    scene.set_boxes([_wall_ahead()])
    ahead = np.array([0.0, -1.6, 1.6, 0.0, 0.4, 0.0])
    blocked = scene.free(ahead)
    with scene.with_only((), 0.5):
        assert scene.free(ahead)
    assert (blocked, scene.free(ahead)) == (False, False)


@pytest.mark.parametrize(("q", "free"), [(MODEL.stowed_rad, True), (np.array([0.0, 0.45, 2.2, 0.0, 0.0, 0.0]), False)])
def test_an_arm_is_free_unless_it_is_in_the_body(scene, q, free):
    assert scene.free(q) is free


def test_a_box_in_the_arms_space_is_named_as_an_obstacle(scene):
    scene.set_boxes([Box(RigidTransform(MODEL.X_BH(LEFT).translation()), (0.2, 0.2, 0.2))])
    with pytest.raises(PlanningError, match="what stands around"):
        PLANNER.path(scene, MODEL.stowed_rad, LEFT, np.random.default_rng(1))


def test_a_held_box_counts_as_part_of_the_arm(scene):
    scene.set_boxes([Box(RigidTransform(MODEL.X_BH(LEFT) @ np.array([0.45, 0.0, 0.0])), (0.1, 0.1, 0.1))])
    assert scene.free(LEFT)
    scene.hold([Box(RigidTransform([0.35, 0.0, 0.0]), (0.3, 0.05, 0.05))])
    assert not scene.free(LEFT)


def test_a_free_motion_is_straight(scene):
    assert len(PLANNER.path(scene, MODEL.stowed_rad, LEFT, np.random.default_rng(1))) == 2


def test_timing_a_motion_of_no_length_is_a_short_stay():
    assert np.allclose(PLANNER.trajectory(np.array([LEFT, LEFT])).positions_rad[-1], LEFT)


def test_a_wall_between_is_gone_round(scene):
    scene.set_boxes([_wall_ahead()])
    path = PLANNER.path(scene, LEFT, RIGHT, np.random.default_rng(3))
    assert not scene.edge_free(LEFT, RIGHT)
    assert all(scene.edge_free(a, b) for a, b in pairwise(path))
    assert np.allclose(path[0], LEFT)
    assert np.allclose(path[-1], RIGHT)


def test_the_same_seed_plans_the_same_path(scene):
    scene.set_boxes([_wall_ahead()])
    first, second = (PLANNER.path(scene, LEFT, RIGHT, np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(first, second)


def test_timing_keeps_speed_and_acceleration_limits_from_rest_to_rest(scene):
    scene.set_boxes([_wall_ahead()])
    trajectory = PLANNER.trajectory(PLANNER.path(scene, LEFT, RIGHT, np.random.default_rng(3)), scene=scene)
    times = np.arange(0.0, trajectory.times_s[-1], 0.08)
    q = np.stack([np.interp(times, trajectory.times_s, column) for column in trajectory.positions_rad.T], axis=1)
    speeds = np.diff(q, axis=0) / 0.08
    assert np.abs(speeds).max() < 1.25
    assert np.abs(speeds[0]).max() < 0.2
    assert np.abs(np.diff(speeds, axis=0) / 0.08).max() < 5.0
    assert np.allclose(trajectory.positions_rad[-1], RIGHT)


def test_a_straight_line_keeps_the_hands_orientation_and_path():
    X_from = MODEL.X_BH(LEFT)
    X_to = RigidTransform(X_from.rotation(), X_from.translation() + [0.0, 0.0, 0.1])
    hands = [MODEL.X_BH(q) for q in PLANNER.line(MODEL, LEFT, X_to)]
    for hand in hands:
        assert np.allclose(hand.rotation().matrix(), X_from.rotation().matrix(), atol=1e-6)
        assert np.allclose(hand.translation()[:2], X_from.translation()[:2], atol=1e-6)
    assert hands[-1].IsNearlyEqualTo(X_to, 1e-6)


def test_a_straight_line_out_of_reach_is_refused():
    with pytest.raises(PlanningError, match="reach"):
        PLANNER.line(MODEL, LEFT, MODEL.X_BH(LEFT) @ RigidTransform([1.5, 0.0, 0.0]))


def test_a_straight_line_into_a_box_is_refused(scene):
    X_from = MODEL.X_BH(LEFT)
    ahead = RigidTransform(X_from.rotation(), X_from @ np.array([0.15, 0.0, 0.0]))
    scene.set_boxes([Box(RigidTransform(X_from @ np.array([0.38, 0.0, 0.0])), (0.1, 0.1, 0.1))])
    with pytest.raises(PlanningError, match="meets"):
        PLANNER.line(MODEL, LEFT, ahead, scene)


@pytest.mark.parametrize("way_rad", [0.5, 0.05, 0.01, 0.001])
def test_timing_takes_about_as_long_as_the_acceleration_needs(way_rad):
    trajectory = PLANNER.trajectory(np.array([LEFT, LEFT + way_rad * np.eye(6)[1]]), speed_rad_s=10.0)
    shortest_s = 2.0 * np.sqrt(way_rad / 3.0)
    assert 0.8 * shortest_s < trajectory.times_s[-1] < 2.5 * shortest_s + 0.1


def test_a_start_in_contact_is_left_without_touching_anything_else(scene):
    # A box reaches 1 cm into the hand; the way leads out of it and on to the other side.
    scene.set_boxes([Box(RigidTransform(MODEL.X_BH(LEFT).translation() + [0.0, 0.0, -0.13]), (0.1, 0.1, 0.2))])
    assert not scene.free(LEFT)
    path = PLANNER.path(scene, LEFT, RIGHT, np.random.default_rng(3))
    touched = {pair for q in np.linspace(path[0], path[1], 8) for pair in scene.contacts(q)}
    assert scene.free(path[1])
    assert touched <= set(scene.contacts(LEFT))


def test_a_stretched_arm_leaves_the_object_that_it_has_put_down():
    # a Fetch put a screwdriver down on a workbench, the hand pointing down
    q = np.array([-0.191, -0.163, -5.484, 0.295, 5.498, 1.515, 1.754])
    model = arm_model(FETCH.capabilities())
    X_BH = model.X_BH(q)
    free = []
    for shift_B in retreats_B(X_BH, model.p_BS):
        with suppress(PlanningError):
            RrtConnect().line(model, q, RigidTransform(X_BH.rotation(), X_BH.translation() + shift_B))
            free.append(shift_B)
    assert free
    assert free[0] == pytest.approx([-0.113, 0.011, 0.113], abs=0.003)  # up and towards the shoulder
