import numpy as np
import pytest
from planar_robot import Bench, Box

from skills.estimate.costmap import clear_cells
from skills.robot import Pose2D

START = Pose2D(1.5, 5.4, 0.0)
PERSON = Box(3.2, 5.2, 3.6, 5.6, 0.0, 1.7)
AT_PERSON = np.array([[3.2, 5.4]])


def ticked(bench, ticks=10):
    bench.tick(ticks)
    return bench


def test_without_unmapped_objects_only_the_survey_counts():
    bench = ticked(Bench(START), 40)
    assert len(bench.costmap.obstacle_cells()) == 0
    assert bench.costmap.clearance_m(np.array([[3.0, 5.6]]))[0] == pytest.approx(1.4, abs=0.02)


def test_an_obstacle_out_of_view_is_remembered_but_not_among_those_just_seen():
    bench = ticked(Bench(START, unmapped=[PERSON], azimuths=900))
    assert len(bench.costmap.obstacle_cells(within_s=1.0)) == len(bench.costmap.obstacle_cells()) > 0
    bench.robot.scan = lambda: None
    ticked(bench, 30)
    assert len(bench.costmap.obstacle_cells(within_s=1.0)) == 0 < len(bench.costmap.obstacle_cells())


def test_a_person_in_the_path_is_seen():
    bench = ticked(Bench(START, unmapped=[PERSON], azimuths=900))
    assert bench.costmap.clearance_m(AT_PERSON)[0] < 0.05
    assert bench.costmap.clearance_m(AT_PERSON + [-0.5, 0.0])[0] == pytest.approx(0.5, abs=0.12)


def test_a_person_who_walks_away_is_forgotten_at_once():
    bench = ticked(Bench(START, unmapped=[PERSON]))
    bench.robot.blocks.remove(PERSON)
    ticked(bench, 6)
    assert bench.costmap.clearance_m(AT_PERSON)[0] > 0.5


def test_obstacles_below_the_beams_stay_remembered_and_then_decay():
    bench = ticked(Bench(START, unmapped=[Box(2.6, 5.2, 3.0, 5.6, 0.0, 0.3)], cameras=False))
    ahead = np.array([[2.7, 5.4]])
    assert bench.costmap.clearance_m(ahead)[0] > 0.5  # the LiDAR passes over it
    points = np.column_stack(
        [np.repeat(np.linspace(2.6, 2.8, 9), 20), np.tile(np.linspace(5.3, 5.5, 20), 9), np.full(180, 0.3)]
    )
    bench.costmap.add_points(points, bench.clock.now())
    assert bench.costmap.clearance_m(ahead)[0] < 0.05
    ticked(bench, 100)
    assert bench.costmap.clearance_m(ahead)[0] < 0.05
    ticked(bench, 160)
    assert bench.costmap.clearance_m(ahead)[0] > 0.5


@pytest.mark.parametrize(
    "points_W",
    [[[3.0, 5.4, 0.3], [3.5, 5.0, 0.3]], [[1.8, 5.5, 0.4]] * 20, [[5.0, 6.52, 0.4]] * 20],
    ids=["single", "on the robot", "on surveyed furniture"],
)
def test_depth_points_that_are_no_obstacles_are_ignored(points_W):
    bench = ticked(Bench(START))
    bench.costmap.add_points(np.array(points_W), bench.clock.now())
    assert len(bench.costmap.obstacle_cells()) == 0


def test_scans_are_ignored_while_the_robot_is_not_localised():
    bench = Bench(START, unmapped=[PERSON], believed_start=Pose2D(8.0, 2.0, 1.0))
    bench.tick()
    bench.tick()
    assert not bench.localiser.estimate().localised
    assert len(bench.costmap.obstacle_cells()) == 0


def test_returns_from_a_reported_robot_are_left_out_but_unexplained():
    bench = Bench(START, unmapped=[PERSON])
    bench.costmap.exclude_robots(np.array([[3.4, 5.4, 0.5]]))
    ticked(bench)
    bench.costmap.add_points(np.tile([[3.3, 5.4, 0.4]], (20, 1)), bench.clock.now())
    assert len(bench.costmap.obstacle_cells()) == 0
    assert len(bench.costmap.unexplained_returns()[1]) > 0
    bench.costmap.exclude_robots(np.empty((0, 3)))
    ticked(bench)
    assert bench.costmap.clearance_m(AT_PERSON)[0] < 0.05


@pytest.mark.parametrize(
    ("range_m", "height_m", "is_cleared"), [(5.0, 0.4, True), (2.0, 0.4, False), (5.0, 0.2, False)]
)
def test_the_beams_of_a_single_ring_clear_the_cells_at_their_height(range_m, height_m, is_cleared):
    azimuths = np.linspace(-np.pi, np.pi, 900, endpoint=False)
    elevations = np.array([0.0, 1.0])[:1]  # the number behind it in memory is no ring
    beams = np.full((1, 900), range_m, dtype=np.float32), elevations, azimuths
    until_s, heights_m = np.full((100, 100), -np.inf), np.full((100, 100), height_m)
    until_s[20, 60] = 12.0
    sensor_pose, cells = (np.eye(3), np.array([0.0, 0.0, 0.4])), np.array([[20, 60]])
    found = clear_cells(beams, sensor_pose, (1.0, 1.0, 0.0), (0.05, 0.0, 0.0), cells, until_s, heights_m)
    assert found == is_cleared
    assert (until_s[20, 60] < 0.0) == is_cleared
