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
from executive.app.prepare.worlds import open_world
from executive.app.runs.one_run import run_request
from executive.app.runs.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.words.mission import DEFAULT_WORLD
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
    ("spot", "{localiser: {use: scan_matching}, controller: {use: mppi}}"),
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
    """Functions that each run numeric code briefly: drives, an arm, scans, and the functions of plug-ins.

    All together take a few seconds if their code is cached. A plug-in's function raises InputError if it fails.
    """
    drives = (partial(_drive, kind, stack) for kind, stack in _DRIVES)
    of_plugins = (partial(_compile_plugin, entry) for entry in installed_plugins(KERNELS))
    return (*drives, _solve_arm, _map_cells, _match_scan, _see_blocks, *of_plugins)


def _compile_plugin(entry: EntryPoint) -> None:
    """Loads and calls the function that a plug-in registers. Raises InputError."""
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


def _solve_arm() -> None:
    """Solves the inverse kinematics of an arm with seven joints, and checks it for collisions with a box."""
    from pydrake.math import RigidTransform

    from plant.robots.robot_kind import robot_kind
    from skills.manipulation.arm.collision import ArmScene, Box, gaps_m
    from skills.manipulation.arm.kinematics import arm_model

    capabilities = robot_kind("fetch").capabilities()
    model = arm_model(capabilities)
    q_rad = np.full(7, 0.5)
    model.inverse(model.X_BH(q_rad))
    scene, box = ArmScene(capabilities, model, {}), Box(RigidTransform([2.0, 0.0, 0.0]), (0.1, 0.1, 0.1))
    scene.set_boxes([box])
    scene.edge_free(q_rad, q_rad)
    gaps_m(box, [box], np.zeros((1, 3)))


def _map_cells() -> None:
    """Adds a depth picture to the arm's occupied cells."""
    from pydrake.math import RigidTransform

    from skills.manipulation.arm.solid_cells import Outline, add_picture
    from skills.robot import FrameTree, Image, Intrinsics

    lens, depth_m = Intrinsics(2, 2, 1.0, 1.0, 1.0, 1.0), np.ones((2, 2), dtype=np.float32)
    image = Image(0.0, "hand", "odom", lens, lens, None, np.zeros((2, 2), dtype=np.uint8), depth_m, FrameTree({}))
    own = Outline(RigidTransform(), np.zeros(2), np.zeros(2))
    add_picture(np.empty((0, 3), dtype=np.int64), image, RigidTransform(), own)


def _match_scan() -> None:
    """Localises in a world's map by scan matching."""
    from skills.estimate.matching import score_poses
    from skills.grid_map import load_grid_map

    score_poses(load_grid_map(open_world(DEFAULT_WORLD).scan_map_path), np.ones((2, 3)), np.ones((1, 3)))


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
