import math

import numpy as np
import pytest
from planar_robot import TWO_ROOMS, Bench, Box

from skills.estimate.localiser import DeadReckoning
from skills.geometry import compose, inverse
from skills.robot import Pose2D

START, ALONG = Pose2D(1.5, 2.0, 0.0), Pose2D(1.5, 5.4, 0.0)


def drive_along_the_corridor(bench, way_m=9.0):
    """Back and forth at 0.6 m/s with a wiggle; the pose's error at each tick after the first second."""
    errors = []
    while bench.robot.travelled_m < way_m:
        back = 4.0 < bench.robot.travelled_m < 8.0
        wiggle = 0.3 * math.sin(bench.clock.now())
        bench.robot.drive(-0.6 if back else 0.6, 0.0, wiggle, until_s=bench.clock.now() + 0.3, lease=bench.lease)
        bench.tick()
        if bench.clock.now() > 1.0:
            errors.append(bench.pose_error())
    return errors


def searched(bench, radius_m):
    scan = bench.robot.scan()
    assert scan is not None
    return bench.localiser.search(scan, bench.localiser.estimate(), radius_m)


def odometry_error_m(bench, start):
    off = compose(inverse(bench.robot.pose), compose(start, bench.robot.odometry().pose))
    return math.hypot(off.x_m, off.y_m)


def test_error_stays_below_3_cm_and_1_degree_while_odometry_drifts():
    bench = Bench(ALONG)
    errors = np.array(drive_along_the_corridor(bench, 4.0))
    by_odometry_m = odometry_error_m(bench, ALONG)
    errors = np.vstack([errors, drive_along_the_corridor(bench, 10.0)])
    assert errors[:, 0].max() < 0.03
    assert errors[:, 1].max() < math.radians(1.0)
    assert by_odometry_m > 0.04  # the bound above is no merit of odometry's


def test_unmapped_objects_near_the_robot_do_not_pull_the_pose():
    person, moved_cupboard = Box(2.3, 6.2, 2.7, 6.6, 0.0, 1.7), Box(4.5, 4.25, 5.6, 4.6, 0.0, 1.8)
    errors = np.array(drive_along_the_corridor(Bench(ALONG, unmapped=[person, moved_cupboard])))
    assert errors[:, 0].max() < 0.03


def test_a_slightly_wrong_start_is_corrected_by_the_first_scans():
    bench = Bench(START, believed_start=Pose2D(1.65, 1.85, 0.1))
    assert not bench.localiser.estimate().localised
    bench.tick(20)
    distance_m, yaw_rad = bench.pose_error()
    assert distance_m < 0.03 and yaw_rad < math.radians(1.0)
    assert bench.localiser.estimate().localised


def unchanged(before, after):
    return np.array_equal(before.X_WO.GetAsMatrix4(), after.X_WO.GetAsMatrix4())


def test_a_scan_is_used_once():
    bench = Bench(START)
    bench.tick(4)
    before = bench.localiser.estimate()
    bench.localiser.update(bench.robot)
    assert unchanged(before, bench.localiser.estimate())
    assert np.array_equal(before.covariance, bench.localiser.estimate().covariance)


def test_covariance_shrinks_and_fits_the_errors():
    bench = Bench(START)
    bench.tick(20)
    sigma = np.sqrt(np.diag(bench.localiser.estimate().covariance))
    assert (sigma[:2] < 0.03).all() and (sigma[:2] > 0.001).all()


def test_a_carried_robot_is_lost_and_found_again_nearby():
    bench = Bench(START)
    bench.tick(10)
    bench.robot.carry_off(Pose2D(2.4, 2.7, 0.5))
    said = []
    for _ in range(80):
        bench.tick()
        said.append(bench.localiser.estimate().localised)
    assert not all(said)
    assert said[-1]
    assert bench.pose_error()[0] < 0.03


def test_a_search_finds_the_robot_anywhere_on_the_map():
    bench = Bench(START)
    bench.tick()
    bench.robot.carry_off(Pose2D(8.0, 2.3, 2.0))
    found = searched(bench, None)
    assert found is not None
    bench.localiser.accept(found)
    assert bench.pose_error()[0] < 0.04


def test_a_search_finds_nothing_where_nothing_fits():
    rng = np.random.default_rng(5)
    pillars = [
        Box(x, y, x + 0.15, y + 0.15) for x, y in rng.uniform(20.0, 26.0, (60, 2)) if math.hypot(x - 23, y - 23) > 1
    ]
    bench = Bench(Pose2D(23.0, 23.0, 0.3), surveyed=TWO_ROOMS, unmapped=pillars, believed_start=START)
    bench.tick()
    bench.tick()
    assert searched(bench, 1.5) is None


def test_equal_seeds_give_equal_estimates():
    poses = []
    for _ in range(2):
        bench = Bench(START, seed=4)
        drive_along_the_corridor(bench, 1.0)
        poses.append(bench.context().pose())
    assert poses[0] == poses[1]


def test_pose_is_in_the_world_frame_for_any_odometry():
    bench = Bench(START)
    bench.robot.odometry_pose = Pose2D(5.0, -3.0, 2.0)
    bench.tick(4)
    assert bench.context().pose().x_m == pytest.approx(START.x_m, abs=0.03)
    assert bench.context().pose().yaw_rad == pytest.approx(START.yaw_rad, abs=0.02)


def surrounded_bench():
    """A robot in a corridor between three others that no map knows, and the discs that cover them."""
    others = [Box(x - 0.3, 5.0, x + 0.3, 6.2, 0.0, 1.1) for x in (3.0, 5.6)] + [Box(3.8, 4.5, 4.8, 4.8, 0.0, 1.1)]
    middles = [(x, y) for x in (3.0, 5.6) for y in (5.3, 5.9)] + [(4.0, 4.65), (4.6, 4.65)]
    return Bench(Pose2D(4.3, 5.6, 0.0), unmapped=others), np.array([[*middle, 0.6] for middle in middles])


@pytest.mark.parametrize("reported", [True, False])
def test_localisation_holds_among_robots_that_report_their_poses(reported):
    """Most of what it sees are the others: left out, the rest is enough; taken for walls, it is lost."""
    bench, discs_W = surrounded_bench()
    if reported:
        bench.localiser.exclude_robots(discs_W)
    bench.tick(30)
    assert bench.localiser.estimate().localised == reported


def test_a_scan_of_other_robots_only_does_not_delocalise():
    """Localised first, then all is covered: the belief goes on by odometry."""
    bench = Bench(START)
    bench.tick(5)
    before = bench.localiser.estimate()
    bench.localiser.exclude_robots(np.array([[*START.transform().translation()[:2], 30.0]]))
    bench.tick(30)
    after = bench.localiser.estimate()
    assert before.localised and after.localised
    assert unchanged(before, after)


CORRIDOR = Pose2D(1.5, 5.4, 0.3)


def reckoning_bench(**options):
    bench = Bench(CORRIDOR, component=DeadReckoning(), cameras=False, **options)
    bench.tick()
    return bench


def test_it_is_not_localised_before_it_has_seen_odometry():
    assert not DeadReckoning().build(Bench(CORRIDOR).costmap.keepout, None, surely=False).estimate().localised


def test_dead_reckoning_starts_at_the_given_pose_and_follows_odometry():
    bench = reckoning_bench()
    assert bench.localiser.estimate().localised
    assert bench.pose_error() == pytest.approx((0.0, 0.0), abs=1e-3)
    bench.robot.push(3.0, 0.5, 0.4)
    bench.tick()
    assert bench.pose_error() == pytest.approx((0.0, 0.0), abs=1e-3)


def test_covariance_grows_with_the_distance():
    bench = reckoning_bench()
    before = bench.localiser.estimate().covariance
    bench.robot.push(3.0, 0.5, 0.4)
    bench.tick()
    assert np.all(np.diag(bench.localiser.estimate().covariance) > np.diag(before))


def test_an_unknown_start_is_the_origin():
    pose = reckoning_bench(start_known=False).context().pose()
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


# speed (m/s)   scans used in 3 s, of 30
@pytest.mark.parametrize(("speed_m_s", "least", "most"), [(0.0, 9, 12), (0.3, 29, 31)])
def test_a_localised_robot_at_rest_uses_every_third_scan(speed_m_s, least, most):
    bench, used = Bench(ALONG), set()
    bench.tick(20)
    for _ in range(60):
        bench.robot.drive(speed_m_s, 0.0, 0.0, until_s=bench.clock.now() + 0.3, lease=bench.lease)
        bench.tick()
        used.add(bench.localiser.estimate().stamp_s)
    assert least <= len(used) <= most
    assert bench.pose_error()[0] < 0.03
