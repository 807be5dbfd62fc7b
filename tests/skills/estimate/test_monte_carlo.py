"""Monte Carlo localisation of a robot among boxes: driven, kidnapped, anywhere, and with a broken LiDAR."""

import dataclasses
import math

import numpy as np
import pytest
from planar_robot import TWO_ROOMS, Bench, Box

from skills.estimate.localiser import LocaliserOptions
from skills.estimate.monte_carlo import MonteCarloOptions
from skills.robot import Pose2D
from skills.testing.blocks import grid_of

START, TURN = Pose2D(1.5, 5.4, 0.0), (0.0, 0.0, 0.5)
EMPTY_ROOM = (
    Box(-0.1, -0.1, 6.1, 0.0),
    Box(-0.1, 4.0, 6.1, 4.1),
    Box(-0.1, 0.0, 0.0, 4.0),
    Box(6.0, 0.0, 6.1, 4.0),
)


def bench_at(start, **options):
    return Bench(start, component=MonteCarloOptions(), cameras=False, **options)


def tick(bench, count=1, velocity=(0.0, 0.0, 0.0)):
    for _ in range(count):
        bench.robot.drive(*velocity, until_s=bench.clock.now() + 0.3, lease=bench.lease)
        bench.tick()


def drive_along_the_corridor(bench, way_m):
    """Back and forth at 0.6 m/s with a wiggle; the pose's error at each tick."""
    errors = []
    while bench.robot.travelled_m < way_m:
        ahead = -0.6 if 4.0 < bench.robot.travelled_m < 8.0 else 0.6
        tick(bench, 1, (ahead, 0.0, 0.3 * math.sin(bench.clock.now())))
        errors.append(bench.pose_error())
    return np.array(errors)


def test_while_driving_the_error_stays_below_3_cm_and_1_degree():
    bench = bench_at(START)
    errors = drive_along_the_corridor(bench, 5.0)[20:]
    assert errors[:, 0].max() < 0.03
    assert errors[:, 1].max() < math.radians(1.0)
    assert bench.localiser.estimate().health > 0.8


def test_unmapped_objects_do_not_pull_the_pose():
    bench = bench_at(START, unmapped=[Box(2.3, 6.2, 2.7, 6.6, 0.0, 1.7), Box(4.5, 4.25, 5.6, 4.6, 0.0, 1.8)])
    assert drive_along_the_corridor(bench, 6.0)[20:, 0].max() < 0.03


@pytest.mark.parametrize("there", [Pose2D(8.0, 2.3, 2.0), Pose2D(3.3, 1.4, -1.0)])
def test_a_kidnapped_robot_is_localised_again_within_a_turn(there):
    bench, localised = bench_at(START), []
    tick(bench, 20)
    bench.robot.carry_off(there)
    for _ in range(160):
        tick(bench, 1, TURN)
        localised.append(bench.localiser.estimate().localised)
    assert (all(localised), localised[-1]) == (False, True)
    distance_m, yaw_rad = bench.pose_error()
    assert distance_m < 0.04 and yaw_rad < math.radians(1.0)


def test_a_robot_with_unknown_start_is_localised_while_it_turns():
    bench = bench_at(Pose2D(8.0, 2.3, 2.0), start_known=False)
    assert not bench.localiser.estimate().localised
    first = np.sqrt(np.diag(bench.localiser.estimate().covariance))
    assert first[0] > 1.0 and first[2] > 1.0
    tick(bench, 120, TURN)
    assert bench.localiser.estimate().localised
    assert bench.pose_error()[0] < 0.04
    assert np.sqrt(np.diag(bench.localiser.estimate().covariance))[0] < 0.05


def test_a_symmetric_room_does_not_localise_the_robot():
    bench = bench_at(Pose2D(2.0, 1.5, 0.3), surveyed=EMPTY_ROOM, start_known=False)
    for _ in range(120):
        tick(bench, 1, TURN)
        assert not bench.localiser.estimate().localised
    assert 0.0 < bench.localiser.estimate().health < 0.7
    assert bench.localiser.search(bench.robot.scan(), bench.localiser.estimate(), None) is None


def test_a_first_search_among_similar_places_finds_the_expected_one():
    bench = bench_at(Pose2D(2.0, 1.5, 0.3), surveyed=EMPTY_ROOM)
    grid = grid_of(EMPTY_ROOM, (0.7, 1.3))
    bench.localiser = MonteCarloOptions().build(grid, Pose2D(2.05, 1.45, 0.3), surely=False)
    tick(bench, 2)
    found = bench.localiser.search(bench.robot.scan(), bench.localiser.estimate(), None)
    assert found is not None
    bench.localiser.accept(found)
    assert bench.pose_error()[0] < 0.1


def test_a_given_pose_localises_the_robot_in_a_symmetric_room():
    bench = bench_at(Pose2D(2.0, 1.5, 0.3), surveyed=EMPTY_ROOM)
    tick(bench, 100, TURN)
    assert bench.localiser.estimate().localised
    assert bench.pose_error()[0] < 0.04


def test_a_robot_whose_scan_fits_nowhere_is_not_localised():
    spots = np.random.default_rng(5).uniform(20.0, 26.0, (60, 2))
    pillars = [Box(x, y, x + 0.15, y + 0.15) for x, y in spots if math.hypot(x - 23, y - 23) > 1]
    bench = bench_at(Pose2D(23.0, 23.0, 0.3), surveyed=TWO_ROOMS, unmapped=pillars, start_known=False)
    tick(bench, 100, TURN)
    assert not bench.localiser.estimate().localised


def blinded(bench):
    """Makes all ranges of the LiDAR invalid from now on."""
    sense = bench.robot.scan

    def scan():
        seen = sense()
        return None if seen is None else dataclasses.replace(seen, ranges_m=np.full_like(seen.ranges_m, np.nan))

    bench.robot.scan = scan


BOTH = pytest.mark.parametrize("component", [MonteCarloOptions(), LocaliserOptions()])


@BOTH
def test_without_any_valid_range_it_is_not_localised(component):
    bench = Bench(START, component=component, cameras=False)
    tick(bench, 20)
    assert bench.localiser.estimate().localised
    blinded(bench)
    tick(bench, 20)
    assert (bench.localiser.estimate().localised, bench.localiser.estimate().health) == (False, 0.0)


@BOTH
def test_a_frozen_lidar_makes_the_estimate_old_and_not_wrong(component):
    bench = Bench(START, component=component, cameras=False)
    tick(bench, 20)
    old, now_s = bench.robot.scan(), bench.clock.now()
    bench.robot.scan = lambda: dataclasses.replace(old, stamp_s=bench.clock.now(), X_OB=bench.robot.odometry().X_OB)
    tick(bench, 20, (0.4, 0.0, 0.0))
    assert bench.localiser.estimate().stamp_s < now_s + 0.3
    assert bench.pose_error()[0] < 0.03


def test_a_dropout_of_scans_is_bridged_by_odometry():
    bench = bench_at(START)
    tick(bench, 20)
    old, sense = bench.robot.scan(), bench.robot.scan
    bench.robot.scan = lambda: old
    tick(bench, 20, (0.5, 0.0, 0.0))
    assert bench.clock.now() - bench.localiser.estimate().stamp_s > 0.9
    bench.robot.scan = sense
    tick(bench, 10, (0.5, 0.0, 0.0))
    assert bench.localiser.estimate().localised
    assert bench.pose_error()[0] < 0.03


def test_particles_gather_at_an_accepted_estimate():
    bench = bench_at(START)
    tick(bench, 10)
    bench.robot.carry_off(Pose2D(8.0, 2.3, 2.0))
    found = bench.localiser.search(bench.robot.scan(), bench.localiser.estimate(), None)
    assert not bench.localiser.estimate().X_WO.IsNearlyEqualTo(found.X_WO, 0.1)
    bench.localiser.accept(found)
    assert bench.pose_error()[0] < 0.04
    assert bench.localiser.particles.mass_near(bench.robot.pose) > 0.95


def test_equal_seeds_give_equal_estimates():
    poses = []
    for _ in range(2):
        bench = bench_at(Pose2D(8.0, 2.3, 2.0), start_known=False)
        tick(bench, 40, TURN)
        poses.append(bench.context().pose())
    assert poses[0] == poses[1]


def test_an_uncertain_start_is_searched_around():
    bench = bench_at(START)
    localiser = MonteCarloOptions().build(bench.localiser.grid, Pose2D(1.9, 5.0, 0.2), surely=False)
    for _ in range(60):
        tick(bench, 1, TURN)
        localiser.update(bench.robot)
    assert localiser.estimate().localised
    assert localiser.estimate().X_WO.IsNearlyEqualTo(bench.localiser.estimate().X_WO, 0.03)
