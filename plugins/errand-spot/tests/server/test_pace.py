"""A robot that a client steps: by calls, and by the sleep of an unchanged program."""

import subprocess
import sys
from functools import partial

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from lock_step import scripted_spot

from errand_spot.launch import ADVANCE
from errand_spot.messages import duration, seconds
from errand_spot.server.computer import PERIOD_S, Pace

PROGRAM = """
import time
import bosdyn.client
from bosdyn.client.lease import LeaseKeepAlive
from bosdyn.client.robot_command import RobotCommandBuilder as Build, blocking_stand, block_until_arm_arrives

robot = bosdyn.client.create_standard_sdk("walk").create_robot("127.0.0.1")
robot.authenticate("user", "right")
robot.time_sync.wait_for_sync()
commands = robot.ensure_client("robot-command")
with LeaseKeepAlive(robot.ensure_client("lease"), must_acquire=True, return_at_exit=True):
    robot.power_on(timeout_sec=20, update_frequency=20.0)
    blocking_stand(commands, timeout_sec=10, update_frequency=20.0)
    for vx, wz in ((0.5, 0.3), (-0.2, 0.8)):
        commands.robot_command(Build.synchro_velocity_command(vx, 0.0, wz), end_time_secs=time.time() + 1.0)
        time.sleep(1.3)
    block_until_arm_arrives(commands, commands.robot_command(Build.arm_ready_command()), timeout_sec=20)
"""


stepped = partial(scripted_spot, pace=Pace.CLIENT)


def advance(server, data):
    trusted = grpc.ssl_channel_credentials(server.certificate.read_bytes())
    name = [("grpc.ssl_target_name_override", "clock.spot.robot")]
    with grpc.secure_channel(f"127.0.0.1:{server.port}", trusted, name) as channel:
        return Timestamp.FromString(channel.unary_unary(ADVANCE)(data, timeout=5.0))


def test_a_call_steps_the_robot_and_answers_with_its_time(credentials):
    with stepped(credentials) as (server, _):
        times_s = [seconds(advance(server, duration(dt_s).SerializeToString())) for dt_s in (0.0, 1.5, 0.01)]
        assert server.computer.clock.now() == pytest.approx(1.5 + 2 * PERIOD_S)
    assert times_s[1] - times_s[0] == pytest.approx(1.5, abs=1e-6)
    assert times_s[2] - times_s[1] == pytest.approx(PERIOD_S, abs=1e-6)


@pytest.mark.parametrize(
    "data", [b"\xff\xff", duration(-1.0).SerializeToString(), duration(61.0).SerializeToString()], ids=range(3)
)
def test_a_step_that_cannot_be_is_refused(credentials, data):
    with stepped(credentials) as (server, _):
        with pytest.raises(grpc.RpcError) as refused:
            advance(server, data)
        assert refused.value.code() is grpc.StatusCode.INVALID_ARGUMENT
        assert server.computer.clock.now() == 0.0


def test_a_robot_in_real_time_is_not_stepped_by_clients(credentials):
    with scripted_spot(credentials) as (server, _), pytest.raises(grpc.RpcError) as refused:
        advance(server, Duration(seconds=1).SerializeToString())
    assert refused.value.code() is grpc.StatusCode.UNIMPLEMENTED


def test_an_unchanged_program_moves_the_robot_the_same_way_each_time(credentials, tmp_path):
    program, ends = tmp_path / "walk.py", []
    program.write_text(PROGRAM)
    for _ in range(2):
        with stepped(credentials) as (server, robot):
            launch = ["-m", "errand_spot.launch", str(server.certificate), str(server.port), "client", str(program)]
            ended = subprocess.run([sys.executable, *launch], capture_output=True, text=True, timeout=60.0)
            assert ended.returncode == 0, ended.stderr
            ends.append((robot.pose, tuple(robot.q_rad), server.computer.clock.now()))
    assert ends[0] == ends[1] and ends[0][0].x_m > 0.2 and ends[0][2] > 2.6
