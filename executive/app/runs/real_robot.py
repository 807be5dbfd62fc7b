"""Runs missions with a real robot through the backend of a plug-in, without a referee."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from threading import Event
from typing import Any, Final
from urllib.parse import unquote

from yaml import YAMLError

from executive.app.prepare.placed_robots import robot_stack
from executive.app.prepare.prepared import Prepared
from executive.app.runs.backend import Backend, Durable
from executive.app.runs.one_run import FinishedRun, run_request
from executive.app.runs.signals import ended_by_signals
from executive.app.runs.simulated import compile_first, run_entry
from executive.run.visitor import RunEntry
from executive.run.worker import ThreadWorker
from executive.tree.compiler import CompiledTree
from executive.words.variation import NO_VARIATION
from plant.worlds.world import World
from skills.inputs.errors import InputError, one_line
from skills.inputs.yaml_source import scalar_of
from skills.robot import Clock, ConnectedRobot, Pose2D, RobotBackend, RobotStoppedError
from skills.stack import RobotStack, StackError, robot_backend

_ADDRESS: Final = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*)://(?P<place>[^?\s]+)(\?(?P<options>\S*))?")


@dataclass
class RealBackend(Backend):
    """Backend with one connected robot in the map of a world.

    `start` is the robot's pose as the user gives it; without it the robot localises on the whole map.
    """

    connected: ConnectedRobot
    world: World
    stack: RobotStack
    start: Pose2D | None

    @property
    def clock(self) -> Clock:
        """The robot's clock."""
        return self.connected.clock

    def entry(self, tree: CompiledTree, durable: Durable | None) -> RunEntry:
        """Returns the robot with its estimators, ready to move; the progress is stored, the world is not.

        Raises InputError for a robot of another name, and for a mission that would be resumed.
        """
        robot = self.connected.robot
        if tree.robot_name != robot.name:
            raise InputError(f"there is no robot '{tree.robot_name}'", hint=f"known: {robot.name}")
        if durable is not None and durable.take_up:
            raise InputError("a mission of a real robot is not resumed", hint="run it again with errand run")
        entry = run_entry(robot, self.world, tree, self.stack, start=self.start, surely=False)
        self.connected.make_ready()
        return replace(entry, real=True)

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on the robot's sensors."""
        return self.connected.notes


@contextmanager
def real_runner(prepared: Prepared, address: str) -> Iterator[Callable[..., FinishedRun]]:
    """Connects to the robot at an address, and yields a function like `run_request` that runs a mission with it.

    The robot localises around the request's start, or without one on the whole map. A signal before the robot is ready
    raises KeyboardInterrupt. Raises InputError if the address names no robot, or the robot is not ready.
    """
    if prepared.several:
        raise InputError("a real robot runs alone", hint="name one robot")
    if prepared.request.scenario or prepared.request.variation != NO_VARIATION:
        what = "faults, events and variations are simulated, and not for a real robot"
        raise InputError(what, hint="leave --fault, --scenario and the like out")
    found = _ADDRESS.fullmatch(address)
    if found is None:
        raise InputError(f"--robot {address[:60]}: is no address", hint="write spot://192.168.80.3 or ros2://alice")
    try:
        driver = robot_backend(found["scheme"].lower(), _options(found["options"]))
    except StackError as error:
        what = f"{error.path[0]}: {error.message}" if error.path else error.message
        raise InputError(f"--robot {address[:60]}: {what}", hint=error.hint) from error
    compile_first()
    start, ready = prepared.request.start, Event()

    def interrupt(_reason: str) -> None:
        if not ready.is_set():
            raise KeyboardInterrupt

    with ended_by_signals(interrupt), _connected(driver, found["place"], prepared.tree.robot_name) as connected:
        stack = robot_stack(prepared.robots[connected.robot.name])
        where = start if isinstance(start, Pose2D) else None

        def make_ready() -> None:
            with _defects_named(driver):
                connected.make_ready()
            ready.set()

        made = replace(connected, make_ready=make_ready)
        backend = RealBackend(made, prepared.world, stack, where)
        yield partial(run_request, backend=backend, worker=ThreadWorker())


def _options(text: str | None) -> dict[str, Any]:
    """Parses `key=value&key`, each value as in YAML, and a key alone as true. Raises StackError."""
    options = dict[str, Any]()
    for part in (text or "").split("&") if text else ():
        key, equals, value = part.partition("=")
        try:
            read = scalar_of(unquote(value)) if equals else True
        except (YAMLError, ValueError):
            read = None
        if read is None or key in options or (isinstance(read, float) and not math.isfinite(read)):
            what = "is given twice" if key in options else "has no value"
            raise StackError((key[:40],), what, "write each option once, as in ?option=value")
        options[key] = read
    return options


@contextmanager
def _connected(driver: RobotBackend, place: str, name: str) -> Iterator[ConnectedRobot]:
    """Connects to a robot. Raises InputError if the plug-in fails while it connects or disconnects."""
    with ExitStack() as stack:
        with _defects_named(driver):
            connected = stack.enter_context(driver.connect(place, name))
            if not isinstance(connected, ConnectedRobot) or connected.robot.name != name:
                raise TypeError(f"connect yields no ConnectedRobot of the name {name}")
        yield connected
        with _defects_named(driver):
            stack.close()


@contextmanager
def _defects_named(driver: RobotBackend) -> Iterator[None]:
    """Turns any other error than InputError and RobotStoppedError in the block into InputError."""
    try:
        yield
    except (InputError, RobotStoppedError):
        raise
    except Exception as error:
        kind = type(driver)
        what = f"the backend {kind.__module__}:{kind.__name__} failed ({type(error).__name__}: {one_line(str(error))})"
        raise InputError(what, hint="repair or uninstall its distribution; errand plugins names it") from error
