"""Perception of a served robot, and GraphNav maps of worlds."""

import numpy as np
import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from errand_spot.perception import SpotPerception, world_map
from errand_spot.server.graph_map import write_map
from executive.app.prepare.worlds import open_world
from skills.robot import Pose2D
from skills.testing.blocks import Block
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

ROOM = [Block(2.0, -2.0, 2.2, 2.0), Block(-1.5, 2.0, 2.0, 2.2), Block(-1.5, -2.2, 1.0, -2.0)]


@pytest.fixture(scope="module")
def flat():
    return world_map(open_world("flat"))


@pytest.fixture
def robot():
    return ScriptedRobot(VirtualClock(), blocks=ROOM)


def points_of(robot):
    scan = robot.scan()
    return (scan.X_OB @ scan.points_B().T).T


def test_a_scan_corrects_the_first_guess_and_the_localiser_follows(robot):
    localiser = SpotPerception({}).localiser(points_of(robot))
    found = localiser.start(Pose2D(0.2, -0.15, 0.1), robot.scan(), 0.5)
    assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    pose, sure = localiser.update(robot)
    assert sure
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=0.05)


def test_points_far_off_cost_neither_memory_nor_the_place(robot):
    localiser = SpotPerception({}).localiser(np.vstack([points_of(robot), [[9e8, -9e8, 1.0]]]))
    assert localiser.start(Pose2D(0.2, 0.0, 0.0), robot.scan(), 0.5) is not None


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.array([[30.0, 30.0, 1.0]]), np.array([[1.0, 1.0, 0.1]])])
def test_a_scan_that_fits_nowhere_localises_nothing(robot, points):
    assert SpotPerception({}).localiser(points).start(Pose2D(0.0, 0.0, 0.0), robot.scan(), 0.5) is None


def test_each_place_of_a_world_is_reached_from_its_start(flat):
    for place in ("hall", "kitchen", "living-room", "bedroom", "bathroom", "workshop", "office"):
        assert flat.route("start", [place])[-1] == place
    kitchen = flat.poses("start")["kitchen"]
    assert kitchen.translation() == pytest.approx([8.4, 6.9, 0.52], abs=0.02)


def test_the_points_of_a_map_are_the_walls_of_the_world(flat):
    points = flat.points(flat.poses("start"))
    assert points[:, 2].min() >= 0.69 and points[:, 2].max() <= 1.31
    assert (points.min(axis=0)[:2], points.max(axis=0)[:2]) == (
        pytest.approx([0.0, 0.0], abs=0.2),
        pytest.approx([12.0, 9.0], abs=0.2),
    )


def test_a_map_is_written_as_the_sdk_reads_it(flat, tmp_path):
    from bosdyn.api.graph_nav import map_pb2

    write_map(flat, tmp_path / "map")
    graph = map_pb2.Graph.FromString((tmp_path / "map" / "graph").read_bytes())
    assert graph == flat.graph
    for waypoint in graph.waypoints:
        file = tmp_path / "map" / "waypoint_snapshots" / waypoint.snapshot_id
        assert map_pb2.WaypointSnapshot.FromString(file.read_bytes()).id == waypoint.snapshot_id
