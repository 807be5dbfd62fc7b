"""What sticks out of the body widens the footprint; a stowed arm leaves it as it is."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_robot import TWO_ROOMS, Bench, Box, grid_of
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scripted_robot import CAPABILITIES, GRIPPER, MODEL, ScriptedRobot, context_of

from skills.api import Running, Succeeded
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.scan_points import ArmShape, SelfFilter
from skills.manipulation.arm.collision import ArmScene, box_corners
from skills.manipulation.arm.collision import Box as HeldBox
from skills.manipulation.arm.poses import carry_configuration
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.footprint import Footprint
from skills.navigate.planner import NoWayError, plan_path
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D

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
    """The footprint with the arm at some angles, holding a box of this size about the fingers' middle."""
    context = context_of(ScriptedRobot(q=np.array(q_rad), holding=holding or held_m is not None), costmap=costmap)
    if held_m is not None:
        context.payload.corners_H = box_corners(HeldBox(RigidTransform([GRIPPER.grip_x_m, 0.0, 0.0]), held_m))
    return ArmFootprint(context)


def front_m(footprint):
    return float(np.max(footprint.discs[:, 0] + footprint.discs[:, 2]))


def test_the_stowed_arm_leaves_the_footprint_as_it_is():
    assert np.array_equal(outline(MODEL.stowed_rad).now().discs, PLAIN.discs)


def test_a_can_carried_near_the_body_leaves_it_as_it_is():
    footprint = outline(CARRYING, held_m=(0.07, 0.07, 0.12)).now()
    assert np.array_equal(footprint.discs, PLAIN.discs)


def test_the_arm_stretched_out_ahead_extends_the_front_only():
    footprint = outline(AHEAD).now()
    assert front_m(footprint) == pytest.approx(0.85 + GRIPPER.tip_x_m, abs=0.03)
    assert footprint.extent_m[1] == pytest.approx(PLAIN.width_m)
    assert np.array_equal(footprint.discs[: len(PLAIN.discs)], PLAIN.discs)


def test_what_is_held_at_an_unknown_size_is_as_long_as_the_gripper_can_hold():
    X_BH = MODEL.X_BH(CARRYING)
    tip_m = (X_BH @ [GRIPPER.grip_x_m, 0.0, 0.0])[0] + GRIPPER.length_m - GRIPPER.grip_x_m
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
    """Two rooms whose left door is so wide."""
    return LayeredCostmap(grid_of([*TWO_ROOMS, Box(2.0 + width_m, 4.0, 2.9, 4.1), *more], (0.05, 1.0)))


def test_through_a_door_of_75_cm_nothing_long_is_carried_across_and_the_sentence_says_why():
    costmap = narrowed(0.75)
    plan_path(costmap, outline(MODEL.stowed_rad, costmap=costmap).now(), LEFT_ROOM, RIGHT_ROOM)
    wide = outline(CARRYING, held_m=(0.03, 1.0, 0.03)).now()
    with pytest.raises(NoWayError, match=r"fits through: the object that it carries makes it 1\.\d\d m long and 1\.0"):
        plan_path(costmap, wide, LEFT_ROOM, RIGHT_ROOM)


def test_the_way_leads_through_the_wider_door_where_there_is_one():
    surveyed = [box for box in TWO_ROOMS if (box.x0, box.y0) not in ((0.0, 4.0), (4.95, 0.0))]
    doors = [Box(0.0, 4.0, 0.3, 4.1), Box(1.05, 4.0, 2.0, 4.1), Box(2.9, 4.0, 7.0, 4.1)]  # 0.75 m and 0.9 m
    costmap = LayeredCostmap(grid_of([*surveyed, *doors], (0.05, 1.0)))
    start, goal = Pose2D(1.6, 2.0, math.pi / 2), Pose2D(0.8, 5.6, math.pi)
    narrow = plan_path(costmap, PLAIN, start, goal)
    carrying = outline(CARRYING, held_m=(0.03, 0.72, 0.03)).now()
    wide = plan_path(costmap, carrying, start, goal)
    through = [float(path.poses[np.argmin(np.abs(path.poses[:, 1] - 4.05)), 0]) for path in (narrow, wide)]
    assert through[0] < 1.05 and 2.0 < through[1] < 2.9


class Table:
    """A table from x = 0.7 on, seen from the origin."""

    def clearance_m(self, points_W):
        return 0.7 - np.asarray(points_W)[:, 0]

    def update(self, robot, localisation):
        pass


def test_where_the_robot_stands_already_nothing_under_its_arm_blocks_it():
    footprint = outline(AHEAD, costmap=Table()).now()
    assert front_m(footprint) < 0.7


def test_away_from_the_table_the_arm_outgrows_what_was_planned_with():
    at_table, away = outline(AHEAD, costmap=Table()), outline(AHEAD)
    assert not at_table.outgrows(at_table.now())
    assert away.outgrows(at_table.now())
    assert not away.outgrows(away.now())
    assert not outline(MODEL.stowed_rad).outgrows(away.now())


def test_the_robots_own_arm_and_load_are_no_obstacle_in_its_way():
    own, held_m = SelfFilter.of(CAPABILITIES), (0.03, 0.6, 0.03)
    corners_H = box_corners(HeldBox(RigidTransform([GRIPPER.grip_x_m, 0.0, 0.0]), held_m))
    joints = ScriptedRobot(q=CARRYING).joints()
    arm_B = ArmShape(CAPABILITIES).points_B(joints)
    seen_B = np.vstack([arm_B, (MODEL.X_BH(CARRYING) @ corners_H.T).T])
    assert not own.foreign(seen_B, arm_B, holding=True).any()


def drive_along_the_corridor(raised_from_x_m):
    """Drive 7 m with an arm that is raised on the way; the bench, its last step and how often a path was planned."""
    bench = Bench(Pose2D(1.2, 5.4, 0.0), cameras=False)
    robot, capabilities = bench.robot, replace(CAPABILITIES, cameras=())
    robot.capabilities = lambda: capabilities
    robot.joints = lambda: ScriptedRobot(q=AHEAD if robot.pose.x_m > raised_from_x_m else MODEL.stowed_rad).joints()
    skill = Navigate(bench.context())
    skill.begin(NavigateInputs(Pose2D(8.2, 5.4, 0.0)))
    while isinstance(step := skill.step(), Running) and bench.clock.now() < 60.0:
        bench.tick()
    skill.end()
    return step, bench.worker.names.count("plan a path")


def test_an_arm_that_is_raised_on_the_way_is_planned_for_once():
    step, plans = drive_along_the_corridor(raised_from_x_m=3.0)
    assert isinstance(step, Succeeded), step.message
    assert plans == 2


def test_a_stowed_arm_makes_nothing_be_planned_anew():
    step, plans = drive_along_the_corridor(raised_from_x_m=math.inf)
    assert isinstance(step, Succeeded), step.message
    assert plans == 1
