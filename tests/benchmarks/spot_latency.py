"""Latency and pace of the server of Spot's API beside the plant, in real time, with a client in another process.

    python -m tests.benchmarks.spot_latency [--seconds 120] [--scripted]

The client reads the state at 30 Hz and drives at 10 Hz, for half of the time; then it reads the point cloud at 10 Hz
and a picture of the hand with depth at 2 Hz as well. Prints JSON for both: median and 99th percentile of the answers'
times (ms); of the time from a command's answer to the step of the plant that has its set point (ms); the robot's time
over wall time, and the most that it was behind (s). A machine that does other work gives higher numbers.
"""

import multiprocessing
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from tests.benchmarks.harness import command, quantile
from tests.benchmarks.spot_kills import PASSWORD, USER, server_of

RATES_HZ = {"state": 30.0, "command": 10.0, "cloud": 10.0, "picture": 2.0}
PHASES = {"alone": ("state", "command"), "with_sensors": tuple(RATES_HZ)}
DRIVE_S = 0.6


class Times:
    """Times (s, monotonic) at which commands are answered and begun, and the plant's steps with the robot's clock."""

    def __init__(self, server):
        self.begun = []
        self.steps = []
        computer = server.computer
        move, advance = computer.move, computer.clock.advance

        def timed_move(motions):
            move(motions)
            self.begun.append(time.monotonic())

        def timed_advance(dt_s):
            self.steps.append((time.monotonic(), computer.clock.now()))
            advance(dt_s)

        computer.move, computer.clock.advance = timed_move, timed_advance


def serve(scripted, folder, port, stopping, results):
    """Serves a robot, and sends the times of its commands and steps at the end."""
    from errand_spot.server.identity import credentials

    server = server_of(scripted, credentials(Path(folder)))
    times = Times(server)
    with server.running():
        port.value = server.port
        server.computer.run(stopping)
    results.put((times.begun, times.steps))


class Client:
    def __init__(self, port, certificate):
        from bosdyn.api import image_pb2, point_cloud_pb2

        from errand_spot.adapter.connection import Address, Connection

        self.connection = Connection(Address("127.0.0.1", port, certificate), USER, PASSWORD)
        self.connection.synchronise()
        self.took_s = {}
        self.answered_s = []
        self._images, self._cloud = image_pb2.GetImageRequest(), point_cloud_pb2.GetPointCloudRequest()
        for name in ("hand_color_image", "hand_depth_in_hand_color_frame"):
            self._images.image_requests.add(image_source_name=name, quality_percent=95.0)
        self._cloud.point_cloud_requests.add(point_cloud_source_name="velodyne-point-cloud", cloud_type=1)

    def stand_up(self):
        from bosdyn.client.robot_command import RobotCommandBuilder

        self.connection.acquire()
        self.connection.power(True)
        while self.connection.state().robot_state.power_state.motor_power_state != 2:
            time.sleep(0.1)
        self.connection.command(RobotCommandBuilder.synchro_stand_command())
        time.sleep(3.0)

    def calls(self):
        call = self.connection.call
        return {
            "state": self.connection.state,
            "cloud": lambda: call("velodyne-point-cloud", "GetPointCloud", self._cloud),
            "picture": lambda: call("image", "GetImage", self._images, timeout_s=2.0),
            "command": self._drive,
        }

    def _drive(self):
        from bosdyn.client.robot_command import RobotCommandBuilder

        sign = 1.0 if len(self.answered_s) // 10 % 2 else -1.0
        command = RobotCommandBuilder.synchro_velocity_command(0.0, 0.0, 0.3 * sign)
        end_s = self.connection.robot_time_s() + DRIVE_S
        given = command.synchronized_command.mobility_command.se2_velocity_request
        given.end_time.FromNanoseconds(round(end_s * 1e9))
        answer = self.connection.command(command)
        assert answer.status == 1, answer
        self.answered_s.append(time.monotonic())

    def run(self, kinds, seconds):
        """Makes calls of some kinds at their rates for a while; returns when it began and ended (s, monotonic)."""
        self.took_s = {kind: [] for kind in kinds}
        since_s, calls = time.monotonic(), self.calls()
        threads = [threading.Thread(target=self._repeat, args=(k, calls[k], since_s + seconds)) for k in kinds]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        return since_s, time.monotonic()

    def _repeat(self, kind, call, until_s):
        period_s, due_s = 1.0 / RATES_HZ[kind], time.monotonic()
        while due_s < until_s:
            time.sleep(max(0.0, due_s - time.monotonic()))
            begun_s = time.monotonic()
            call()
            self.took_s[kind].append(time.monotonic() - begun_s)
            due_s = max(due_s + period_s, time.monotonic() - period_s)


def milliseconds(times_s):
    times_ms = [1000.0 * each for each in times_s]
    return {"median_ms": quantile(times_ms, digits=1), "p99_ms": quantile(times_ms, 0.99, 1), "count": len(times_ms)}


def in_plant_s(answered_s, begun_s, steps_s):
    """Times from each command's answer to the plant's first step after it has begun."""
    steps = np.array(steps_s)
    first = np.searchsorted(steps, np.array(begun_s))
    pairs = [(int(step), answer_s) for step, answer_s in zip(first, answered_s, strict=True) if step < len(steps)]
    return [max(0.0, float(steps[step]) - answer_s) for step, answer_s in pairs]


def pace(steps, since_s, until_s):
    """Robot's time over wall time, and the most that the robot was behind since it was least so."""
    wall, clock = np.array([step for step in steps if since_s <= step[0] <= until_s]).T
    behind = (wall - wall[0]) - (clock - clock[0])
    return {
        "pace": round(float((clock[-1] - clock[0]) / (wall[-1] - wall[0])), 4),
        "most_behind_s": round(float(np.max(behind - np.minimum.accumulate(behind))), 3),
        "longest_step_s": round(float(np.diff(wall).max()), 3),
    }


def measure(seconds: float = 120.0, scripted: bool = False):
    from errand_spot.server.identity import credentials

    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        held = credentials(Path(folder))
        port, stopping, results = context.Value("i", 0), context.Event(), context.Queue()
        server = context.Process(target=serve, args=(scripted, folder, port, stopping, results))
        server.start()
        while not port.value and server.is_alive():
            time.sleep(0.1)
        client, phases = Client(port.value, held.certificate), {}
        client.stand_up()
        for name, kinds in PHASES.items():
            span_s = client.run(kinds, seconds / 2.0)
            phases[name] = span_s, {kind: milliseconds(times) for kind, times in client.took_s.items()}
        stopping.set()
        begun_s, steps = results.get(timeout=60.0)
        server.join()
    answered_s, begun_s = client.answered_s, begun_s[-len(client.answered_s) :]
    figures = {}
    for name, ((since_s, until_s), times) in phases.items():
        chosen = [k for k, at_s in enumerate(answered_s) if since_s <= at_s <= until_s]
        own_s = [answered_s[k] for k in chosen], [begun_s[k] for k in chosen]
        set_point = milliseconds(in_plant_s(*own_s, [step[0] for step in steps]))
        figures[name] = {**times, "set_point": set_point, **pace(steps, since_s, until_s)}
    return figures


if __name__ == "__main__":
    command(measure)
