from dataclasses import replace

import numpy as np
import pytest
from planar_robot import TWO_ROOMS, Bench, Box

from skills.api import Cause, Failed, Succeeded
from skills.faults.faulty_robot import inject_faults
from skills.navigate.sensor_watch import LowObstacleWatch, ScanHealth, WatchOptions, low_points
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D
from skills.robot_wrapper import RobotWrapper
from skills.small.back_off import BackOff, BackOffInputs

START = Pose2D(1.5, 5.4, 0.0)
SHOE_BOX = Box(2.8, 5.2, 3.1, 5.6, 0.0, 0.15)


def test_the_bare_floor_gives_no_points():
    bench = Bench(START)
    bench.tick()
    points = low_points(bench.robot.image("frontleft"), WatchOptions())
    assert np.sum(np.abs(points[:, 1]) < 1.0) == 0  # further aside are the corridor's walls


def test_points_lie_on_the_object_in_the_odom_frame():
    bench = Bench(START, unmapped=[SHOE_BOX])
    bench.tick()
    points = low_points(bench.robot.image("frontleft"), WatchOptions())
    points = points[np.abs(points[:, 1]) < 1.0]
    assert len(points) > 20
    assert points[:, 0].min() > 1.25 and points[:, 0].max() < 1.65  # the robot woke up at x = 1.5
    assert np.abs(points[:, 1]).max() < 0.25


def watched_bench(ticks):
    """A bench before a shoe box, after some ticks of the watch."""
    bench = Bench(START, unmapped=[SHOE_BOX])
    watch = LowObstacleWatch(bench.context())
    for _ in range(ticks):
        bench.tick()
        watch.step()
    return bench


# speed (m/s)   pictures in 4 s
@pytest.mark.parametrize(("speed_m_s", "least", "most"), [(0.0, 4, 5), (0.5, 7, 9), (0.7, 9, 11)])
def test_cameras_take_pictures_in_turn_as_often_as_the_robot_moves(speed_m_s, least, most):
    bench = Bench(START)
    context = bench.context()
    watch = LowObstacleWatch(context)
    for _ in range(80):
        bench.robot.drive(speed_m_s, 0.0, 0.0, until_s=bench.clock.now() + 0.2, lease=context.lease)
        bench.tick()
        watch.step()
    assert set(bench.worker.names) == {"look for low obstacles by frontleft", "look for low obstacles by frontright"}
    assert least <= bench.robot.images_taken <= most


def test_the_costmap_shows_the_object():
    bench = watched_bench(30)
    assert bench.costmap.clearance_m(np.array([[2.85, 5.4]]))[0] < 0.06


DRIVE_START, GOAL = Pose2D(1.2, 5.4, 0.0), Pose2D(4.0, 5.4, 0.0)


class Repeating(RobotWrapper):
    """A robot whose LiDAR repeats the scan of a moment with new stamps."""

    def __init__(self, robot, clock, from_s):
        super().__init__(robot)
        self._clock, self._from_s, self._kept = clock, from_s, None

    def scan(self):
        scan = self._robot.scan()
        if self._clock.now() < self._from_s or scan is None:
            self._kept = scan
            return scan
        return replace(self._kept, stamp_s=scan.stamp_s)


def drive(*faults, wrap=None, seconds=20.0):
    """How a drive ends, and the times and places of the robot on the way."""
    bench = Bench(DRIVE_START, surveyed=TWO_ROOMS)
    base, places = bench.robot, []
    bench.robot = wrap(bench) if wrap else inject_faults(base, bench.clock, faults)
    bench.tick()
    note = lambda: places.append((bench.clock.now(), base.pose.x_m))  # noqa: E731
    return bench.run(Navigate(bench.context()), NavigateInputs(GOAL), limit_s=seconds, each=note), places


def driven_after(places, time_s):
    """How far it drove after a time."""
    return places[-1][1] - next(x for at_s, x in places if at_s >= time_s)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("scan is missing from 1.5 s", "gives no scans"),
        ("lidar freezes at 1.5 s", "gives no new scans"),
        ("lidar returns garbage from 1.5 s", "ranges are invalid"),
    ],
)
def test_robot_stands_and_reports_a_lidar_that_fails_while_driving(fault, message):
    step, places = drive(fault)
    assert isinstance(step, Failed) and step.cause is Cause.EXECUTION and message in step.message
    assert places[-1][0] < 9.0
    assert driven_after(places, 2.4) < 0.02


def test_a_scan_repeated_with_new_stamps_is_reported():
    step, places = drive(wrap=lambda bench: Repeating(bench.robot, bench.clock, 1.5))
    assert isinstance(step, Failed) and step.cause is Cause.EXECUTION and "repeats its last scan" in step.message
    assert driven_after(places, 2.4) < 0.02


def test_robot_waits_through_a_short_gap_of_scans():
    step, _ = drive("scan is missing from 1.5 s to 3 s")
    assert isinstance(step, Succeeded)


def test_a_robot_without_scans_does_not_start():
    step, places = drive("scan is missing")
    assert isinstance(step, Failed) and step.cause is Cause.PRECONDITION and "gives no scans" in step.message
    assert driven_after(places, 0.0) == pytest.approx(0.0)


def test_robot_does_not_back_off_without_scans():
    bench = Bench(DRIVE_START, surveyed=TWO_ROOMS)
    bench.robot = inject_faults(bench.robot, bench.clock, ["scan is missing"])
    skill = BackOff(bench.context())
    skill.begin(BackOffInputs())
    step = skill.step()
    assert isinstance(step, Failed) and step.cause is Cause.PRECONDITION and "gives no scans" in step.message


def test_some_lost_returns_are_no_trouble():
    bench = Bench(DRIVE_START, surveyed=TWO_ROOMS)
    bench.tick(4)
    context = bench.context()
    assert ScanHealth(context).trouble() is None
    scan = context.robot.scan()
    holes = np.where(np.arange(scan.ranges_m.size).reshape(scan.ranges_m.shape) % 10, np.nan, scan.ranges_m)
    bench.robot.scan = lambda: replace(scan, ranges_m=holes.astype(np.float32))
    assert ScanHealth(bench.context()).trouble() is None
