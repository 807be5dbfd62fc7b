"""A Fetch on a bare floor, put back to its start before each test."""

from pathlib import Path

import pytest

from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from skills.robot import Pose2D
from tests.plant.kept_engine import KeptEngine


@pytest.fixture(scope="session")
def floor():
    return LooseModel("floor", Path(__file__).with_name("floor.sdf"), Pose2D(0.0, 0.0, 0.0).transform(), fixed=True)


@pytest.fixture(scope="session")
def fetch_world(floor):
    """One plant for all tests."""
    bob = PlacedRobot("Bob", "fetch", Pose2D(0.5, 0.2, 0.0))
    return build_diagram(DiagramConfig(models=[floor], robots=[bob], render=False))


@pytest.fixture(scope="session")
def kept_fetch(fetch_world):
    return KeptEngine(Engine(fetch_world))


@pytest.fixture
def engine(kept_fetch):
    return kept_fetch.again()


@pytest.fixture
def fetch(engine):
    return engine.robots["Bob"]


@pytest.fixture
def lease(fetch):
    return fetch.acquire_lease("test")
