"""Backend of a Spot that is driven through its API, real or served by `errand serve`."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Final

import typer

from errand_spot.adapter.connection import SLOW_S, Address, Connection, LostError, WallClock
from errand_spot.adapter.robot import PRESSED, ApiRobot
from plant.robots.spot.kind import spot_capabilities
from skills.inputs.errors import InputError
from skills.quantities import Margin
from skills.robot import Clock, CommandId, CommandState, ConnectedRobot, LeaseError, Robot, RobotStoppedError

LEAST_CHARGE: Final = 0.3
LEAST_VERSION: Final = (4, 0, 0)
_HOLDER: Final = "errand run"
_POWER_S, _POSTURE_S, _OFF_S, _UNDOCK_S = 20.0, 15.0, 15.0, 30.0
_TICK_S: Final = 0.05
_ADDRESS: Final = re.compile(r"(?P<host>[A-Za-z0-9.-]+)(:(?P<port>\d{1,5}))?")


class EstopHolder(StrEnum):
    """Holder of the E-stop during a run: a person's device, or this program."""

    TABLET = "tablet"
    OWN = "own"


@dataclass(frozen=True)
class Spot:
    """A Spot behind its API, at `HOST[:PORT]`; implements `skills.stack.RobotBackend`.

    `user` is by default BOSDYN_CLIENT_USERNAME; the password comes from BOSDYN_CLIENT_PASSWORD, or from a prompt.
    `certificate` is that of a server, by default the SDK's own. `power_on` switches the motors on, and off at the end.
    `take` takes the lease from its holder, and `estop=own` replaces the tablet's E-stop, each after a typed yes.
    `padding` is the distance (m) of the robot's own obstacle avoidance.
    """

    user: str | None = None
    certificate: Path | None = None
    power_on: bool = False
    take: bool = False
    estop: EstopHolder = EstopHolder.TABLET
    padding: Margin | None = None

    @contextmanager
    def connect(self, address: str, name: str) -> Iterator[ConnectedRobot]:
        """Connects to a Spot, checks it and gets its lease. Raises InputError."""
        with connected(name, self.access(address)) as made:
            who = f"Spot at spot://{address}, serial number {made.connection.identity.serial_number}."
            yield ConnectedRobot(made.robot, made.clock, made.make_ready, (who, *made.robot.sensors.notes))

    def access(self, address: str) -> Access:
        """Returns the access to the robot; asks for what is missing at a terminal. Raises InputError."""
        found = _ADDRESS.fullmatch(address)
        if found is None or not 0 <= (port := int(found["port"] or 443)) <= 65_535:
            raise InputError(f"spot://{address[:60]}: is no address of a Spot", hint="write spot://192.168.80.3")
        if self.certificate is not None and not self.certificate.is_file():
            raise InputError(f"certificate={self.certificate}: there is no such file", hint="name a .pem file")
        user = self.user or os.environ.get("BOSDYN_CLIENT_USERNAME")
        if not user:
            hint = f"write spot://{address}?user=NAME, or set BOSDYN_CLIENT_USERNAME"
            raise InputError("the user of the robot is missing", hint=hint)
        password = os.environ.get("BOSDYN_CLIENT_PASSWORD") or _asked_password(user)
        own_estop = self.estop is EstopHolder.OWN
        questions = {
            "take=yes": (self.take, f"Take the lease of {address} from its holder?"),
            "estop=own": (own_estop, f"Replace all E-stops of {address}, the tablet's too, by this program's?"),
        }
        for option, (wanted, question) in questions.items():
            if wanted and not _confirmed(f"{question} Type yes: "):
                raise InputError(f"{option} needs a yes", hint="type yes at the terminal")
        return Access(
            Address(found["host"], port, self.certificate),
            user,
            password,
            power_on=self.power_on,
            take=self.take,
            own_estop=own_estop,
            padding_m=self.padding,
            confirm=_confirmed,
        )


def _asked_password(user: str) -> str:
    """Asks for the password at a terminal; it is never stored. Raises InputError without a terminal."""
    if not sys.stdin.isatty():
        raise InputError("the robot's password is missing", hint="set BOSDYN_CLIENT_PASSWORD, or run at a terminal")
    return str(typer.prompt(f"Password of {user}", hide_input=True))


def _confirmed(question: str) -> bool:
    """Asks for a typed yes at a terminal."""
    return sys.stdin.isatty() and typer.prompt(question, prompt_suffix="").strip().lower() == "yes"


@dataclass(frozen=True)
class Access:
    """Access to a robot: address, user and password, and permissions for motors, lease and E-stop.

    `confirm` asks a person a question and returns True for a yes. `padding_m` is the distance of the robot's own
    obstacle avoidance (None: its default).
    """

    address: Address
    user: str
    password: str = field(repr=False)
    power_on: bool = False
    take: bool = False
    own_estop: bool = False
    padding_m: float | None = None
    confirm: Callable[[str], bool] = lambda question: False


class Watch:
    """Monitor of the robot after each wait of its clock: reads the robot, and ends a run that it cannot continue."""

    def __init__(self, robot: ApiRobot) -> None:
        self._robot, self.running = robot, False

    def __call__(self) -> None:
        """Reads the robot. Raises RobotStoppedError when it has stopped for good during the run."""
        self._robot.poll()
        if self.running and (why := self._robot.stopped_because()):
            raise RobotStoppedError(why)


@contextmanager
def connected(name: str, access: Access) -> Iterator[ReadyRobot]:
    """Connects to a robot, checks it and gets its lease. `make_ready` then lets it stand.

    On every exit it stops the robot, switches off motors that it has switched on, and returns policy, lease and our own
    E-stop.

    Raises:
        InputError: the robot cannot be reached, or is not ready; the message names the missing parts.
    """
    connection = Connection(access.address, access.user, access.password)
    with ExitStack() as ending:
        with _errors_of_input():
            connection.synchronise(timeout_s=SLOW_S)
            clock = WallClock(connection)
            robot = ApiRobot(name, connection, clock, spot_capabilities(), padding_m=access.padding_m)
            made = ReadyRobot(robot, clock, Watch(robot), connection, access, ending)
            clock.after.append(made.watch)
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
                raise InputError(stopped, hint="release it on the tablet, or add estop=own to the address")
            docked = self.connection.docked()
            if docked and not self.access.power_on:
                raise InputError("the robot stands on its dock", hint="allow it to undock: ?power_on=yes")
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
            raise InputError("estop=own: the motors are on", hint="switch them off on the tablet first")
        self.ending.callback(_try, self.robot.heartbeat.drop_estop)
        self.robot.heartbeat.hold_estop()

    def _switch_on(self) -> None:
        """Switches the motors on; the ending then switches them off. Raises InputError and LostError."""
        if not (self.access.power_on or self.access.confirm("The motors are off. Switch them on? Type yes: ")):
            raise InputError("the motors are off", hint="allow it to switch them on: ?power_on=yes")
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
        raise InputError(str(error), hint="take=yes takes the lease from another client") from error
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
