"""The arm and a held object widen the footprint; a stowed arm does not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_robot import TWO_ROOMS, Bench, Box, grid_of
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from table_robot import CAPABILITIES, GRIPPER, MODEL, TableRobot, context_of

from skills.api import Succeeded
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.scan_points import ArmShape, SelfFilter
from skills.footprint import Footprint
from skills.manipulation.arm.collision import ArmScene, box_corners
from skills.manipulation.arm.collision import Box as HeldBox
from skills.manipulation.arm.poses import carry_configuration
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.planner import NoPathError, plan_path
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D
from skills.testing.estimators import BlockCostmap

PLAIN = Footprint.of(CAPABILITIES)
LEFT_ROOM, RIGHT_ROOM = Pose2D(1.5, 2.0, 0.0), Pose2D(8.5, 2.0, -1.57)
AHEAD = MODEL.inverse(RigidTransform(RotationMatrix(), [0.85, 0.0, 0.3]))[0]
CARRYING = carry_configuration(
    ArmScene(CAPABILITIES, MODEL, {}),
    CAPABILITIES.arm,
    RollPitchYaw(0.0, 0.8, 0.0).ToRotationMatrix(),
    MODEL.stowed_rad,
)


def outline(q_rad, *, held_m=None, holding=False, costmap=None):
    """The footprint with an arm at joint angles that holds a box about the fingers' middle."""
    context = context_of(TableRobot(np.array(q_rad), holding=holding or held_m is not None), costmap=costmap)
    if held_m is not None:
        context.payload.corners_H = box_corners(HeldBox(RigidTransform([GRIPPER.grip_x_m, 0.0, 0.0]), held_m))
    return ArmFootprint(context)


def front_m(footprint):
    return float(np.max(footprint.discs[:, 0] + footprint.discs[:, 2]))


def test_the_stowed_arm_leaves_the_footprint_as_it_is():
    assert np.array_equal(outline(MODEL.stowed_rad).now().discs, PLAIN.discs)


def test_a_can_carried_near_the_body_leaves_it_as_it_is():
    assert np.array_equal(outline(CARRYING, held_m=(0.07, 0.07, 0.12)).now().discs, PLAIN.discs)


def test_the_arm_stretched_out_ahead_extends_the_front_only():
    footprint = outline(AHEAD).now()
    assert front_m(footprint) == pytest.approx(0.85 + GRIPPER.tip_x_m, abs=0.03)
    assert footprint.extent_m[1] == pytest.approx(PLAIN.width_m)
    assert np.array_equal(footprint.discs[: len(PLAIN.discs)], PLAIN.discs)


def test_a_held_object_of_unknown_size_counts_as_the_largest_one():
    tip_m = (MODEL.X_BH(CARRYING) @ [GRIPPER.grip_x_m, 0.0, 0.0])[0] + GRIPPER.length_m - GRIPPER.grip_x_m
    assert front_m(outline(CARRYING, holding=True).now()) == pytest.approx(tip_m)


@pytest.mark.parametrize("length_m", [0.8, 1.2])
def test_a_long_object_carried_across_is_covered_from_end_to_end(length_m):
    footprint = outline(CARRYING, held_m=(0.03, length_m, 0.03)).now()
    x_m = float((MODEL.X_BH(CARRYING) @ [GRIPPER.grip_x_m, 0.0, 0.0])[0])
    for y_m in np.linspace(-0.5, 0.5, 41) * length_m:
        apart = np.hypot(footprint.discs[:, 0] - x_m, footprint.discs[:, 1] - y_m) - footprint.discs[:, 2]
        assert apart.min() <= 0.0
    assert footprint.extent_m[1] < length_m + 0.12


def narrowed(width_m, *more):
    """Two rooms with a left door of this width."""
    return LayeredCostmap(grid_of([*TWO_ROOMS, Box(2.0 + width_m, 4.0, 2.9, 4.1), *more], (0.05, 1.0)))


def test_a_long_object_does_not_pass_a_75_cm_door_and_the_message_says_why():
    costmap = narrowed(0.75)
    plan_path(costmap, outline(MODEL.stowed_rad, costmap=costmap).now(), LEFT_ROOM, RIGHT_ROOM)
    wide = outline(CARRYING, held_m=(0.03, 1.0, 0.03)).now()
    with pytest.raises(NoPathError, match=r"fits through: the object that it carries makes it 1\.\d\d m long and 1\.0"):
        plan_path(costmap, wide, LEFT_ROOM, RIGHT_ROOM)


def test_the_path_leads_through_the_wider_door():
    surveyed = [box for box in TWO_ROOMS if (box.x0, box.y0) not in ((0.0, 4.0), (4.95, 0.0))]
    doors = [Box(0.0, 4.0, 0.3, 4.1), Box(1.05, 4.0, 2.0, 4.1), Box(2.9, 4.0, 7.0, 4.1)]  # 0.75 m and 0.9 m
    costmap = LayeredCostmap(grid_of([*surveyed, *doors], (0.05, 1.0)))
    start, goal = Pose2D(1.6, 2.0, math.pi / 2), Pose2D(0.8, 5.6, math.pi)
    narrow = plan_path(costmap, PLAIN, start, goal)
    wide = plan_path(costmap, outline(CARRYING, held_m=(0.03, 0.72, 0.03)).now(), start, goal)
    through = [float(path.poses[np.argmin(np.abs(path.poses[:, 1] - 4.05)), 0]) for path in (narrow, wide)]
    assert through[0] < 1.05 and 2.0 < through[1] < 2.9


TABLE = BlockCostmap([Box(0.7, -9.0, 20.0, 9.0)])
"""A table from x = 0.7 on, seen from the origin."""


def test_obstacles_under_the_arm_do_not_block_the_pose_where_the_robot_stands():
    assert front_m(outline(AHEAD, costmap=TABLE).now()) < 0.7


def test_away_from_the_table_the_arm_outgrows_the_planned_footprint():
    at_table, away = outline(AHEAD, costmap=TABLE), outline(AHEAD)
    assert not at_table.outgrows(at_table.now())
    assert away.outgrows(at_table.now())
    assert not away.outgrows(away.now())
    assert not outline(MODEL.stowed_rad).outgrows(away.now())


def test_the_robots_arm_and_load_are_no_obstacles():
    own, held_m = SelfFilter.of(CAPABILITIES), (0.03, 0.6, 0.03)
    corners_H = box_corners(HeldBox(RigidTransform([GRIPPER.grip_x_m, 0.0, 0.0]), held_m))
    arm_B = ArmShape(CAPABILITIES).points_B(TableRobot(CARRYING).joints())
    seen_B = np.vstack([arm_B, (MODEL.X_BH(CARRYING) @ corners_H.T).T])
    assert not own.foreign(seen_B, arm_B, holding=True).any()


def test_an_arm_without_a_gripper_widens_the_footprint_too():
    bare = replace(CAPABILITIES, gripper=None)
    ahead, stowed = (ArmFootprint(context_of(TableRobot(q, capabilities=bare))).now() for q in (AHEAD, None))
    assert len(ahead.discs) > len(stowed.discs)


def drive_along_the_corridor(raised_from_x_m):
    """Drives 7 m while the arm is raised; returns the bench, its last step and the number of plans."""
    bench = Bench(Pose2D(1.2, 5.4, 0.0), cameras=False)
    robot, capabilities = bench.robot, replace(CAPABILITIES, cameras=())
    robot.capabilities = lambda: capabilities
    robot.joints = lambda: TableRobot(AHEAD if robot.pose.x_m > raised_from_x_m else MODEL.stowed_rad).joints()
    step = bench.run(Navigate(bench.context()), NavigateInputs(Pose2D(8.2, 5.4, 0.0)), limit_s=60.0)
    return step, bench.worker.names.count("plan a path")


@pytest.mark.parametrize(("raised_from_x_m", "plans"), [(3.0, 2), (math.inf, 1)], ids=["raised", "stowed"])
def test_raising_the_arm_while_driving_causes_one_new_plan(raised_from_x_m, plans):
    step, made = drive_along_the_corridor(raised_from_x_m)
    assert isinstance(step, Succeeded), step.message
    assert made == plans
