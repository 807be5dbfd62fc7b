"""In the plant, the robot finds the person who lies among others, and tells what another one looks like."""

import pytest

from executive import run_mission
from skills.robot import Pose2D

pytestmark = pytest.mark.mission

# at this seed, Morgan lies on the bed, and Simone stands, in red, with hanging arms
MISSION = """
name: who lies
steps:
  - skill: find_person
    with: {place: bedroom, area_W: [[0.12, 0.12], [3.70, 0.12], [3.70, 4.30], [0.12, 4.30]], pose: lying}
  - skill: read_person
    with: {person: Simone, place: bedroom, place_W: [1.90, 3.70]}
"""


def test_the_robot_finds_who_lies_and_tells_how_somebody_else_looks(tmp_path):
    file = tmp_path / "mission.yaml"
    file.write_text(MISSION)
    start = Pose2D(2.7, 2.6, 3.14)
    report = run_mission(file, world="home", seed=9, start=start, out=tmp_path, record=False)
    assert report.claimed, report.message
    assert report.message.startswith("Simone is standing, making no gesture, dressed in red")
