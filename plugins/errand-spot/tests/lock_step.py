"""A server whose clock a client steps, in a thread of its own, and an adapter's robot in lock-step with it."""

import gc
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from types import ModuleType

import grpc
from call_faults import Switchboard

from errand_spot.adapter.connection import SLOW_S, Address, Connection
from errand_spot.adapter.robot import ApiRobot
from errand_spot.server.computer import PERIOD_S, Pace
from errand_spot.server.estop import Tablet
from errand_spot.server.server import Options, SpotServer
from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.kinematics import arm_model
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

USER, PASSWORD = "user", "right"
SILENT_S = 1.0


def scripted(**options):
    """Builds a scripted Spot."""
    clock = VirtualClock()
    return ScriptedRobot(clock, **{"capabilities": spot_capabilities(), **options}), clock


def with_faults(robot, clock, credentials, options):
    """Builds a server; a test sets the faults of its calls by its attribute `faults`."""
    faults = Switchboard()
    options = replace(options, interceptors=[faults])
    server = SpotServer(robot, clock, arm_model(robot.capabilities()), credentials, options)
    server.faults = faults
    return server


@contextmanager
def scripted_spot(credentials, *, tablet=Tablet.TABLET, password=PASSWORD, pace=Pace.REAL, downloads=False, **given):
    """Serves a scripted Spot from a thread, which steps it in real time, or lets a client step it."""
    robot, clock = scripted(**given)
    options = Options({USER: password}, tablet=tablet, pace=pace, downloads=downloads)
    server = with_faults(robot, clock, credentials, options)
    stopping = threading.Event()
    work = server.computer.run if pace is Pace.REAL else server.computer.serve
    stepping = threading.Thread(target=work, args=(stopping,), daemon=True)
    with server.running():
        stepping.start()
        try:
            yield server, robot
        finally:
            stopping.set()
            server.computer.do(lambda: None)  # it waits for work no longer
            stepping.join()


def robot_time(computer):
    """Module `time` of a client in this process: the robot's time, which the main thread steps when it sleeps."""

    def sleep(seconds):
        if threading.current_thread() is threading.main_thread():
            steps = max(1, round(seconds / PERIOD_S))
            computer.do(lambda: [computer.step() for _ in range(steps)]).result()
        else:
            time.sleep(seconds)

    made = ModuleType("time")
    vars(made).update(vars(time), sleep=sleep)
    for name in ("time", "monotonic", "perf_counter"):
        vars(made).update({name: computer.now_s, f"{name}_ns": lambda: round(computer.now_s() * 1e9)})
    return made


class FailedCall(grpc.RpcError):
    """Call that fails with a code."""

    def __init__(self, code, details="cut"):
        self._code, self._details = code, details

    def code(self):
        return self._code

    def details(self):
        return self._details


class LockStep:
    """The server in its thread, the clock that steps it, and the adapter's robot.

    `build` makes robot and clock in the server's thread, to which a renderer belongs.
    """

    def __init__(self, build, credentials, perception=None):
        self._build, self._credentials, self.certificate = build, credentials, credentials.certificate
        self._perception = perception
        self._ready, self._stopping, self._polled_s = threading.Event(), threading.Event(), time.monotonic()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise self._failure
        self.connection = Connection(Address("127.0.0.1", self.server.port, credentials.certificate), USER, PASSWORD)
        self.connection.synchronise(timeout_s=SLOW_S)
        self.robot = ApiRobot("Alice", self.connection, self, spot_capabilities())

    def _serve(self):
        options = Options({USER: PASSWORD}, pace=Pace.CLIENT, perception=self._perception)
        try:
            robot, clock = self._build()
            self.server = with_faults(robot, clock, self._credentials, options)
        except Exception as error:
            self._failure = error
            self._ready.set()
            return
        self.served = robot
        with self.server.running():
            self._ready.set()
            self.server.computer.serve(self._stopping)
        renders = not isinstance(robot, ScriptedRobot)
        del robot, clock, self.served, self._build, self.server
        if renders:
            gc.collect()  # a renderer ends in the thread in which it began

    def now(self):
        return self.server.computer.clock.now()

    def robot_time_s(self):
        return self.server.computer.now_s()

    def advance(self, dt_s):
        computer = self.server.computer
        if time.monotonic() - self._polled_s > SILENT_S:  # a slow tick is no silence
            self.robot.poll()
        steps = max(1, round(dt_s / PERIOD_S))
        computer.do(lambda: [computer.step() for _ in range(steps)]).result()
        self.robot.poll()
        self._polled_s = time.monotonic()

    def until(self, true, most_s=10.0, *, every_s=0.05):
        """Advances until a condition holds; returns whether it did in time."""
        until_s = self.now() + most_s
        while not true() and self.now() < until_s:
            self.advance(every_s)
        return true()

    def done(self, command):
        """Advances until a command has ended."""
        return self.until(lambda: self.robot.command_status(command).state.value != "running", every_s=0.1)

    def ends(self, command):
        """Advances until a command has ended; returns its status."""
        assert self.until(lambda: self.robot.command_status(command).state.value != "running", 40.0, every_s=0.1)
        return self.robot.command_status(command)

    def until_in(self, seconds):
        """The end, in some seconds, of a command, and the test's lease."""
        return {"until_s": self.now() + seconds, "lease": self.lease}

    def drive(self, vx, seconds=0.2, *, vy=0.0, wz=0.0):
        """Commands a drive; returns its number."""
        return self.robot.drive(vx, vy, wz, **self.until_in(seconds))

    def status(self, command):
        """The status of a command."""
        return self.robot.command_status(command)

    def stand_up(self):
        """Switches the motors on and stands up."""
        lease = self.robot.acquire_lease("test")
        self.connection.power(True)
        assert self.until(lambda: self.robot.powered, every_s=0.2)
        assert self.done(self.robot.stand(0.52, 0.0, until_s=self.now() + 10.0, lease=lease))
        self.robot.return_lease(lease)

    def close(self):
        work = self.server.computer.do
        if not isinstance(self.served, ScriptedRobot):
            gc.collect()  # else that thread would end what other tests left
        self._stopping.set()
        work(lambda: None)  # it waits for work no longer
        del work  # the server's thread drops the robot, and with it the renderer
        self._thread.join()
