"""A client of Spot's API beside the plant, in one thread: calls the services, and steps the plant between calls."""

import math
from pathlib import Path
from unittest import mock

from bosdyn.api import lease_pb2, robot_command_pb2, time_sync_pb2
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from errand_spot.messages import timestamp
from errand_spot.picking import PointPicker
from errand_spot.server.calls import Call
from errand_spot.server.computer import Motors, Pace
from errand_spot.server.identity import credentials
from errand_spot.server.server import Options, SpotServer
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.simulated import simulate
from skills.geometry import compose, inverse
from skills.manipulation.arm.kinematics import arm_model

CALL = Call("user", "benchmark", 0.0)


class SpotClient:
    """Client of a standing Spot at a start in the flat; `truth` is the plant's simulation."""

    def __init__(self, start, seed, folder, world="flat"):
        opened = open_world(world)
        placed = only_robot("Alice", opened, seed=seed, start=start)
        self.start, self.truth = start, simulate(opened, {"Alice": placed}, seed=seed, record=False)
        robot, self.dock_W = self.truth.robots["Alice"], placed.dock
        picker, dock_O = PointPicker(robot, self.truth.clock), compose(inverse(start), placed.dock)
        options = Options({"user": "right"}, pace=Pace.CLIENT, picker=picker, dock_O=dock_O)
        held = credentials(Path(folder) / "credentials")
        server = SpotServer(robot, self.truth.clock, arm_model(robot.capabilities()), held, options)
        self.computer, self._services = server.computer, {each.name: each for each in server.services}
        mock.patch("errand_spot.server.leases.STALE_S", math.inf).start()  # wall time: a slow step is no silent client
        self.lease = self.call("lease", "AcquireLease", lease_pb2.AcquireLeaseRequest(resource="body")).lease
        self.clock = self._synchronised()
        self._stand_up()

    def call(self, service, name, request):
        """Calls a service."""
        return getattr(self._services[service], name)(request, CALL)

    def until(self, true, most_s):
        """Steps the plant until a condition holds; returns whether it did in time."""
        until_s = self.truth.clock.now() + most_s
        while not (held := true()) and self.truth.clock.now() < until_s:
            self.computer.step()
        return bool(held)

    def command(self, message, ahead_s=60.0):
        """Sends a command; returns a function that tells its feedback."""
        for part in ("se2_velocity_request", "se2_trajectory_request"):
            base = message.synchronized_command.mobility_command
            if base.HasField(part):
                getattr(base, part).end_time.CopyFrom(self.ends(ahead_s))
        request = robot_command_pb2.RobotCommandRequest(lease=self.lease, command=message, clock_identifier=self.clock)
        answer = self.call("robot-command", "RobotCommand", request)
        assert answer.status == answer.STATUS_OK, answer.message
        asked = robot_command_pb2.RobotCommandFeedbackRequest(robot_command_id=answer.robot_command_id)
        return lambda: self.call("robot-command", "RobotCommandFeedback", asked).feedback.synchronized_feedback

    def ends(self, ahead_s):
        """The message of a time ahead."""
        return timestamp(self.computer.now_s() + ahead_s)

    def _synchronised(self):
        request = time_sync_pb2.TimeSyncUpdateRequest()
        for _ in range(3):
            answer = self.call("time-sync", "TimeSyncUpdate", request)
            request = time_sync_pb2.TimeSyncUpdateRequest(clock_identifier=answer.clock_identifier)
            now = timestamp(self.computer.now_s())
            for name in ("client_tx", "server_rx", "server_tx", "client_rx"):
                getattr(request.previous_round_trip, name).CopyFrom(now)
        return answer.clock_identifier

    def _stand_up(self):
        self.computer.do(self.computer.switch_on)
        assert self.until(lambda: self.computer.snapshot.motors is Motors.ON, 3.0)
        self.command(Build.synchro_stand_command())
        assert self.until(lambda: self.computer.snapshot.odometry.X_OB.translation()[2] > 0.5, 5.0)
