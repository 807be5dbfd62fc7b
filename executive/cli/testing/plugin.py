"""Pytest plug-in with fixtures for tests of skills; it collects files named `*.skilltest.yaml`.

Heavy modules are imported only when a test needs them, so that tests in other projects do not start more slowly.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from executive.testing.bench import SkillBench
    from executive.testing.skill_suite import SkillTestSettings
    from plant.simulation import Simulation
    from plant.worlds.world import World
    from skills.api import SkillContext
    from skills.robot import Capabilities
    from skills.testing.clock import VirtualClock
    from skills.testing.robot import ScriptedRobot

pytest.register_assert_rewrite("executive.app.task_suite", "executive.testing.skill_suite")

SUFFIX = ".skilltest.yaml"
_ROBOT = "Alice"
_SETTINGS: pytest.StashKey[SkillTestSettings] = pytest.StashKey()


class Hooks:
    """Hooks that a conftest.py may implement."""

    @staticmethod
    def pytest_errand_skill_tests(settings: Any) -> None:
        """Changes the settings for all skill tests in the session, before the first test is collected.

        `settings` is an `executive.testing.skill_suite.SkillTestSettings`: append to `fault_kinds`, add to `skills`, or
        replace benches in `makers`.
        """


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Registers the hooks, so that a conftest can change the settings of skill tests."""
    pluginmanager.add_hookspecs(Hooks)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collects the tests of a `*.skilltest.yaml` file."""
    if not file_path.name.endswith(SUFFIX):
        return None
    from executive.testing.skill_suite import SkillTestModule

    module: SkillTestModule = SkillTestModule.from_parent(parent, path=file_path)
    module.settings = _settings(parent.config)
    return module


def _settings(config: pytest.Config) -> SkillTestSettings:
    """Returns the settings for the session's skill tests, built when the first test is collected."""
    if _SETTINGS not in config.stash:
        from executive.testing.skill_suite import SkillTestSettings
        from executive.testing.skill_test import scripted_maker
        from executive.tree.registry import installed_skills
        from skills.inputs.errors import InputError

        capabilities = _spot()
        makers = {"scripted": scripted_maker(capabilities), "plant": _plant_bench}
        try:
            settings = SkillTestSettings(installed_skills(), makers, capabilities)
        except InputError as error:
            raise pytest.UsageError(str(error)) from error
        config.stash[_SETTINGS] = settings
        config.hook.pytest_errand_skill_tests(settings=settings)
    return config.stash[_SETTINGS]


@dataclass(frozen=True)
class SmallPlant:
    """Simulated room with a robot: `bench` runs skills, and the clock of the bench steps the plant."""

    world: World
    simulation: Simulation
    bench: SkillBench


def _small_plant(folder: Path, *, can: bool = True) -> SmallPlant:
    """Writes the world into `folder` and places the robot at (-0.5, 0), 1.7 m before the table."""
    from executive.app.prepare.placed_robots import shared_detector
    from executive.testing.bench import SkillBench, write_small_room
    from plant.robots.robot_kind import PlacedRobot
    from plant.simulation import Simulation
    from plant.worlds.world import load_world
    from skills.grid_map import load_grid_map
    from skills.stack import stack_of

    world = load_world(write_small_room(folder, can=can))
    simulation = Simulation(world, seed=1, robots=[PlacedRobot(_ROBOT, "spot", world.start, world.dock)], visuals=False)
    stack = stack_of({"localiser": {"use": "scan_matching"}})
    bench = SkillBench(
        simulation.robots[_ROBOT],
        simulation.clock,
        localiser=stack.localiser.build(load_grid_map(world.scan_map_path), world.start, surely=True),
        costmap=stack.costmap.build(load_grid_map(world.keepout_map_path)),
        detector=shared_detector(),
        seed=1,
    )
    return SmallPlant(world, simulation, bench)


def _plant_bench(_robot: Any, world: Any) -> SkillBench:
    """Builds a bench in the small plant; deletes the world's files afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        return _small_plant(Path(folder), can=world.can).bench


def _spot() -> Capabilities:
    logging.getLogger("drake").setLevel("WARNING")
    from plant.robots.spot.kind import spot_capabilities

    return spot_capabilities()


@pytest.fixture(scope="session")
def robot_capabilities() -> Capabilities:
    """Capabilities of the scripted robot: Spot with its arm. Override this fixture to test with another robot."""
    return _spot()


@pytest.fixture
def virtual_clock() -> VirtualClock:
    """Clock that only `advance` moves."""
    from skills.testing.clock import VirtualClock

    return VirtualClock()


@pytest.fixture
def make_scripted_robot(virtual_clock: VirtualClock, robot_capabilities: Capabilities) -> Callable[..., ScriptedRobot]:
    """Returns a factory of scripted robots on the virtual clock, in the room with a table and a can.

    The factory takes the options of `ScriptedRobot`: name, capabilities, blocks, start, seed.
    """
    from skills.testing.blocks import ROOM, TABLE_CAN
    from skills.testing.robot import ScriptedRobot

    def make(**options: Any) -> ScriptedRobot:
        usual = {"capabilities": robot_capabilities, "blocks": (*ROOM, TABLE_CAN)}
        return ScriptedRobot(virtual_clock, **{**usual, **options})

    return make


@pytest.fixture
def scripted_robot(make_scripted_robot: Callable[..., ScriptedRobot]) -> ScriptedRobot:
    """Scripted robot at the origin of the room."""
    return make_scripted_robot()


@pytest.fixture
def skill_bench(scripted_robot: ScriptedRobot, virtual_clock: VirtualClock) -> SkillBench:
    """Bench that runs skills with the scripted robot; `skill_bench.inject("camera freezes at 3 s")` adds a fault."""
    from executive.testing.bench import SkillBench
    from skills.testing.estimators import BlockCostmap

    return SkillBench(scripted_robot, virtual_clock, costmap=BlockCostmap(scripted_robot.blocks))


@pytest.fixture
def skill_context(virtual_clock: VirtualClock) -> Callable[..., SkillContext]:
    """Returns a factory of skill contexts: `skill_context(robot)`, with the options of `SkillBench`."""
    from executive.testing.bench import SkillBench

    def make(robot: ScriptedRobot, **options: Any) -> SkillContext:
        return SkillBench(robot, virtual_clock, **options).context()

    return make


@pytest.fixture
def small_plant(tmp_path: Path) -> SmallPlant:
    """Simulated Spot in a room with a table and a can: contact, noisy sensors, scan matching."""
    _spot()
    return _small_plant(tmp_path / "small_room")
