"""In the plant, tasks of another distribution are planned by their pages, and judged by what these say of the truth."""

import pytest

from skills.robot import Pose2D
from tests.executive.house_tasks import Vacuum, tasks_installed
from tests.missions.flat_mission import FlatMission
from tests.missions.own_tasks.meter import POSE, write_workshop
from tests.missions.own_tasks.read_number import ReadDisplay, ReadNumber
from tests.missions.own_tasks.water import Pour, Water

pytestmark = pytest.mark.mission
WATER = "Take [Nothing] to [kitchen] and do [water] to [beer]"
VACUUM = "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"
READ = "Take [Nothing] to [meter] and do [read] to [Nothing]"


@pytest.fixture(autouse=True)
def own_tasks():
    """Installs the tasks of this file beside the shipped ones."""
    with tasks_installed(Vacuum(), Water(), ReadNumber()):
        yield


def test_the_robot_waters_an_object_and_goes_to_a_room_and_the_pages_judge_where_hand_and_body_were():
    mission = FlatMission((WATER, VACUUM), start=Pose2D(7.45, 7.36, 1.57), skills=(Pour,))
    result, verdict = mission.run()
    assert (result.outcome.value, verdict.success) == ("success", True), (result, verdict)
    watered, covered = verdict.why.split(". The ")
    assert watered.startswith("The hand poured on the beer for")
    assert covered == "floor of the kitchen was covered."


def test_the_robot_reads_a_number_from_a_display_and_says_it(tmp_path):
    world = write_workshop(tmp_path / "workshop", ReadNumber.made["meter"])
    start = Pose2D(POSE["x"] + 0.1, POSE["y"], POSE["yaw"])
    mission = FlatMission((READ,), start=start, world=str(world), skills=(ReadDisplay,), visuals=True)
    result, verdict = mission.run()
    assert (result.outcome.value, verdict.success) == ("success", True), (result, verdict)
    assert [each.text for each in result.said] == ["the meter shows 407"]
    assert [each.answer for each in result.findings] == ["407"]
