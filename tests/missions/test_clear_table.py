"""One table of the flat is cleared onto another, object by object, by one sentence."""

import shutil

import pytest
import yaml

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from plant.worlds.world import WORLDS_FOLDER

pytestmark = [pytest.mark.mission, pytest.mark.nightly]

OBJECTS = ("beer", "cylinder", "cube")


@pytest.fixture
def world(tmp_path):
    """The flat, with three objects on the coffee table."""
    folder = tmp_path / "flat"
    shutil.copytree(WORLDS_FOLDER / "flat", folder)
    rules = yaml.safe_load((folder / "objects.yaml").read_text(encoding="utf-8"))
    rules["rules"]["clear_m"] = 0.06
    rules["fronts"]["coffee table"] = [[[9.15, 2.05], [9.95, 2.05]]]
    rules["objects"] = [{"name": name, "model": name, "surfaces": ["coffee table"]} for name in OBJECTS]
    (folder / "objects.yaml").write_text(yaml.safe_dump(rules), encoding="utf-8")
    return folder


def test_three_objects_are_moved_and_nothing_is_left(world, tmp_path):
    sentence = "clear the coffee table onto the sideboard"
    request = Request(sentence=sentence, world=str(world), seed=1, out=tmp_path / "out", record=False)
    report = run_request(prepare(request)).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.success, report.referee.why
    assert report.referee.drops == 0 and "nothing is left on the coffee table" in report.message
