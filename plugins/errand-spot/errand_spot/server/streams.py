"""State of the robot as a stream, and of its mission service, to which no mission can be loaded."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Semaphore
from typing import Any, Final

from bosdyn.api import robot_state_pb2
from bosdyn.api.mission import mission_pb2

from errand_spot.messages import InvalidRequestError, our_joint, pose, timestamp, velocity
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer, Snapshot
from errand_spot.server.identity import DOMAIN
from errand_spot.server.joint_control import Updates, joint_names, positions
from errand_spot.server.mobility import FEET_M

_REPEATED_S: Final = 1.0
"""Longest time without a message of a stream, so that its end is noticed while the robot's clock stands."""
_MOST_STREAMS: Final = 8
"""Most streams at a time: each occupies a thread of the server."""


class RobotStateStreamingService(Service):
    """Streams joints, pose, and the last message of joint control, after each step."""

    name, type, authority = "robot-state-streaming", "bosdyn.api.RobotStateStreamingService", f"state.{DOMAIN}"

    def __init__(self, computer: Computer, updates: Updates) -> None:
        self._computer, self._updates, self._free = computer, updates, Semaphore(_MOST_STREAMS)

    def GetRobotStateStream(self, _request: Any, _call: Call) -> Iterator[Any]:
        """Yields the state until the client ends the call."""
        if not self._free.acquire(blocking=False):
            raise InvalidRequestError(f"at most {_MOST_STREAMS} streams are served at a time")
        try:
            while True:
                yield self._state(self._computer.snapshot)
                self._computer.wait_for_step(_REPEATED_S)
        finally:
            self._free.release()

    def _state(self, snapshot: Snapshot) -> Any:
        made, joints, stamp = robot_state_pb2.RobotStateStreamResponse(), snapshot.joints, timestamp(snapshot.time_s)
        made.joint_states.acquisition_timestamp.CopyFrom(stamp)
        names = joint_names(self._computer)
        made.joint_states.position.extend(positions(snapshot, names))
        made.joint_states.velocity.extend(joints.velocity_rad_s.get(our_joint(name), 0.0) for name in names)
        made.joint_states.load.extend(joints.effort_nm.get(our_joint(name), 0.0) for name in names)
        if self._updates.received:
            made.last_command.user_command_key = self._updates.last_key
            made.last_command.received_timestamp.CopyFrom(timestamp(self._updates.last_s))
        kinematic, X_OB = made.kinematic_state, pose(snapshot.odometry.X_OB)
        kinematic.acquisition_timestamp.CopyFrom(stamp)
        kinematic.odom_tform_body.CopyFrom(X_OB)
        kinematic.vision_tform_body.CopyFrom(X_OB)
        vx, vy, wz = snapshot.odometry.velocity
        moving = velocity(snapshot.odometry.X_OB.rotation() @ [vx, vy, 0.0], (0.0, 0.0, wz))
        kinematic.velocity_of_body_in_odom.CopyFrom(moving)
        kinematic.velocity_of_body_in_vision.CopyFrom(moving)
        made.contact_states.extend([robot_state_pb2.FootState.CONTACT_MADE] * len(FEET_M))
        return made


class MissionService(Service):
    """Answers that no mission is loaded; loading one is unimplemented."""

    name, type, authority = "robot-mission", "bosdyn.api.mission.MissionService", f"mission.{DOMAIN}"

    def GetState(self, _request: Any, _call: Call) -> Any:
        """Returns the state without a mission."""
        State = mission_pb2.State
        return mission_pb2.GetStateResponse(state=State(status=State.STATUS_NONE, tick_counter=-1, mission_id=-1))

    def GetInfo(self, _request: Any, _call: Call) -> Any:
        """Returns no information."""
        return mission_pb2.GetInfoResponse()

    def GetMission(self, _request: Any, _call: Call) -> Any:
        """Returns no mission."""
        return mission_pb2.GetMissionResponse(id=-1)

    def PlayMission(self, _request: Any, _call: Call) -> Any:
        """Refuses to play."""
        return mission_pb2.PlayMissionResponse(status=mission_pb2.PlayMissionResponse.STATUS_NO_MISSION)

    def RestartMission(self, _request: Any, _call: Call) -> Any:
        """Refuses to restart."""
        return mission_pb2.RestartMissionResponse(status=mission_pb2.RestartMissionResponse.STATUS_NO_MISSION)

    def PauseMission(self, _request: Any, _call: Call) -> Any:
        """Refuses to pause."""
        return mission_pb2.PauseMissionResponse(status=mission_pb2.PauseMissionResponse.STATUS_NO_MISSION_PLAYING)

    def StopMission(self, _request: Any, _call: Call) -> Any:
        """Refuses to stop."""
        return mission_pb2.StopMissionResponse(status=mission_pb2.StopMissionResponse.STATUS_NO_MISSION_PLAYING)

    def AnswerQuestion(self, _request: Any, _call: Call) -> Any:
        """Knows no question."""
        Response = mission_pb2.AnswerQuestionResponse
        return Response(status=Response.STATUS_INVALID_QUESTION_ID)
