import numpy as np
from planar_robot import Bench, Box

from skills.navigate.low_obstacles import LowObstacleWatch, WatchOptions, low_points
from skills.robot import Pose2D

START = Pose2D(1.5, 5.4, 0.0)
SHOE_BOX = Box(2.8, 5.2, 3.1, 5.6, 0.0, 0.15)


def test_the_bare_floor_gives_no_points():
    bench = Bench(START)
    bench.tick()
    points = low_points(bench.robot.image("frontleft"), WatchOptions())
    assert np.sum(np.abs(points[:, 1]) < 1.0) == 0  # further aside are the corridor's walls


def test_points_lie_on_the_thing_in_the_odom_frame():
    bench = Bench(START, unmapped=[SHOE_BOX])
    bench.tick()
    points = low_points(bench.robot.image("frontleft"), WatchOptions())
    points = points[np.abs(points[:, 1]) < 1.0]
    assert len(points) > 20
    assert points[:, 0].min() > 1.25 and points[:, 0].max() < 1.65  # the robot woke up at x = 1.5
    assert np.abs(points[:, 1]).max() < 0.25


def test_cameras_are_asked_in_turn_and_not_more_often_than_said():
    bench = Bench(START, unmapped=[SHOE_BOX])
    watch = LowObstacleWatch(bench.context())
    for _ in range(40):
        bench.tick()
        watch.step()
    assert set(bench.worker.names) == {"look for low things by frontleft", "look for low things by frontright"}
    assert 4 <= bench.robot.images_taken <= 2.0 / WatchOptions().period_s + 1


def test_the_costmap_learns_of_the_thing():
    bench = Bench(START, unmapped=[SHOE_BOX])
    watch = LowObstacleWatch(bench.context())
    for _ in range(20):
        bench.tick()
        watch.step()
    assert bench.costmap.clearance_m(np.array([[2.85, 5.4]]))[0] < 0.05
