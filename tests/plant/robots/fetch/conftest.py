"""A Fetch on a bare floor."""

import pytest

from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from skills.robot import Pose2D

FLOOR = """<sdf version="1.7"><model name="floor"><link name="floor">
<collision name="floor"><pose>0 0 -0.1 0 0 0</pose><geometry><box><size>20 20 0.2</size></box></geometry></collision>
<visual name="floor"><pose>0 0 -0.1 0 0 0</pose><geometry><box><size>20 20 0.2</size></box></geometry>
<material><diffuse>0.5 0.4 0.3 1</diffuse></material></visual>
</link></model></sdf>"""


@pytest.fixture
def floor(tmp_path):
    path = tmp_path / "floor.sdf"
    path.write_text(FLOOR)
    return LooseModel("floor", path, Pose2D(0.0, 0.0, 0.0).transform(), fixed=True)


@pytest.fixture
def engine(floor):
    world = build_diagram(
        DiagramConfig(models=[floor], robots=[PlacedRobot("Bob", "fetch", Pose2D(0.5, 0.2, 0.0))], render=False)
    )
    return Engine(world)


@pytest.fixture
def fetch(engine):
    return engine.robots["Bob"]


@pytest.fixture
def lease(fetch):
    return fetch.acquire_lease("test")
