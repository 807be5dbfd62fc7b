"""A network that another tool exported in the place of the shipped detector, in the plant."""

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from tests.skills.exported_networks import coloured_patch

pytestmark = pytest.mark.mission


def test_a_drink_is_fetched_by_an_own_network_that_knows_cans(tmp_path):
    coloured_patch(tmp_path / "own.onnx", (185, 0, 0), tolerance=0.22)
    stack = tmp_path / "stack.yaml"
    stack.write_text("detector: {use: onnx, file: own.onnx, classes: {can: drink}}\n", encoding="utf-8")
    said = "fetch me a drink from the kitchen"
    request = Request(sentence=said, world="flat", seed=2, stack=stack, out=tmp_path / "out", record=False)
    report = run_request(prepare(request)).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.why == "The coke was lifted from the kitchen counter. The coke rests on Robin's tray."
