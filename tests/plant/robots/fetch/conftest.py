"""A Fetch on a bare floor, put back to its start before each test."""

import pytest

from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from skills.robot import Pose2D
from tests.plant.kept_engine import KeptEngine

FLOOR = """<sdf version="1.7"><model name="floor"><link name="floor">
<collision name="floor"><pose>0 0 -0.1 0 0 0</pose><geometry><box><size>20 20 0.2</size></box></geometry></collision>
<visual name="floor"><pose>0 0 -0.1 0 0 0</pose><geometry><box><size>20 20 0.2</size></box></geometry>
<material><diffuse>0.5 0.4 0.3 1</diffuse></material></visual>
</link></model></sdf>"""


@pytest.fixture(scope="session")
def floor(tmp_path_factory):
    path = tmp_path_factory.mktemp("floor") / "floor.sdf"
    path.write_text(FLOOR)
    return LooseModel("floor", path, Pose2D(0.0, 0.0, 0.0).transform(), fixed=True)


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
