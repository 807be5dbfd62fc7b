"""Docking: onto the dock and off it, and the answer to each command that cannot be done. The dock is 0.8 m ahead."""

import time

import numpy as np
import pytest
from bosdyn.api import robot_state_pb2
from bosdyn.api.docking import docking_pb2
from bosdyn.client.docking import blocking_dock_robot, blocking_go_to_prep_pose, blocking_undock, get_dock_id
from bosdyn.client.exceptions import InvalidRequestError, ResponseError
from bosdyn.client.frame_helpers import get_odom_tform_body
from bosdyn.client.robot_command import DockedError
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from errand_spot.messages import timestamp
from errand_spot.server import docking
from errand_spot.server.computer import Pace
from errand_spot.server.docking import DOCK_ID
from errand_spot.server.obstacles import SeenSpace
from errand_spot.server.scan_points import Region
from skills.footprint import Footprint, footprint_clearance_m, pose_array
from skills.robot import Pose2D
from skills.testing.blocks import Block
from tests.tables import table

PACE, SHARED = Pace.CLIENT, True
Api = docking_pb2
Answer, Progress, State = Api.DockingCommandResponse, Api.DockingCommandFeedbackResponse, Api.DockState


@pytest.fixture
def at_home(spot):
    """A standing robot that knows its dock."""
    spot.served.server.computer.dock_O = Pose2D(0.8, 0.0, 3.1416)
    return spot


def client(spot):
    return spot.robot.ensure_client("docking")


def command(spot, *, number=DOCK_ID, behaviour=0, ahead_s=20.0, clock=None, **named):
    clock = clock or spot.robot.time_sync.endpoint.clock_identifier
    end = timestamp(time.time() + ahead_s)
    return client(spot).docking_command_full(number, clock, end, behaviour, **named).docking_command_id


def ended(spot, number, seconds=20.0):
    """Waits for the end of a command; returns its status."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if (status := client(spot).docking_command_feedback_full(number).status) != Progress.STATUS_IN_PROGRESS:
            return status
        time.sleep(0.05)
    raise AssertionError("still in progress")


def state(spot):
    return client(spot).get_docking_state().status


def power(spot):
    return spot.states.get_robot_state().power_state.shore_power_state


def test_the_robot_docks_charges_and_undocks(at_home):
    spot, Power = at_home, robot_state_pb2.PowerState
    assert (state(spot), power(spot)) == (State.DOCK_STATUS_UNDOCKED, Power.SHORE_POWER_STATE_OFF)
    blocking_dock_robot(spot.robot, DOCK_ID)
    time.sleep(0.2)
    assert (get_dock_id(spot.robot), power(spot)) == (DOCK_ID, Power.SHORE_POWER_STATE_ON)
    assert not spot.robot.is_powered_on()
    body = get_odom_tform_body(spot.tree)
    assert (body.x, body.y) == pytest.approx((0.8, 0.0), abs=0.05)
    spot.robot.power_on(timeout_sec=10, update_frequency=20.0)
    with pytest.raises(DockedError):
        spot.commands.robot_command(Build.synchro_stand_command())
    blocking_undock(spot.robot)
    assert state(spot) == State.DOCK_STATUS_UNDOCKED
    assert get_odom_tform_body(spot.tree).x == pytest.approx(-0.1, abs=0.06)


def test_the_prep_pose_is_before_the_dock(at_home):
    blocking_go_to_prep_pose(at_home.robot, DOCK_ID)
    body = get_odom_tform_body(at_home.tree)
    assert (body.x, abs(body.rot.to_yaw())) == (pytest.approx(-0.1, abs=0.05), pytest.approx(3.14, abs=0.06))


WALL = [(x, y) for x in np.arange(0.5, 2.0, 0.05) for y in (-1.0, -0.2)]
"""Points of two walls beside the dock and before it; the body does not fit through on a straight line."""


@pytest.mark.parametrize("points", [[], WALL], ids=["free", "walls"])
def test_the_path_to_the_dock_keeps_clear_of_obstacles(spot, points):
    computer, dock_O = spot.served.server.computer, Pose2D(1.5, -1.5, 3.1416)
    computer.scan_points.points_O = np.array(points).reshape(-1, 2)
    path = docking._Docking(Api.PREP_POSE_USE_POSE, dock_O, 0.0)._path(computer)
    assert (path[-1].x_m, path[-1].y_m) == pytest.approx((0.6, -1.5), abs=0.01)
    clearance = footprint_clearance_m(SeenSpace(computer), Footprint.of(computer.capabilities), pose_array(path))
    assert clearance.min() > 0.04


def test_a_robot_whose_dock_no_path_reaches_is_stuck_and_stays(at_home):
    spot = at_home
    sides = [
        ((-0.7, -0.9), (0.7, -0.7)),
        ((-0.7, 0.7), (0.7, 0.9)),
        ((-1.0, -0.9), (-0.8, 0.9)),
        ((0.7, -0.9), (0.9, 0.9)),
    ]
    spot.served.scripted.blocks += [Block(*low, *high) for low, high in sides]
    spot.served.server.computer.dock_O = Pose2D(2.0, 0.0, 3.1416)
    time.sleep(0.5)
    assert ended(spot, command(spot)) == Progress.STATUS_ERROR_STUCK
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.0, abs=0.02)


def test_a_no_go_region_before_the_dock_keeps_the_robot_away(at_home):
    computer = at_home.served.server.computer
    corners = np.array([(-0.4, -3.0), (-0.2, -3.0), (-0.2, 3.0), (-0.4, 3.0)])
    computer.regions = [Region(corners + [0.0, 4.0], float("inf")), Region(corners, float("inf"))]
    computer.dock_O = Pose2D(-1.5, 0.0, 0.0)
    assert ended(at_home, command(at_home)) == Progress.STATUS_ERROR_STUCK


def far_away(spot):
    spot.served.server.computer.dock_O = Pose2D(9.0, 0.0, 0.0)


def holding(spot):
    spot.served.server.computer.grip.holding = True


def motors_off(spot):
    spot.robot.power_off(cut_immediately=True, timeout_sec=10, update_frequency=20.0)


@pytest.mark.parametrize(
    ("before", "wanted", "status"),
    [
        (lambda spot: None, {"number": 521}, Answer.STATUS_ERROR_DOCK_NOT_FOUND),
        (lambda spot: None, {"require_fiducial": True}, Answer.STATUS_ERROR_DOCK_NOT_FOUND),
        (lambda spot: None, {"behaviour": Api.PREP_POSE_UNDOCK, "number": 0}, Answer.STATUS_ERROR_NOT_DOCKED),
        (far_away, {}, Answer.STATUS_ERROR_DOCK_NOT_FOUND),
        (holding, {}, Answer.STATUS_ERROR_GRIPPER_HOLDING_ITEM),
        (motors_off, {}, Answer.STATUS_ERROR_NOT_AVAILABLE),
    ],
    ids=["dock", "fiducial", "not docked", "far away", "holding", "motors off"],
)
def test_a_command_that_cannot_be_done_is_refused(at_home, before, wanted, status):
    before(at_home)
    with pytest.raises(ResponseError) as refused:
        command(at_home, **wanted)
    assert refused.value.response.status == status and not any(at_home.served.scripted.velocity)


@pytest.mark.parametrize(*table(__file__, "ended"))
def test_a_command_whose_end_time_is_over_or_does_not_count_ends(at_home, wanted, status):
    assert Progress.Status.Name(ended(at_home, command(at_home, **wanted))) == status
    time.sleep(0.7)
    assert not any(at_home.served.scripted.velocity)


def test_a_later_command_takes_the_place_of_an_earlier_one(at_home):
    first = command(at_home)
    command(at_home, behaviour=Api.PREP_POSE_ONLY_POSE)
    assert ended(at_home, first) == Progress.STATUS_OLD_DOCKING_COMMAND


def test_another_motion_ends_docking(at_home):
    number = command(at_home)
    assert state(at_home) == State.DOCK_STATUS_DOCKING
    at_home.commands.robot_command(Build.stop_command())
    assert ended(at_home, number) == Progress.STATUS_ERROR_LEASE


def test_a_robot_without_a_dock_lists_none(spot):
    assert not client(spot).get_docking_config()
    with pytest.raises(ResponseError):
        command(spot)


def test_the_dock_is_in_the_configuration(at_home):
    configured = client(at_home).get_docking_config()
    assert [(each.id_start, each.id_end) for each in configured] == [(DOCK_ID, DOCK_ID)]


def test_feedback_of_an_unknown_command_is_an_invalid_request(at_home):
    with pytest.raises(InvalidRequestError):
        client(at_home).docking_command_feedback_full(4711)
