"""A lift on a floating base: Fetch's package without its wheels."""

import shutil
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from plant.diagram import DiagramConfig, build_diagram
from plant.engine import Engine
from plant.robots import robot_kind as kinds
from plant.robots.fetch.kind import FETCH
from plant.robots.robot_kind import PlacedRobot
from skills.robot import CommandState, Pose2D
from tests.plant.boxes import fixed_box

WITHOUT_WHEELS = """
from pathlib import Path
from plant.robots.urdf_robot.kind import urdf_kind
KIND = urdf_kind(Path(__file__).with_name("robot.yaml"))
"""


@pytest.fixture
def engine(tmp_path, monkeypatch):
    package = tmp_path / "floating_fetch"
    shutil.copytree(FETCH.facts.parent, package, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    (package / "__init__.py").write_text(WITHOUT_WHEELS)
    file = package / "robot.yaml"
    kept = [line for line in file.read_text().splitlines() if "_wheel" not in line]
    file.write_text("\n".join(kept))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(
        kinds, "robot_kinds", lambda: {"lifted": EntryPoint("lifted", "floating_fetch:KIND", kinds.GROUP)}
    )
    kinds.robot_kind.cache_clear()
    floor = fixed_box(tmp_path, "floor", "20 20 0.2", "0 0 -0.1")
    robot = PlacedRobot("Bob", "lifted", Pose2D(0.5, 0.2, 0.0))
    yield Engine(build_diagram(DiagramConfig(models=[floor], robots=[robot], render=False)))
    kinds.robot_kind.cache_clear()


def pose(engine, link):
    bob = engine.world.robots["Bob"]
    body = engine.world.plant.GetBodyByName(link, bob.instance)
    return engine.world.plant.EvalBodyPoseInWorld(engine.context, body).translation()


def test_the_lift_raises_the_body_and_the_floating_base_drives_it(engine):
    """0.15 m up in 2 s at 0.1 m/s, while the base drives 0.4 m; its frame stays on the floor."""
    bob = engine.robots["Bob"]
    lease = bob.acquire_lease("test")
    up = bob.stand(bob.capabilities().standing_height_m + 0.15, 0.0, until_s=5.0, lease=lease)
    bob.drive(0.4, 0.0, 0.0, until_s=1.0, lease=lease)
    engine.advance(2.5)
    assert bob.command_status(up).state is CommandState.DONE
    assert pose(engine, "body")[2] == pytest.approx(0.39743 + 0.15, abs=0.01)
    np.testing.assert_allclose(pose(engine, "base_link"), [0.9, 0.2, 0.0], atol=0.06)
    scan = bob.scan()
    assert scan.X_OB.translation()[2] + scan.X_BL.translation()[2] == pytest.approx(0.2878, abs=0.01)
