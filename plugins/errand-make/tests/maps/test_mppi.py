import math
from dataclasses import replace

import numpy as np

from errand_make.maps.mppi import MppiController, MppiOptions
from executive.tree.registry import installed_skills
from skills.api import Succeeded
from skills.footprint import Footprint
from skills.navigate.planner import plan_path
from skills.path import Path
from skills.robot import Pose2D
from skills.stack import default_component, default_stack
from tests.skills.planar_robot import OUTLINE, TWO_ROOMS, Bench, Box, grids_of

FOOTPRINT = Footprint.rectangle(OUTLINE)
LEFT_ROOM, RIGHT_ROOM = Pose2D(1.5, 2.0, 0.0), Pose2D(8.5, 2.0, -1.57)
NAVIGATE = installed_skills()["navigate"]


def costmap_of(*boxes):
    """The default costmap on an exact map of boxes."""
    return default_component("costmap").build(grids_of(boxes)[1])


OPEN = costmap_of(Box(-9.0, -9.0, 9.0, -8.9), Box(-9.0, 8.9, 9.0, 9.0))


def straight(length_m):
    x = np.arange(0.0, length_m, 0.05)
    return Path(np.column_stack([x, np.zeros_like(x), np.zeros_like(x)]), np.full(len(x), 5.0))


def driven(controller, start, ticks):
    """Velocities and poses of an ideal base that obeys."""
    pose, last, velocities, poses = np.array([start.x_m, start.y_m, start.yaw_rad]), np.zeros(3), [], []
    for _ in range(ticks):
        vx, vy, wz = controller.command(Pose2D(*pose.tolist()), tuple(last), last, OPEN).velocity
        last = np.array([vx, vy, wz])
        c, s = math.cos(pose[2]), math.sin(pose[2])
        pose = pose + 0.05 * np.array([c * vx - s * vy, s * vx + c * vy, wz])
        velocities.append(last)
        poses.append(pose)
    return np.array(velocities), np.array(poses)


def test_it_keeps_to_the_limits_of_speed_and_acceleration():
    options = MppiOptions(max_speed_m_s=1.2)
    velocities, _ = driven(MppiController(straight(8.0), FOOTPRINT, options), Pose2D(0.0, 0.25, 0.3), 80)
    assert 1.0 < velocities[:, 0].max() <= 1.2 + 1e-9
    assert np.abs(velocities[:, 1]).max() <= options.lateral_m_s + 1e-9
    assert np.abs(velocities[:, 2]).max() <= options.turn_rad_s + 1e-9
    gained = np.diff(np.abs(velocities[:, 0])) / options.period_s
    assert gained.max() <= options.acceleration_m_s2 + 1e-6


def test_it_comes_back_to_the_path_and_does_not_oscillate():
    _, poses = driven(MppiController(straight(8.0), FOOTPRINT), Pose2D(0.0, 0.25, 0.3), 160)
    late = poses[poses[:, 0] > 4.0]
    assert np.abs(late[:, 1]).max() < 0.05
    assert np.abs(late[:, 2]).max() < 0.06
    assert poses[-1, 0] > 5.0


def test_equal_inputs_give_equal_velocities():
    first, second = (driven(MppiController(straight(4.0), FOOTPRINT), Pose2D(0.0, 0.1, 0.0), 20)[0] for _ in range(2))
    assert np.array_equal(first, second)


def test_robot_stands_at_speed_zero():
    answer = MppiController(straight(4.0), FOOTPRINT).command(
        Pose2D(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), np.zeros(3), OPEN, 0.0
    )
    assert answer.velocity == (0.0, 0.0, 0.0)


def test_robot_passes_two_doors_and_a_new_obstacle_without_contact():
    bench = Bench(LEFT_ROOM, unmapped=[Box(4.5, 5.0, 4.9, 5.4, 0.0, 1.7)], cameras=False)
    context = replace(bench.context(), stack=replace(default_stack(), controller=MppiOptions()))
    step = bench.run(NAVIGATE(context), NAVIGATE.Inputs(RIGHT_ROOM))
    assert isinstance(step, Succeeded), step.message
    assert bench.robot.least_clearance_m > 0.03


def test_driven_distance_is_hardly_longer_than_the_path():
    costmap = costmap_of(*TWO_ROOMS)
    path = plan_path(costmap, FOOTPRINT, LEFT_ROOM, RIGHT_ROOM)
    bench = Bench(LEFT_ROOM, cameras=False)
    controller, last = MppiController(path, FOOTPRINT), np.zeros(3)
    for _ in range(900):
        answer = controller.command(bench.robot.pose, tuple(bench.robot.velocity), last, costmap)
        last = np.array(answer.velocity)
        bench.robot.drive(*answer.velocity, until_s=bench.clock.now() + 0.3, lease=bench.lease)
        bench.clock.advance(0.05)
        if answer.remaining_m < 0.05:
            break
    assert bench.robot.travelled_m < 1.05 * float(np.hypot(*np.diff(path.poses[:, :2], axis=0).T).sum())
