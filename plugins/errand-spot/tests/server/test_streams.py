"""State of the robot as a stream, and the mission service without a mission."""

import time

import pytest
from bosdyn.api import header_pb2
from bosdyn.api.mission import mission_pb2, mission_service_pb2_grpc
from bosdyn.client.common import BaseClient
from bosdyn.client.robot_state import RobotStateStreamingClient

from errand_spot.server.computer import Pace

PACE, SHARED = Pace.CLIENT, True


class MissionClient(BaseClient):
    default_service_name, service_type = "robot-mission", "bosdyn.api.mission.MissionService"

    def __init__(self):
        super().__init__(mission_service_pb2_grpc.MissionServiceStub)

    def ask(self, call, request):
        return self.call(getattr(self._stub, call), request)


def test_the_state_is_streamed_with_legs_and_arm_in_the_order_of_the_api(spot):
    stream = spot.client(RobotStateStreamingClient).get_robot_state_stream()
    first = next(stream)
    arm_rad = spot.served.scripted.q_rad
    assert len(first.joint_states.position) == len(first.joint_states.load) == 19
    assert first.joint_states.position[12:18] == pytest.approx(arm_rad, abs=1e-5)
    time.sleep(1.0)
    since_ns = first.kinematic_state.acquisition_timestamp.ToNanoseconds() + 0.9e9
    later = next(each for each in stream if each.kinematic_state.acquisition_timestamp.ToNanoseconds() > since_ns)
    assert later.kinematic_state.odom_tform_body.position.z == pytest.approx(0.52, abs=0.01)


def test_streams_above_the_most_are_refused_until_another_ends(spot):
    client = spot.client(RobotStateStreamingClient)
    streams = [client.get_robot_state_stream() for _ in range(8)]
    assert all(len(next(each).joint_states.position) == 19 for each in streams)
    refused = next(client.get_robot_state_stream()).header.error
    assert (refused.code, "at most 8 streams" in refused.message) == (header_pb2.CommonError.CODE_INVALID_REQUEST, True)
    streams[0].cancel()
    until = time.monotonic() + 10.0
    while next(client.get_robot_state_stream()).header.error.code != header_pb2.CommonError.CODE_OK:
        assert time.monotonic() < until
        time.sleep(0.1)


Info, Play, Stop = mission_pb2.GetStateRequest, mission_pb2.PlayMissionRequest, mission_pb2.StopMissionRequest


def test_no_mission_is_loaded_and_none_can_be_played(spot):
    missions = spot.client(MissionClient)
    state = missions.ask("GetState", Info()).state
    assert (state.status, state.mission_id) == (mission_pb2.State.STATUS_NONE, -1)
    assert missions.ask("PlayMission", Play()).status == mission_pb2.PlayMissionResponse.STATUS_NO_MISSION
    assert missions.ask("StopMission", Stop()).status == mission_pb2.StopMissionResponse.STATUS_NO_MISSION_PLAYING
