"""Backend of a Spot that is driven through its API, real or served by `errand serve`. It has no referee."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final

from executive.app.prepare.placed_robots import robot_stack
from executive.app.prepare.prepared import Prepared
from executive.app.report.artifacts import Artifacts
from executive.app.runs.backend import Durable
from executive.app.runs.goal_conditions import Share
from executive.app.runs.one_run import FinishedRun, run_request
from executive.app.runs.signals import ended_by_signals
from executive.app.runs.simulated import compile_first, run_entry
from executive.record.work import Profile
from executive.run.control import Control
from executive.run.outcome import RobotResult
from executive.run.visitor import RunEntry, RunVisitor
from executive.run.worker import ThreadWorker
from executive.tree.compiler import CompiledTree
from executive.words.goal import RefereeReport
from plant.robots.spot.kind import spot_capabilities
from plant.spot_api.adapter.connection import Address, Connection, LostError, WallClock
from plant.spot_api.adapter.robot import PRESSED, ApiRobot
from plant.worlds.world import World
from skills.inputs.errors import InputError
from skills.robot import Clock, CommandId, CommandState, LeaseError, Pose2D, Robot, RobotStoppedError
from skills.stack import RobotStack

LEAST_CHARGE: Final = 0.3
LEAST_VERSION: Final = (4, 0, 0)
_HOLDER: Final = "errand run"
_POWER_S, _POSTURE_S, _OFF_S, _UNDOCK_S = 20.0, 15.0, 15.0, 30.0
_TICK_S: Final = 0.05


@dataclass(frozen=True)
class Access:
    """Access to a robot: address, user and password; may motors, lease and E-stop be switched on, taken, replaced?

    `confirm` asks a person a question and returns whether they said yes. `padding_m` is the distance that the robot
    keeps from obstacles by itself (None: its usual one).
    """

    address: Address
    user: str
    password: str = field(repr=False)
    power_on: bool = False
    take: bool = False
    own_estop: bool = False
    padding_m: float | None = None
    confirm: Callable[[str], bool] = lambda question: False


class ApiBackend:
    """Backend with one robot behind its API."""

    def __init__(
        self,
        robot: Robot,
        clock: Clock,
        world: World,
        stack: RobotStack,
        start: Pose2D | None,
        make_ready: Callable[[], None] = lambda: None,
        notes: Sequence[str] = (),
    ) -> None:
        """`start` is where the robot stands by what the user says; without it it localises on the whole map.

        `make_ready` lets the robot stand, when all that takes time is done. The report has the `notes`.
        """
        self._robot, self._clock, self._world = robot, clock, world
        self._stack, self._start, self._make_ready, self._notes = stack, start, make_ready, notes

    @property
    def clock(self) -> Clock:
        """The robot's clock."""
        return self._clock

    def entry(self, tree: CompiledTree, durable: Durable | None) -> RunEntry:
        """Returns the robot with its estimators; the steps are stored, the world is not.

        Raises InputError for a robot of another name, and for a mission that was interrupted.
        """
        if tree.robot_name != self._robot.name:
            raise InputError(f"there is no robot '{tree.robot_name}'", hint=f"known: {self._robot.name}")
        if durable is not None and durable.take_up:
            raise InputError("a mission of a real robot is not resumed", hint="run it again with errand run")
        entry = run_entry(self._robot, self._world, tree, self._stack, start=self._start, surely=False)
        self._make_ready()
        return replace(entry, real=True)

    def happened(self) -> Sequence[tuple[float, str]]:
        """Returns nothing: nobody knows what happens around a real robot."""
        return ()

    def visitors(self, control: Control) -> Sequence[RunVisitor]:
        """Returns no visitors: people talk to the robot by themselves."""
        return ()

    @property
    def notes(self) -> Sequence[str]:
        """Sensors that make the scan, if they are not the LiDAR."""
        return self._notes

    def work(self) -> Mapping[str, int]:
        """Returns no counters."""
        return {}

    def attach(self, profile: Profile) -> None:
        """Times nothing."""

    def show_live(self) -> None:
        """Returns None: there is no scene."""

    def judge(
        self, tree: CompiledTree, result: RobotResult, *, before: Sequence[Share] = (), since_s: float = 0.0
    ) -> RefereeReport | None:
        """Returns None: there is no referee."""
        return None

    def leave(self, artifacts: Artifacts, out: Path) -> Path | None:
        """Returns None: there is no recording."""
        return None


class Watch:
    """Watch over the robot after each wait of its clock: reads it, and ends a run that it cannot go on with."""

    def __init__(self, robot: ApiRobot) -> None:
        self._robot, self.running = robot, False

    def __call__(self) -> None:
        """Reads the robot. Raises RobotStoppedError when it has stopped for good during the run."""
        self._robot.poll()
        if self.running and (why := self._robot.stopped_because()):
            raise RobotStoppedError(why)

    def interrupt(self, _reason: str) -> None:
        """Raises KeyboardInterrupt outside a run, which ends by its control."""
        if not self.running:
            raise KeyboardInterrupt


@contextmanager
def connected(name: str, access: Access) -> Iterator[ReadyRobot]:
    """Connects to a robot, checks it and gets its lease. `make_ready` then lets it stand.

    However it ends, the robot stops, motors that were switched on here are switched off, and policy, lease and an
    E-stop of our own are given back.

    Raises:
        InputError: the robot cannot be reached, or is not ready; the message says what is missing.
    """
    connection = Connection(access.address, access.user, access.password)
    with ExitStack() as ending:
        with _errors_of_input():
            connection.synchronise()
            clock = WallClock(connection)
            robot = ApiRobot(name, connection, clock, spot_capabilities(), padding_m=access.padding_m)
            made = ReadyRobot(robot, clock, Watch(robot), connection, access, ending)
            clock.after.append(made.watch)
            ending.enter_context(ended_by_signals(made.watch.interrupt))
            _check(robot, connection)
            robot.sensors.fix_focus()
            lease = robot.take_lease(_HOLDER) if access.take else robot.acquire_lease(_HOLDER)
            ending.callback(_try, connection.give_back)
            robot.return_lease(lease)
        try:
            yield made
        finally:
            made.watch.running = False


@dataclass(frozen=True)
class ReadyRobot:
    """Robot that is connected; `make_ready` lets it stand."""

    robot: ApiRobot
    clock: WallClock
    watch: Watch
    connection: Connection
    access: Access
    ending: ExitStack

    def make_ready(self) -> None:
        """Sees to E-stop and keepalive policy, switches the motors on, and stands up. Raises InputError.

        From now on the run must not fall silent.
        """
        robot, clock, ending = self.robot, self.clock, self.ending
        with _errors_of_input():
            if self.access.own_estop:
                self._hold_estop()
            if (stopped := self.connection.estop_trouble()) is not None:
                raise InputError(stopped, hint="release it on the tablet, or begin with --estop own")
            docked = self.connection.docked()
            if docked and not self.access.power_on:
                raise InputError("the robot stands on its dock", hint="allow it to undock: --power-on")
            lease = robot.acquire_lease(_HOLDER)
            robot.heartbeat.add_policy()
            ending.callback(_try, robot.heartbeat.remove_policy)
            ending.callback(_try, self.connection.stop)
            if not robot.powered:
                self._switch_on()
            if docked:
                leaves = robot.undock(until_s=clock.now() + _UNDOCK_S, lease=lease)
                finish(robot, clock, leaves, "leave its dock", _UNDOCK_S)
            until_s = clock.now() + _POSTURE_S
            stood = robot.stand(robot.capabilities().standing_height_m, 0.0, until_s=until_s, lease=lease)
            finish(robot, clock, stood, "stand up")
            robot.return_lease(lease)
            self.watch.running = True

    def _hold_estop(self) -> None:
        if self.robot.powered:
            raise InputError("--estop own: the motors are on", hint="switch them off on the tablet first")
        self.ending.callback(_try, self.robot.heartbeat.drop_estop)
        self.robot.heartbeat.hold_estop()

    def _switch_on(self) -> None:
        """Switches the motors on; the ending then switches them off. Raises InputError and LostError."""
        if not (self.access.power_on or self.access.confirm("The motors are off. Switch them on? Type yes: ")):
            raise InputError("the motors are off", hint="allow it to switch them on: --power-on")
        robot, clock, connection = self.robot, self.clock, self.connection

        def switch_off() -> None:
            connection.stop(power_off=True)
            wait_until(clock, lambda: not robot.powered, _OFF_S, "the motors do not switch off")

        self.ending.callback(_try, switch_off)
        number = connection.power(True)
        wait_until(clock, lambda: connection.power_is_done(number) and robot.powered, _POWER_S, "the motors stay off")


@contextmanager
def _errors_of_input() -> Iterator[None]:
    """Raises InputError for what the robot refuses."""
    try:
        yield
    except LeaseError as error:
        raise InputError(str(error), hint="--take takes the lease from another client") from error
    except LostError as error:
        raise InputError(f"the robot is not ready: {error}") from error


def _try(call: Callable[[], None]) -> None:
    """Calls what must not keep the rest of the ending from being done."""
    with suppress(LostError):
        call()


def _check(robot: ApiRobot, connection: Connection) -> None:
    """Raises InputError for a robot that is no Spot with an arm, has a fault, too little charge or old software."""
    version, least = connection.software_version(), ".".join(map(str, LEAST_VERSION))
    if version < LEAST_VERSION:
        said = f"the robot's software is {'.'.join(map(str, version))}"
        raise InputError(said, hint=f"update the robot to {least} or later")
    if (missing := robot.sensors.missing()) is not None:
        raise InputError(missing, hint="missions need a Spot with an arm that is switched on")
    if robot.battery().charge < LEAST_CHARGE:
        raise InputError(f"the battery has {robot.battery().charge:.0%}", hint=f"charge it to {LEAST_CHARGE:.0%}")
    if faults := [fault for fault in robot.faults() if fault != PRESSED]:
        raise InputError(f"the robot has a fault: {', '.join(faults)}", hint="clear it first")


def finish(robot: Robot, clock: Clock, command: CommandId, what: str, most_s: float = _POSTURE_S) -> None:
    """Waits for a command. Raises LostError when it does not succeed within most_s."""
    wait_until(clock, lambda: robot.command_status(command).state is not CommandState.RUNNING, most_s, what)
    status = robot.command_status(command)
    if status.state is not CommandState.DONE:
        raise LostError(f"the robot does not {what}: {status.reason}")


def wait_until(clock: Clock, true: Callable[[], bool], most_s: float, what: str) -> None:
    """Waits until a condition holds. Raises LostError after most_s."""
    until_s = time.monotonic() + most_s
    while not true():
        if time.monotonic() > until_s:
            raise LostError(what)
        clock.advance(_TICK_S)


@contextmanager
def spot_runner(prepared: Prepared, access: Access) -> Iterator[Callable[..., FinishedRun]]:
    """Connects to a robot, and yields a function that runs a mission with it, in place of `run_request`.

    The robot localises around the request's start, or without one on the whole map. Raises InputError.
    """
    if prepared.several:
        raise InputError("a real robot runs alone", hint="leave --robots out")
    compile_first()
    logging.getLogger("drake").setLevel(logging.WARNING)
    start = prepared.request.start
    with connected(prepared.tree.robot_name, access) as made:
        stack = robot_stack(prepared.robots[made.robot.name])
        where = start if isinstance(start, Pose2D) else None
        notes = made.robot.sensors.notes
        backend = ApiBackend(made.robot, made.clock, prepared.world, stack, where, made.make_ready, notes)
        yield partial(run_request, backend=backend, worker=ThreadWorker())
