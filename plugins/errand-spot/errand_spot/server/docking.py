"""Docking at the robot's own dock at its known pose: prep pose, dock, undock, and the state on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import count
from typing import Any, Final

from bosdyn.api import lease_pb2
from bosdyn.api.docking import docking_pb2
from pydrake.math import RigidTransform

from errand_spot.messages import InvalidRequestError, seconds
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer
from errand_spot.server.identity import DOMAIN, TimeSyncService
from errand_spot.server.leases import LeaseService
from errand_spot.server.obstacles import SeenSpace
from errand_spot.server.refusals import LONGEST_S
from errand_spot.server.task import WHOLE, Steps, Task, stow, walk
from skills.api import PlanningError
from skills.footprint import Footprint
from skills.navigate.planner import LatticePlanner, plan_path
from skills.robot import Pose2D

DOCK_ID: Final = 520
"""Number of the dock: that of a real Spot's first fiducial."""
_PREP_M: Final = 0.9
_NEAR_M: Final = 4.0
_TRIES, _MOST_POSES, _PADDING_M = 3, 120, 0.02
_PLANNER: Final = LatticePlanner(least_margin_m=0.03)
_REMEMBERED: Final = 20
Api: Final = docking_pb2
Progress: Final = docking_pb2.DockingCommandFeedbackResponse


class _Docking(Task):
    """Goes to the prep pose, onto the dock, or off it, until an end time (robot time)."""

    broken = Progress.STATUS_ERROR_LEASE

    def __init__(self, behaviour: int, dock_O: Pose2D, end_s: float) -> None:
        self.behaviour, self._dock_O, self.end_s = behaviour, dock_O, end_s
        self._prep_O = Pose2D.from_transform(dock_O.transform() @ RigidTransform([_PREP_M, 0.0, 0.0]))
        super().__init__(Progress.STATUS_IN_PROGRESS)

    def tick(self, computer: Computer) -> None:
        """Goes on until the end time."""
        if self._steps is not None and computer.now_s() >= self.end_s:
            self.end(0)
            self.state = Progress.STATUS_ERROR_COMMAND_TIMED_OUT
            computer.robot.stop(lease=computer.lease)
        super().tick(computer)

    def _run(self, computer: Computer) -> Steps:
        if computer.docked() and self.behaviour in (Api.PREP_POSE_USE_POSE, Api.PREP_POSE_SKIP_POSE):
            return int(Progress.STATUS_DOCKED)
        if self.behaviour != Api.PREP_POSE_UNDOCK:
            yield from stow(computer)
        if self.behaviour not in (Api.PREP_POSE_UNDOCK, Api.PREP_POSE_SKIP_POSE):
            for _ in range(_TRIES):
                if (path := self._path(computer)) is None or (yield from walk(computer, *path, padding_m=_PADDING_M)):
                    break
            if path is None or not computer.near(self._prep_O):
                return int(Progress.STATUS_ERROR_STUCK)
        for pose_O in self._straight(computer):
            if not (yield from walk(computer, pose_O, padding_m=_PADDING_M)):
                return int(Progress.STATUS_ERROR_STUCK)
        if self.behaviour in (Api.PREP_POSE_ONLY_POSE, Api.PREP_POSE_UNDOCK):
            return int(Progress.STATUS_AT_PREP_POSE)
        computer.sit()
        while not computer.snapshot.sitting:
            yield
        if not computer.docked():
            return int(Progress.STATUS_MISALIGNED)
        computer.do(computer.switch_off)
        return int(Progress.STATUS_DOCKED)

    def _path(self, computer: Computer) -> Sequence[Pose2D] | None:
        """Path to the place before the dock, clear of what the LiDAR has shown and of no-go regions; None without."""
        here, footprint = computer.snapshot.odometry.pose, Footprint.of(computer.capabilities)
        try:
            rows = plan_path(SeenSpace(computer), footprint, here, self._prep_O, _PLANNER).poses
        except PlanningError:
            return None
        return [Pose2D(*row) for row in rows[:: -math.ceil(len(rows) / _MOST_POSES)][::-1].tolist()]

    def _straight(self, computer: Computer) -> Sequence[Pose2D]:
        """Poses straight onto the dock from the place before it, or off the dock."""
        here = computer.snapshot.odometry.pose
        if self.behaviour == Api.PREP_POSE_SKIP_POSE:
            return [Pose2D(here.x_m, here.y_m, self._dock_O.yaw_rad), self._dock_O]
        ways = {Api.PREP_POSE_ONLY_POSE: [], Api.PREP_POSE_UNDOCK: [self._prep_O]}
        return ways.get(self.behaviour, [self._dock_O])


class DockingService(Service):
    """Docks the robot at its dock, and tells whether it is there."""

    name, type, authority = "docking", "bosdyn.api.docking.DockingService", f"docking.{DOMAIN}"

    def __init__(self, computer: Computer, leases: LeaseService, clocks: TimeSyncService) -> None:
        self._computer, self._leases, self._clocks = computer, leases, clocks
        self._ids, self._tasks = count(1), dict[int, _Docking]()

    def DockingCommand(self, request: Any, _call: Call) -> Any:
        """Starts to dock or undock in place of all motions."""
        Response, computer = Api.DockingCommandResponse, self._computer
        used, dock_O = self._leases.use(request.lease, WHOLE), computer.dock_O
        if used.status != lease_pb2.LeaseUseResult.STATUS_OK:
            return Response(lease_use_result=used, status=Response.STATUS_ERROR_LEASE)
        behaviour = request.prep_pose_behavior or Api.PREP_POSE_USE_POSE
        refused = self._refused(request, behaviour)
        if refused is not None or dock_O is None:
            return Response(lease_use_result=used, status=refused or Response.STATUS_ERROR_DOCK_NOT_FOUND)
        task, number = _Docking(behaviour, dock_O, seconds(request.end_time)), next(self._ids)
        for earlier in self._tasks.values():
            earlier.broken = Progress.STATUS_OLD_DOCKING_COMMAND
        self._tasks = {**dict(list(self._tasks.items())[-_REMEMBERED:]), number: task}
        if (late := self._late(request.clock_identifier, task.end_s)) is not None:
            task.state = late
        else:
            computer.do(lambda: computer.move(dict.fromkeys(WHOLE, task)))
        return Response(lease_use_result=used, status=Response.STATUS_OK, docking_command_id=number)

    def DockingCommandFeedback(self, request: Any, _call: Call) -> Any:
        """Tells how far a command has come; may change its end time."""
        if (task := self._tasks.get(request.docking_command_id)) is None:
            raise InvalidRequestError(f"docking_command_id: there is no command {request.docking_command_id}")
        if request.update_docking_params.HasField("end_time"):
            end_s = seconds(request.update_docking_params.end_time)
            task.end_s = min(end_s, self._computer.now_s() + LONGEST_S)
        return Progress(status=task.state)

    def GetDockingConfig(self, _request: Any, _call: Call) -> Any:
        """Lists the one dock that there is."""
        made = Api.GetDockingConfigResponse()
        if self._computer.dock_O is not None:
            made.dock_configs.add(id_start=DOCK_ID, id_end=DOCK_ID, type=Api.DOCK_TYPE_SPOT_DOCK)
        return made

    def GetDockingState(self, _request: Any, _call: Call) -> Any:
        """Returns whether the robot is on its dock, drives to it, or leaves it."""
        State = Api.DockState
        running = [task for task in self._tasks.values() if task.state == Progress.STATUS_IN_PROGRESS]
        if running:
            leaves = running[-1].behaviour == Api.PREP_POSE_UNDOCK
            status = State.DOCK_STATUS_UNDOCKING if leaves else State.DOCK_STATUS_DOCKING
            return Api.GetDockingStateResponse(dock_state=State(status=status))
        if not self._computer.docked():
            return Api.GetDockingStateResponse(dock_state=State(status=State.DOCK_STATUS_UNDOCKED))
        on = State(status=State.DOCK_STATUS_DOCKED, dock_type=Api.DOCK_TYPE_SPOT_DOCK, dock_id=DOCK_ID)
        on.power_status = State.LINK_STATUS_CONNECTED
        return Api.GetDockingStateResponse(dock_state=on)

    def _refused(self, request: Any, behaviour: int) -> int | None:
        """Status of a refused command; None for an allowed one."""
        Response, computer, dock_O = Api.DockingCommandResponse, self._computer, self._computer.dock_O
        if not computer.able:
            return int(Response.STATUS_ERROR_NOT_AVAILABLE)
        if behaviour == Api.PREP_POSE_UNDOCK:
            return None if computer.docked() else int(Response.STATUS_ERROR_NOT_DOCKED)
        pose = computer.snapshot.odometry.pose
        known = request.docking_station_id == DOCK_ID and not request.require_fiducial
        if dock_O is None or not known or math.hypot(dock_O.x_m - pose.x_m, dock_O.y_m - pose.y_m) > _NEAR_M:
            return int(Response.STATUS_ERROR_DOCK_NOT_FOUND)
        holds = computer.grip.holds(computer.snapshot.gripper)
        return int(Response.STATUS_ERROR_GRIPPER_HOLDING_ITEM) if holds else None

    def _late(self, clock_identifier: str, end_s: float) -> int | None:
        """Status of a command with an invalid end time; None for a valid one."""
        left_s = end_s - self._computer.now_s()
        if not self._clocks.knows(clock_identifier):
            return int(Progress.STATUS_ERROR_NO_TIMESYNC)
        if left_s <= 0.0:
            return int(Progress.STATUS_ERROR_COMMAND_TIMED_OUT)
        return int(Progress.STATUS_ERROR_TOO_DISTANT) if left_s > LONGEST_S else None
