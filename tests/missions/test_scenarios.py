"""Whole missions while something happens in the world, from the command line: they find another way."""

import json

import pytest
from typer.testing import CliRunner

from executive.cli.entry import app
from executive.record.history import read_history

pytestmark = pytest.mark.mission


def errand_run(out, sentence, *arguments):
    """The report of a run."""
    options = ["--no-record", "--quiet", "--json", "--out", str(out)]
    done = CliRunner().invoke(app, ["run", "--say", sentence, *options, *arguments])
    assert done.stdout, done.output
    return json.loads(done.stdout.splitlines()[-1])


def told(out):
    """What was logged of faults and events."""
    return [event.data["message"] for event in read_history(out / "last").events if event.topic == "control"]


@pytest.mark.nightly
def test_an_object_that_is_moved_before_it_is_grasped_is_found_where_it_is_now(tmp_path):
    file = tmp_path / "moved.yaml"
    file.write_text("events:\n  - {object: beer, at: 8 s, to: kitchen table}\n", encoding="utf-8")
    out, fault = tmp_path / "out", "camera.hand: dropout 3 s at 12 s"
    report = errand_run(out, "fetch me a beer from the kitchen", "--scenario", str(file), "--fault", fault)
    assert (report["outcome"], report["referee"]["success"]) == ("success", True), report
    assert "lifted from the kitchen table" in report["referee"]["why"]
    assert (report["referee"]["collisions"], report["referee"]["drops"]) == (0, 0)
    assert told(out)[:3] == ["somebody moves the beer to the kitchen table", f"{fault}: begins", f"{fault}: is over"]
