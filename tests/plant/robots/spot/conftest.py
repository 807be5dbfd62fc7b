"""A Spot on a bare floor, put back to its start before each test."""

import pytest

from plant.diagram import DiagramConfig, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from skills.robot import Pose2D
from tests.plant.kept_engine import KeptEngine


def new_engine():
    alice = PlacedRobot("Alice", "spot", Pose2D(0.5, 0.2, 0.0))
    return Engine(build_diagram(DiagramConfig(robots=[alice], visuals=False, render=False)))


@pytest.fixture(scope="session")
def kept_spot():
    return KeptEngine(new_engine())


@pytest.fixture
def engine(kept_spot):
    return kept_spot.again()


@pytest.fixture
def spot(engine):
    return engine.robots["Alice"]


@pytest.fixture
def lease(spot):
    return spot.acquire_lease("test")
