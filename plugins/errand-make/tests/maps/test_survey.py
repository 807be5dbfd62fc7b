import json
import math
from dataclasses import replace

import numpy as np
import pytest

from errand_make.maps.map_folder import load_mapper, map_grids, save_graph, save_grids
from errand_make.maps.mapper import Mapper
from errand_make.maps.survey import Survey
from skills.geometry import relative_pose
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from skills.testing.clock import VirtualClock
from tests.skills.planar_robot import TWO_ROOMS, Box, PlanarRobot, capabilities_of, grids_of

pytest.importorskip("gtsam")

START, CORNER = Pose2D(1.5, 5.4, 0.0), Pose2D(1.0, 1.0, 0.0)
SIDE_ROOM = (
    Box(-0.1, -0.1, 6.1, 0.0),
    Box(-0.1, 3.0, 6.1, 3.1),
    Box(-0.1, 0.0, 0.0, 3.0),
    Box(6.0, 0.0, 6.1, 3.0),
    Box(3.3, 0.0, 3.4, 1.9),
    Box(3.3, 2.8, 3.4, 3.0),
)
"""A room and another beside it, through a door of 0.9 m in a corner."""


class Trip:
    """A robot among boxes that makes a map."""

    def __init__(self, *, mapper=None, route=None, pose=START, home=None, boxes=TWO_ROOMS):
        self.clock = VirtualClock()
        self.robot = PlanarRobot(self.clock, boxes, pose, capabilities=capabilities_of(cameras=False))
        self.mapper = mapper or Mapper(pose)
        lease = self.robot.acquire_lease("test")
        self.survey = Survey(self.robot, lease, self.mapper, home=home or pose, route=route)

    def go_on(self, most_s):
        end_s = self.clock.now() + most_s
        while self.clock.now() < end_s and not self.survey.done:
            self.clock.advance(0.05)
            self.survey.tick(self.clock.now())

    def off(self):
        off = relative_pose(self.robot.pose, self.mapper.pose)
        return math.hypot(off.x_m, off.y_m), abs(off.yaw_rad)


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    trip = Trip(pose=CORNER, boxes=SIDE_ROOM)
    trip.go_on(300.0)
    folder = tmp_path_factory.mktemp("map")
    save_graph(folder, trip.mapper)
    save_grids(folder, map_grids(trip.mapper))
    return trip, folder


def test_all_rooms_are_explored_without_a_touch_and_the_robot_comes_home(explored):
    trip, folder = explored
    assert trip.survey.done and trip.survey.trouble is None
    assert trip.robot.least_clearance_m > 0.0
    off = relative_pose(CORNER, trip.robot.pose)
    assert math.hypot(off.x_m, off.y_m) < 0.2
    made, true = load_grid_map(folder / "keepout.yaml"), grids_of(SIDE_ROOM)[1]
    free = true.centres(np.argwhere(true.distance > 0.4))
    rows, columns = made.cells(free[(free > 0.0).all(axis=1) & (free < [6.0, 3.0]).all(axis=1)]).T
    assert np.mean(~(made.occupied | made.unknown)[rows, columns]) > 0.95


def test_the_walls_of_the_map_are_those_of_the_truth(explored):
    _, folder = explored
    made, true = load_grid_map(folder / "scan.yaml"), grids_of(SIDE_ROOM)[0]
    walls = made.centres(np.argwhere(made.occupied))
    assert len(walls) > 500
    assert np.mean(true.distance_m(walls) < 0.05) > 0.95


def test_the_pose_stays_within_centimetres(explored):
    trip, _ = explored
    distance_m, yaw_rad = trip.off()
    assert distance_m < 0.05 and yaw_rad < math.radians(1.0)


def test_a_saved_map_goes_on_where_the_robot_begins_again(explored):
    trip, folder = explored
    before = len(trip.mapper.keyframes)
    pose = Pose2D(CORNER.x_m + 0.2, CORNER.y_m - 0.1, 0.1)
    again = Trip(mapper=load_mapper(folder), pose=pose, boxes=SIDE_ROOM)
    again.go_on(3.0)
    assert len(again.mapper.keyframes) > before
    assert again.off()[0] < 0.05
    assert again.survey.trouble is None


def change_graph(**values):
    def change(folder):
        document = json.loads((folder / "pose_graph.json").read_text())
        (folder / "pose_graph.json").write_text(json.dumps({**document, **values}))

    return change


def an_edge(**values):
    covariance = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    return {"from": 0, "to": 1, "measured": [0, 0, 0], "covariance": covariance, "closure": True, **values}


def change_arrays(**values):
    def change(folder):
        with np.load(folder / "keyframes.npz") as file:
            arrays = dict(file)
        np.savez(folder / "keyframes.npz", **{**arrays, **values})

    return change


def cut(name, size):
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:size])


@pytest.mark.parametrize(
    ("damage", "file", "said"),
    [
        (cut("pose_graph.json", 200), "pose_graph.json", "no pose graph"),
        (cut("keyframes.npz", 0), "keyframes.npz", "no recording"),
        (cut("keyframes.npz", 500), "keyframes.npz", "no recording"),
        (cut("keyframes.npz", -3), "keyframes.npz", "no recording"),
        (lambda folder: (folder / "keyframes.npz").unlink(), "keyframes.npz", "no such file"),
        (change_graph(edges=[an_edge(to=9_999)]), "pose_graph.json", "it names keyframe 9999"),
        (change_graph(edges=[an_edge(to=-1)]), "pose_graph.json", "edges"),
        (change_graph(edges=[an_edge(covariance=[[0] * 3] * 3)]), "pose_graph.json", "positive definite"),
        (change_graph(edges=[an_edge(measured=["x", 0, 0])]), "pose_graph.json", "measured"),
        (change_graph(submaps=[{"anchor": 9_999, "members": {}}]), "pose_graph.json", "keyframe 9999"),
        (change_graph(stamps_s=[0.0]), "pose_graph.json", "stamps"),
        (change_graph(poses=[]), "pose_graph.json", "poses"),
        (change_graph(form=2), "pose_graph.json", "form"),
        (change_arrays(odometry=np.zeros((1, 3))), "keyframes.npz", "odometry"),
        (change_arrays(points=np.zeros(3)), "keyframes.npz", "points"),
    ],
)
def test_a_damaged_map_is_refused_in_its_file(explored, tmp_path, damage, file, said):
    for name in ("pose_graph.json", "keyframes.npz"):
        (tmp_path / name).write_bytes((explored[1] / name).read_bytes())
    damage(tmp_path)
    with pytest.raises(InputError, match=said) as error:
        load_mapper(tmp_path)
    assert error.value.file == tmp_path / file


def test_a_route_is_driven_and_unreachable_points_are_reported():
    trip = Trip(route=[(4.0, 5.4), (4.25, 3.0), (3.0, 5.4)])
    trip.go_on(90.0)
    assert trip.survey.done
    assert [note for note in trip.survey.notes if "(4.2, 3.0)" in note]
    assert trip.mapper.driven_m > 4.0


def test_a_survey_that_cannot_return_reports_it():
    trip = Trip(route=[(2.0, 5.4)], home=Pose2D(30.0, 5.4, 0.0))
    trip.go_on(30.0)
    assert trip.survey.done
    assert "back to the start" in trip.survey.trouble


def test_abandoned_frontiers_are_tried_again_from_home():
    trip, drive, first = Trip(pose=CORNER, boxes=SIDE_ROOM), PlanarRobot.drive, True

    def held(vx, vy, wz, *, until_s, lease):
        """Blocks the side room until the robot has been home."""
        nonlocal first
        purpose, pose = trip.survey.goal
        first = first and purpose != "the start"
        speed = 0.0 if first and pose.x_m > 2.5 else 1.0
        return drive(trip.robot, speed * vx, speed * vy, speed * wz, until_s=until_s, lease=lease)

    trip.robot.drive = held
    while first and trip.clock.now() < 200.0:
        trip.go_on(1.0)
    assert not first and not trip.survey.done
    assert side_room_seen(trip) < 0.9
    trip.go_on(200.0)
    assert trip.survey.done and trip.survey.trouble is None
    assert side_room_seen(trip) > 0.97


def side_room_seen(trip):
    """The share of the side room's free ground that is free on the map."""
    (_, true), (made, _) = grids_of(SIDE_ROOM), trip.survey.known_grid()
    free = true.centres(np.argwhere(true.distance > 0.3))
    free = free[(free > [3.4, 0.0]).all(axis=1) & (free < [6.0, 3.0]).all(axis=1)]
    rows, columns = made.cells(free).T
    return float(np.mean(~(made.occupied | made.unknown)[rows, columns]))


@pytest.mark.parametrize("fault", ["blank", "frozen", "gone"])
def test_without_a_usable_scan_the_robot_stands_and_says_why(fault):
    trip = Trip()
    trip.go_on(4.0)
    assert trip.robot.driving
    last = trip.robot.scan()
    scans = {
        "blank": lambda: blank(PlanarRobot.scan(trip.robot)),
        "frozen": lambda: replace(PlanarRobot.scan(trip.robot), ranges_m=last.ranges_m),
        "gone": lambda: last,
    }
    trip.robot.scan = scans[fault]
    trip.go_on(20.0)
    assert trip.survey.done and not trip.robot.driving
    assert "no usable scan" in trip.survey.trouble


def blank(scan):
    """Makes all ranges invalid."""
    return replace(scan, ranges_m=np.full_like(scan.ranges_m, np.nan))
