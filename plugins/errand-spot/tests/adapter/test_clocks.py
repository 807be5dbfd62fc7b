"""Clocks of client and robot: no motion goes on past its end."""

import time
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest
from lock_step import PASSWORD, USER, robot_time, scripted_spot

from errand_spot.adapter import connection
from errand_spot.adapter.connection import SLOW_S, Address, Connection, WallClock
from errand_spot.adapter.robot import ApiRobot
from errand_spot.server import computer
from errand_spot.server.computer import Pace
from plant.robots.spot.kind import spot_capabilities
from skills.robot import ArmTrajectory
from tests.tables import table

END_S, STILL_S = 0.4, 0.3
READY_RAD = [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]


class Clock:
    """Clock of a machine: a time off by `off_s`, and drifting by a share of the time since `since_s`."""

    def __init__(self, true, off_s=0.0, drift=0.0):
        self.true, self.off_s, self.drift, self.since_s = true, off_s, drift, true.monotonic()

    def monotonic(self):
        return self.true.monotonic() + self.drift * (self.true.monotonic() - self.since_s)

    def time(self):
        return self.true.time() + self.off_s + self.monotonic() - self.true.monotonic()

    def module(self):
        return SimpleNamespace(monotonic=self.monotonic, time=self.time, sleep=self.true.sleep)


@pytest.fixture
def serve(credentials, monkeypatch):
    """Returns a function that serves a robot and connects to it, with a clock for each of the two.

    The true time is that of the wall, or else that which the client steps.
    """
    with ExitStack() as ending:

        def served(*clock, wall):
            monkeypatch.setattr(computer, "POWER_ON_S", 0.1)
            pace = Pace.REAL if wall else Pace.CLIENT
            server, scripted = ending.enter_context(scripted_spot(credentials, pace=pace))
            now, sleep = server.computer.clock.now, robot_time(server.computer).sleep
            true = time if wall else SimpleNamespace(monotonic=now, time=now, sleep=sleep)
            client, robot_side = Clock(true, *clock), Clock(true)
            monkeypatch.setattr(connection, "time", client.module())
            monkeypatch.setattr(computer, "time", robot_side.module())
            server.computer.pace = Pace.REAL
            made = Connection(Address("127.0.0.1", server.port, credentials.certificate), USER, PASSWORD)
            made.synchronise(timeout_s=SLOW_S)
            waits = WallClock(made)
            robot = ApiRobot("Alice", made, waits, spot_capabilities())
            waits.after.append(robot.poll)
            return scripted, waits, robot, made, {"client": client, "robot": robot_side}

        yield served


def stand_up(wall, robot, made):
    lease = robot.acquire_lease("test")
    made.power(True)
    while not robot.powered:
        wall.advance(0.05)
    standing = robot.stand(0.52, 0.0, until_s=wall.now() + 5.0, lease=lease)
    while robot.command_status(standing).state.value == "running":
        wall.advance(0.05)
    return lease


@pytest.mark.parametrize(*table(__file__, "clocks"))
def test_no_motion_goes_on_past_its_end_whatever_the_clocks_say(serve, off_s, drift, jumps, real):
    scripted, wall, robot, made, clocks = serve(off_s, drift, wall=real)
    lease = stand_up(wall, robot, made)
    clocks["client"].since_s -= 10.0  # as long ago as the last synchronisation may be
    until_s = wall.now() + END_S
    robot.drive(0.5, 0.0, 0.0, until_s=until_s, lease=lease)
    path = ArmTrajectory(np.array([0.0, 4.0]), np.array([scripted.q_rad, READY_RAD]))
    robot.move_arm(path, until_s=until_s, lease=lease)
    while not {"drive", "move_arm"} <= set(scripted.moving_parts):
        assert wall.now() < until_s, "it never moves"
        wall.advance(0.02)
    if jumps is not None:
        clocks[jumps].off_s += 100.0 if off_s > 0.0 else -100.0
        robot.drive(0.5, 0.0, 0.0, until_s=until_s, lease=lease)
    while wall.now() < until_s + STILL_S:
        wall.advance(0.05)
    pose, q_rad = scripted.pose, scripted.q_rad.copy()
    wall.advance(0.3)
    assert (scripted.pose, scripted.q_rad) == (pose, pytest.approx(q_rad, abs=1e-6))
    assert 0.02 < pose.x_m < 0.5 * (END_S + STILL_S)
