"""What pytest loads with the package (entry point `errand` in the group `pytest11`).

It gives fixtures for tests of skills and collects files named `*.skilltest.yaml`. What is heavy is loaded when a test
asks for it, so that other people's tests start no slower.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from executive.cli.testing.small_plant import SmallPlant
    from executive.testing.bench import SkillBench
    from executive.testing.collect import SkillTestSettings
    from skills.api import SkillContext
    from skills.robot import Capabilities
    from skills.testing.clock import VirtualClock
    from skills.testing.robot import ScriptedRobot

SUFFIX = ".skilltest.yaml"
_SETTINGS: pytest.StashKey[SkillTestSettings] = pytest.StashKey()
_QUIET = "drake"


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Let a conftest change what skill tests share."""
    pluginmanager.add_hookspecs(import_module("executive.cli.testing.hooks"))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect the tests of a `*.skilltest.yaml` file."""
    if not file_path.name.endswith(SUFFIX):
        return None
    module: pytest.File = import_module("executive.testing.collect").SkillTestModule.from_parent(parent, path=file_path)
    module.settings = _settings(parent.config)  # type: ignore[attr-defined]
    return module


def _settings(config: pytest.Config) -> SkillTestSettings:
    """What the session's skill tests share, made when the first is collected."""
    if _SETTINGS not in config.stash:
        capabilities = _spot()
        makers = {
            "scripted": import_module("executive.testing.trial").scripted_maker(capabilities),
            "plant": _plant_maker,
        }
        try:
            skills = import_module("executive.tree.registry").installed_skills()
        except import_module("skills.files.errors").InputError as error:
            raise pytest.UsageError(str(error)) from error
        settings = import_module("executive.testing.collect").SkillTestSettings(skills, makers, capabilities)
        config.stash[_SETTINGS] = settings
        config.hook.pytest_errand_skill_tests(settings=settings)
    return config.stash[_SETTINGS]


def _plant_maker(robot: Any, world: Any) -> SkillBench:
    """A bench in a small plant whose files are kept only as long as it is being built."""
    folders = import_module("tempfile")
    with folders.TemporaryDirectory() as folder:
        bench: SkillBench = import_module("executive.cli.testing.small_plant").plant_maker(Path(folder))(robot, world)
    return bench


def _spot() -> Capabilities:
    import_module("logging").getLogger(_QUIET).setLevel("WARNING")
    capabilities: Capabilities = import_module("plant.spot.capabilities").spot_capabilities()
    return capabilities


@pytest.fixture(scope="session")
def robot_capabilities() -> Capabilities:
    """What the scripted robot is and can do: Spot with its arm. Override it for another robot."""
    return _spot()


@pytest.fixture
def virtual_clock() -> VirtualClock:
    """Time that only `advance` moves."""
    clock: VirtualClock = import_module("skills.testing.clock").VirtualClock()
    return clock


@pytest.fixture
def make_scripted_robot(virtual_clock: VirtualClock, robot_capabilities: Capabilities) -> Callable[..., ScriptedRobot]:
    """Make a scripted robot on the virtual clock, in the room with a table and a can.

    Takes the options of `ScriptedRobot`: name, capabilities, blocks, start, seed.
    """
    blocks = import_module("skills.testing.blocks")

    def make(**options: Any) -> ScriptedRobot:
        given = {"capabilities": robot_capabilities, "blocks": (*blocks.ROOM, blocks.TABLE_CAN), **options}
        robot: ScriptedRobot = import_module("skills.testing.robot").ScriptedRobot(virtual_clock, **given)
        return robot

    return make


@pytest.fixture
def scripted_robot(make_scripted_robot: Callable[..., ScriptedRobot]) -> ScriptedRobot:
    """A scripted robot at the origin of the room."""
    return make_scripted_robot()


@pytest.fixture
def skill_bench(scripted_robot: ScriptedRobot, virtual_clock: VirtualClock) -> SkillBench:
    """Runs skills in their leaf with the scripted robot; `skill_bench.inject("camera freezes at 3 s")` adds faults."""
    costmap = import_module("skills.testing.estimators").BlockCostmap(scripted_robot.blocks)
    bench: SkillBench = import_module("executive.testing.bench").SkillBench(
        scripted_robot, virtual_clock, costmap=costmap
    )
    return bench


@pytest.fixture
def skill_context(virtual_clock: VirtualClock) -> Callable[..., SkillContext]:
    """Make the context of a skill for a robot: `skill_context(robot)`; takes the options of `SkillBench` besides."""

    def make(robot: ScriptedRobot, **options: Any) -> SkillContext:
        bench: SkillBench = import_module("executive.testing.bench").SkillBench(robot, virtual_clock, **options)
        return bench.context()

    return make


@pytest.fixture
def small_plant(tmp_path: Path) -> SmallPlant:
    """Spot in one room with a table and a can, simulated: contact, noisy sensors, scan matching."""
    _spot()
    made: SmallPlant = import_module("executive.cli.testing.small_plant").make_small_plant(tmp_path / "small_room")
    return made
