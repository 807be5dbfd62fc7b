"""A drink is found by a network that another tool exported, and thrown into a bin, by the referee's verdict."""

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from skills.robot import Pose2D
from tests.skills.exported_networks import coloured_patch

pytestmark = pytest.mark.mission


def test_the_robot_throws_a_drink_that_an_own_network_knows_into_the_bin(tmp_path):
    coloured_patch(tmp_path / "own.onnx", (185, 0, 0), tolerance=0.22)
    stack = tmp_path / "stack.yaml"
    stack.write_text("detector: {use: onnx, file: own.onnx, classes: {can: drink}}\n", encoding="utf-8")
    options = {"stack": stack, "out": tmp_path / "out", "record": False, "start": Pose2D(9.0, 5.9, 1.57)}
    report = run_request(prepare(Request(sentence="throw a drink into the bin", seed=2, **options))).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.why == "The coke was lifted from the kitchen counter. The coke rests in the kitchen bin."
    assert (report.referee.collisions, report.referee.drops) == (0, 0), report.referee.events
