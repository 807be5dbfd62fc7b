"""Clocks of client and robot in real time: no motion goes on past its end."""

import time
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest
from lock_step import PASSWORD, USER, scripted_spot

from errand_spot.adapter import connection
from errand_spot.adapter.connection import SLOW_S, Address, Connection, WallClock
from errand_spot.adapter.robot import ApiRobot
from errand_spot.server import computer
from plant.robots.spot.kind import spot_capabilities
from skills.robot import ArmTrajectory
from tests.tables import table

END_S, STILL_S = 0.4, 0.3
READY_RAD = [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]


class Clock:
    """Clock of a machine: wall time off by `off_s`, and drifting by a share of the time since `since_s`."""

    def __init__(self, off_s=0.0, drift=0.0):
        self.off_s, self.drift, self.since_s = off_s, drift, time.monotonic()

    def monotonic(self):
        return time.monotonic() + self.drift * (time.monotonic() - self.since_s)

    def time(self):
        return time.time() + self.off_s + self.monotonic() - time.monotonic()

    def module(self):
        clocks = {"monotonic": self.monotonic, "time": self.time}
        in_ns = {f"{name}_ns": lambda clock=clock: round(clock() * 1e9) for name, clock in clocks.items()}
        return SimpleNamespace(**clocks, **in_ns)


@pytest.fixture
def serve(credentials, monkeypatch):
    """Returns a function that serves a robot in real time and connects to it, with a clock for each of the two."""
    with ExitStack() as ending:

        def served(client, robot_side):
            monkeypatch.setattr(connection, "time", client.module())
            monkeypatch.setattr(computer, "time", robot_side.module())
            monkeypatch.setattr(computer, "POWER_ON_S", 0.1)
            server, scripted = ending.enter_context(scripted_spot(credentials))
            made = Connection(Address("127.0.0.1", server.port, credentials.certificate), USER, PASSWORD)
            made.synchronise(timeout_s=SLOW_S)
            wall = WallClock(made)
            robot = ApiRobot("Alice", made, wall, spot_capabilities())
            wall.after.append(robot.poll)
            return scripted, wall, robot, made

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
def test_no_motion_goes_on_past_its_end_whatever_the_clocks_say(serve, off_s, drift, jumps):
    client, robot_side = Clock(off_s, drift), Clock()
    scripted, wall, robot, made = serve(client, robot_side)
    lease = stand_up(wall, robot, made)
    client.since_s -= 10.0  # as long ago as the last synchronisation may be
    until_s = wall.now() + END_S
    robot.drive(0.5, 0.0, 0.0, until_s=until_s, lease=lease)
    path = ArmTrajectory(np.array([0.0, 4.0]), np.array([scripted.q_rad, READY_RAD]))
    robot.move_arm(path, until_s=until_s, lease=lease)
    while not {"drive", "move_arm"} <= set(scripted.moving_parts):
        assert wall.now() < until_s, "it never moves"
        wall.advance(0.02)
    if jumps is not None:
        {"client": client, "robot": robot_side}[jumps].off_s += 100.0 if off_s > 0.0 else -100.0
        robot.drive(0.5, 0.0, 0.0, until_s=until_s, lease=lease)
    while wall.now() < until_s + STILL_S:
        wall.advance(0.05)
    pose, q_rad = scripted.pose, scripted.q_rad.copy()
    wall.advance(0.3)
    assert (scripted.pose, scripted.q_rad) == (pose, pytest.approx(q_rad, abs=1e-6))
    assert 0.02 < pose.x_m < 0.5 * (END_S + STILL_S)
