"""Compiles the numeric code for driving, scans and arms into numba's cache by short test runs."""

import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numba.core.dispatcher import Dispatcher

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.app.runs.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.words.robot_config import RobotConfig
from skills.compiled import CompiledFunction
from skills.inputs.errors import InputError
from skills.inputs.plugins import KERNELS, PluginDefect, distribution_of, installed_plugins, run_plugin

_MISSION: Final = """
name: warm up
steps: [{skill: navigate, with: {x: 5.2, y: 4.5, yaw: 3.1416}}]
"""


_DRIVES: Final = (
    ("spot", None),
    ("spot", "{localiser: {use: scan_matching}}"),
    ("fetch", None),
)
"""Kinds of robots, and the components in place of their default ones."""
_DRIVEN_S: Final = 2.5
_LIMIT_S: Final = 300.0
"""Time that a plug-in may take to compile its code."""


def newly_compiled() -> int:
    """Number of functions that this process has compiled because numba's cache lacked them."""
    packages = {"skills", "plant", *(entry.value.partition(".")[0] for entry in installed_plugins(KERNELS))}
    modules = [module for name, module in sys.modules.items() if name.partition(".")[0] in packages]
    values = [value for module in modules for value in vars(module).values()]
    compiled: list[Any] = [
        each.machine_code for each in values if isinstance(each, CompiledFunction) and "machine_code" in vars(each)
    ]
    compiled += [each for each in values if isinstance(each, Dispatcher)]
    codes = {id(code): code for code in compiled}
    return sum(sum(code.stats.cache_misses.values()) for code in codes.values())


def kernel_steps() -> Sequence[Callable[[], None]]:
    """Functions that each run numeric code briefly: drives, the scripted robot, and what is registered.

    All together take a few seconds if their code is cached. A plug-in's function raises InputError if it fails.
    """
    drives = (partial(_drive, kind, stack) for kind, stack in _DRIVES)
    registered = (partial(_compile_registered, entry) for entry in installed_plugins(KERNELS))
    return (*drives, _see_blocks, *registered)


def _compile_registered(entry: EntryPoint) -> None:
    """Loads and calls a registered function. Raises InputError."""
    try:
        run_plugin(entry, lambda: entry.load()(), limit_s=_LIMIT_S)
    except PluginDefect as defect:
        what = f"cannot compile '{entry.name}' ({entry.value}) of {distribution_of(entry)}: {defect}"
        raise InputError(what, hint="repair or uninstall that distribution") from defect


def _drive(kind: str, components: str | None) -> None:
    """Runs a mission that drives for some seconds, in a folder that is removed."""
    with TemporaryDirectory() as folder:
        _drive_in(Path(folder), kind, components)


def _drive_in(folder: Path, kind: str, components: str | None) -> None:
    mission, stack = folder / "warm_up.yaml", None
    mission.write_text(_MISSION, encoding="utf-8")
    if components is not None:
        stack = folder / "stack.yaml"
        stack.write_text(components, encoding="utf-8")
    robots = (RobotConfig("Alice", kind, stack=stack),)
    prepared = prepare(Request(file=mission, out=folder, record=False, time_limit_s=_DRIVEN_S, robots=robots))
    run_request(prepared, SimulatedBackend(prepared.world, prepared.robots, seed=1, record=False))


def _see_blocks() -> None:
    """Takes a scan and a picture with the scripted robot, so that parallel tests find the code compiled."""
    from plant.robots.robot_kind import robot_kind
    from skills.testing.blocks import Block, block_array, distances_from
    from skills.testing.clock import VirtualClock
    from skills.testing.robot import ScriptedRobot

    spot, blocks = robot_kind("spot").capabilities(), [Block(1.0, -1.0, 1.2, 1.0)]
    robot = ScriptedRobot(VirtualClock(), capabilities=spot, blocks=blocks)
    robot.scan()
    robot.image("hand")
    distances_from(block_array(robot.blocks), np.zeros((1, 2)))
