"""A whole mission while something happens in the world, from the command line."""

import json

import pytest
from typer.testing import CliRunner

from executive.cli.entry import app
from executive.record.history import read_history

pytestmark = pytest.mark.mission


@pytest.mark.nightly
def test_an_object_that_is_moved_before_it_is_grasped_is_found_where_it_is_now(tmp_path):
    file = tmp_path / "moved.yaml"
    file.write_text("events:\n  - {object: beer, at: 8 s, to: kitchen table}\n", encoding="utf-8")
    fault = "camera.hand: dropout 3 s at 12 s"
    options = ["--no-record", "--quiet", "--json", "--out", str(tmp_path), "--scenario", str(file), "--fault", fault]
    done = CliRunner().invoke(app, ["run", "--say", "fetch me a beer from the kitchen", *options])
    assert done.stdout, done.output
    report = json.loads(done.stdout.splitlines()[-1])
    assert (report["outcome"], report["referee"]["success"]) == ("success", True), report
    assert "lifted from the kitchen table" in report["referee"]["why"]
    assert (report["referee"]["collisions"], report["referee"]["drops"]) == (0, 0)
    told = [each.data["message"] for each in read_history(tmp_path / "last").events if each.topic == "control"]
    assert told[:3] == ["somebody moves the beer to the kitchen table", f"{fault}: begins", f"{fault}: is over"]
