"""Behaviour state, and the fault of a robot that falls.

motors off, fallen, or sitting      STATE_NOT_READY
sits down, stands up                STATE_TRANSITION
stands, also with a turned body     STATE_STANDING
walks                               STATE_STEPPING
power cut from standing             falls to the floor; no motion until a client clears the fault of the fall
walks while it does not stand       stands up first
"""

import time

import bosdyn.client.robot_command as rc
import pytest
from bosdyn.api import basic_command_pb2, estop_pb2, manipulation_api_pb2, robot_command_pb2, robot_state_pb2
from bosdyn.client.docking import blocking_undock
from bosdyn.client.exceptions import InvalidRequestError, ResponseError
from bosdyn.client.graph_nav import GraphNavClient, RobotImpairedError
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.geometry import EulerZXY
from bosdyn.util import seconds_to_duration

from errand_spot.server.computer import Pace

PACE, SHARED = Pace.CLIENT, True
Fault = robot_state_pb2.BehaviorFault
Progress = basic_command_pb2.RobotCommandFeedbackStatus
Walk = basic_command_pb2.SE2TrajectoryCommand.Feedback
Clear = robot_command_pb2.ClearBehaviorFaultResponse


def state(spot):
    told = spot.states.get_robot_state().behavior_state.state
    return robot_state_pb2.BehaviorState.State.Name(told).removeprefix("STATE_")


def faults(spot):
    return list(spot.states.get_robot_state().behavior_fault_state.faults)


def power_off(spot, *, cut):
    spot.robot.power_off(cut_immediately=cut, timeout_sec=10, update_frequency=20.0)


def power_on(spot):
    spot.robot.power_on(timeout_sec=10, update_frequency=20.0)


def sent(spot, command, ahead_s=5.0):
    return spot.commands.robot_command(command, end_time_secs=time.time() + ahead_s)


def fallen(spot):
    """Cuts the power of the standing robot, and switches it on again when the robot lies on the floor."""
    power_off(spot, cut=True)
    time.sleep(3.0)
    power_on(spot)


def test_the_behaviour_state_follows_the_body(spot):
    assert state(spot) == "STANDING"
    sent(spot, Build.synchro_velocity_command(0.3, 0.0, 0.0), ahead_s=1.0)
    time.sleep(0.5)
    assert state(spot) == "STEPPING"
    time.sleep(1.5)
    assert state(spot) == "STANDING"
    sent(spot, Build.synchro_sit_command())
    time.sleep(0.2)
    assert state(spot) == "TRANSITION"
    time.sleep(4.0)
    assert state(spot) == "NOT_READY"
    sent(spot, Build.synchro_stand_command())
    time.sleep(0.2)
    assert state(spot) == "TRANSITION"
    time.sleep(4.0)
    assert state(spot) == "STANDING"


def test_a_body_that_turns_over_its_feet_does_not_step(spot):
    sent(spot, Build.synchro_stand_command(params=Build.mobility_params(footprint_R_body=EulerZXY(yaw=0.4))))
    seen = set()
    for _ in range(20):
        time.sleep(0.1)
        seen.add(state(spot))
    assert seen == {"STANDING"} and spot.served.scripted.pose.yaw_rad == pytest.approx(0.4, abs=0.03)


def test_a_cut_from_standing_lets_the_robot_fall_and_leaves_a_fault(spot):
    before = time.time()
    power_off(spot, cut=True)
    (fault,) = faults(spot)
    assert (fault.cause, fault.status) == (Fault.CAUSE_FALL, Fault.STATUS_CLEARABLE)
    assert before <= fault.onset_timestamp.seconds + 1e-9 * fault.onset_timestamp.nanos <= time.time()
    time.sleep(3.0)
    assert spot.served.scripted.height_m < 0.3
    power_on(spot)
    assert state(spot) == "NOT_READY"


def test_a_robot_that_has_fallen_moves_only_after_a_client_clears_the_fault(spot):
    fallen(spot)
    walk = Build.synchro_velocity_command(0.2, 0.0, 0.0)
    for command in (Build.synchro_stand_command(), walk, Build.selfright_command()):
        with pytest.raises(rc.BehaviorFaultError):
            sent(spot, command)
    assert spot.served.scripted.height_m < 0.3
    assert spot.commands.clear_behavior_fault(faults(spot)[0].behavior_fault_id)
    assert not faults(spot)
    rc.blocking_stand(spot.commands, timeout_sec=5.0, update_frequency=5.0)
    assert (state(spot), spot.served.scripted.height_m) == ("STANDING", pytest.approx(0.52, abs=0.01))


def test_a_robot_that_has_fallen_does_not_dock_pick_or_navigate(spot):
    fallen(spot)
    spot.served.server.computer.dock_O = spot.served.scripted.pose
    with pytest.raises(ResponseError) as refused:
        blocking_undock(spot.robot)
    assert refused.value.response.status == refused.value.response.STATUS_ERROR_NOT_AVAILABLE
    client = spot.robot.ensure_client("manipulation")
    request = {"walk_to_object_ray_in_world": {"frame_name": "odom", "ray_end_rt_frame": {"x": 1.0}}}
    with pytest.raises(InvalidRequestError, match="has fallen"):
        client.manipulation_api_command(manipulation_api_pb2.ManipulationApiRequest(**request))
    with pytest.raises(RobotImpairedError) as refused:
        spot.robot.ensure_client(GraphNavClient.default_service_name).navigate_to("a", 5.0)
    impaired = refused.value.response.impaired_state
    assert impaired.impaired_status == impaired.IMPAIRED_STATUS_BEHAVIOR_FAULT and len(impaired.behavior_faults) == 1


def test_only_the_fault_that_there_is_can_be_cleared_and_only_by_the_lease_holder(spot):
    for number, before in ((1, lambda: None), (1, lambda: power_off(spot, cut=True)), (2, lambda: time.sleep(3.0))):
        before()  # there is no fault, the robot still falls, the fault has another number
        with pytest.raises(rc.NotClearedError):
            spot.commands.clear_behavior_fault(number)
    request = robot_command_pb2.ClearBehaviorFaultRequest(behavior_fault_id=1)
    request.header.client_name = "test"
    assert spot.commands._stub.ClearBehaviorFault(request).status == Clear.STATUS_NOT_CLEARED
    assert [fault.behavior_fault_id for fault in faults(spot)] == [1]
    assert spot.commands.clear_behavior_fault(1)


def test_a_robot_that_sits_or_settles_first_does_not_fall(spot):
    power_off(spot, cut=False)
    assert not faults(spot)
    power_on(spot)
    power_off(spot, cut=True)
    assert not faults(spot)


def test_an_estop_that_cuts_the_power_lets_the_robot_fall(spot):
    spot.served.server.computer.estop._held["tablet"].level = estop_pb2.ESTOP_LEVEL_CUT
    time.sleep(0.2)
    assert [fault.cause for fault in faults(spot)] == [Fault.CAUSE_FALL]


def test_a_cut_from_standing_is_a_fall_for_a_robot_that_can_fall(spot, monkeypatch):
    computer, fallen_at = spot.served.server.computer, []
    monkeypatch.setattr(computer.robot, "fall", lambda **named: fallen_at.append(named) or 0, raising=False)
    monkeypatch.setattr(computer, "_sits", lambda _height_m: False)
    power_off(spot, cut=True)
    assert len(fallen_at) == 1


def walks(ahead_s):
    """Commands that walk 0.5 m ahead in ahead_s, and how far they walk."""
    path = Build.synchro_se2_trajectory_point_command(0.5, 0.0, 0.0, "odom")
    point = path.synchronized_command.mobility_command.se2_trajectory_request.trajectory.points[0]
    point.time_since_reference.CopyFrom(seconds_to_duration(ahead_s))
    velocity = Build.synchro_velocity_command(0.5, 0.0, 0.0)
    return [pytest.param(path, 0.5, id="path"), pytest.param(velocity, None, id="velocity")]


def sit(spot):
    rc.blocking_sit(spot.commands, timeout_sec=5.0, update_frequency=20.0)


def sit_half(spot):
    sent(spot, Build.synchro_sit_command())
    time.sleep(0.5)


def stand_half(spot):
    sit(spot)
    sent(spot, Build.synchro_stand_command())
    time.sleep(0.2)


def settle_half(spot):
    spot.commands.robot_command(Build.safe_power_off_command())
    time.sleep(0.3)


@pytest.mark.parametrize("before", [sit, sit_half, stand_half, settle_half])
@pytest.mark.parametrize(("command", "far_m"), walks(2.0))
def test_a_robot_that_does_not_stand_stands_up_before_it_walks(spot, before, command, far_m):
    before(spot)
    scripted, seen, told = spot.served.scripted, [], set()
    number = sent(spot, command, ahead_s=9.0)
    for _ in range(40):
        time.sleep(0.1)
        seen.append((scripted.height_m, abs(scripted.pose.x_m), abs(scripted.velocity[0])))
        both = spot.commands.robot_command_feedback(number).feedback.synchronized_feedback
        told.add(both.mobility_command_feedback.se2_trajectory_feedback.final_goal_status)
    low = [(x, v) for height, x, v in seen if height < 0.5]
    assert low and all(x < 0.01 and v < 0.01 for x, v in low)
    assert all(v < 0.6 for _, _, v in seen)  # the path's clock has waited: there is nothing to make up for
    assert scripted.pose.x_m == pytest.approx(far_m, abs=0.03) if far_m else scripted.pose.x_m > 0.5
    assert Walk.FINAL_GOAL_STATUS_BLOCKED not in told
    assert state(spot) in ("STANDING", "STEPPING")


def test_a_safe_power_off_that_a_stand_replaces_is_not_reported_as_done(spot):
    number = spot.commands.robot_command(Build.safe_power_off_command())
    time.sleep(0.3)
    rc.blocking_stand(spot.commands, timeout_sec=5.0, update_frequency=20.0)
    told = spot.commands.robot_command_feedback(number).feedback.full_body_feedback
    assert told.safe_power_off_feedback.status == told.safe_power_off_feedback.STATUS_IN_PROGRESS
    assert told.status == Progress.STATUS_COMMAND_OVERRIDDEN
    time.sleep(3.0)
    assert spot.robot.is_powered_on() and state(spot) == "STANDING"


def test_a_client_that_takes_the_arm_does_not_keep_the_body_from_standing_up(spot):
    sit(spot)
    sent(spot, walks(2.0)[0].values[0], ahead_s=9.0)
    time.sleep(0.2)
    spot.served.login().ensure_client("lease").take("arm")
    time.sleep(5.0)
    assert spot.served.scripted.pose.x_m == pytest.approx(0.5, abs=0.03)


def test_a_command_during_an_estop_that_settles_the_robot_is_refused(spot):
    spot.served.server.computer.estop._held["tablet"].level = estop_pb2.ESTOP_LEVEL_SETTLE_THEN_CUT
    time.sleep(0.2)
    with pytest.raises(rc.NotPoweredOnError):
        sent(spot, Build.synchro_stand_command())
    time.sleep(4.0)
    assert not spot.robot.is_powered_on() and not faults(spot)
