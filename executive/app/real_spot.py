"""Backend of a Spot that is driven through its API, real or served by `errand serve`. It has no referee."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from executive.app.artifacts import Artifacts
from executive.app.backend import Durable
from executive.app.goal_conditions import Share
from executive.app.mission_run import FinishedRun, run_request
from executive.app.placed_robots import robot_stack
from executive.app.prepared import Prepared
from executive.app.simulated import compile_first, run_entry
from executive.record.work import Profile
from executive.run.outcome import RobotResult
from executive.run.visitor import RunEntry
from executive.tree.compiler import CompiledTree
from executive.words.goal import RefereeReport
from plant.robots.spot.kind import spot_capabilities
from plant.spot_api.adapter.connection import Address, Connection, LostError, WallClock
from plant.spot_api.adapter.robot import ApiRobot
from plant.worlds.world import World
from skills.files.errors import InputError
from skills.robot import Clock, CommandId, CommandState, LeaseError, Pose2D, Robot
from skills.stack import RobotStack

LEAST_CHARGE: Final = 0.3
_HOLDER: Final = "errand run"
_POWER_S, _POSTURE_S = 20.0, 15.0
_TICK_S: Final = 0.05


@dataclass(frozen=True)
class Access:
    """Access to a robot: address, user and password; may the motors be switched on, and may the lease be taken?"""

    address: Address
    user: str
    password: str
    power_on: bool = False
    take: bool = False


class ApiBackend:
    """Backend with one robot behind its API."""

    def __init__(self, robot: Robot, clock: Clock, world: World, stack: RobotStack, start: Pose2D | None) -> None:
        """`start` is where the robot stands by what the user says; without it it localises on the whole map."""
        self._robot, self._clock, self._world = robot, clock, world
        self._stack, self._start = stack, start

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
        return replace(entry, real=True)

    def happened(self) -> Sequence[tuple[float, str]]:
        """Returns nothing: nobody knows what happens around a real robot."""
        return ()

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


@contextmanager
def connected(name: str, access: Access) -> Iterator[tuple[ApiRobot, WallClock]]:
    """Connects to a robot and gets it ready: clock, E-stop, charge, lease, power, stand.

    However it ends, the robot stops, the lease is returned, and motors that were switched on here are switched off.

    Raises:
        InputError: the robot cannot be reached, or is not ready; the message says what is missing.
    """
    connection = Connection(access.address, access.user, access.password)
    powered_here = False
    try:
        connection.synchronise()
        if not connection.is_released():
            raise InputError("the E-stop is pressed, or nobody holds one", hint="release it, on the tablet for example")
        clock = WallClock(connection)
        robot = ApiRobot(name, connection, clock, spot_capabilities())
        clock.after.append(robot.poll)
        if robot.battery().charge < LEAST_CHARGE:
            raise InputError(f"the battery has {robot.battery().charge:.0%}", hint=f"charge it to {LEAST_CHARGE:.0%}")
        if faults := robot.faults():
            raise InputError(f"the robot has a fault: {', '.join(faults)}", hint="clear it first")
        lease = robot.take_lease(_HOLDER) if access.take else robot.acquire_lease(_HOLDER)
        if not robot.powered:
            if not access.power_on:
                raise InputError("the motors are off", hint="allow it to switch them on: --power-on")
            connection.power(True)
            powered_here = True
            wait_until(clock, lambda: robot.powered, _POWER_S, "the motors do not switch on")
        stood = robot.stand(robot.capabilities().standing_height_m, 0.0, until_s=clock.now() + _POSTURE_S, lease=lease)
        finish(robot, clock, stood, "stand up")
        robot.return_lease(lease)
        yield robot, clock
    except (LostError, LeaseError) as error:
        raise InputError(str(error), hint="try again; --take takes the lease from another client") from error
    finally:
        with suppress(LostError):
            if connection.lease is not None:
                connection.stop()
                if powered_here:
                    connection.power_off_safely()
            connection.give_back()


def finish(robot: Robot, clock: Clock, command: CommandId, what: str) -> None:
    """Waits for a command. Raises LostError when it does not succeed."""
    wait_until(clock, lambda: robot.command_status(command).state is not CommandState.RUNNING, _POSTURE_S, what)
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
    with connected(prepared.tree.robot_name, access) as (robot, clock):
        stack = robot_stack(prepared.robots[robot.name])
        backend = ApiBackend(robot, clock, prepared.world, stack, start if isinstance(start, Pose2D) else None)
        yield partial(run_request, backend=backend)
