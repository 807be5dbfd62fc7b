"""Missions through ROS 2: adapter and server in lock-step, judged by the plant's referee."""

import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros2_missions import through_ros

from executive.mission.request import Request
from executive.run.control import Control
from executive.run.control_state import Mode
from tests.benchmarks.served_missions import MISSIONS, Cut


@pytest.mark.mission
@pytest.mark.parametrize(
    "what",
    [
        {"file": MISSIONS / "go_to_pose.yaml", "given": {"x": 8.6, "y": 4.5, "yaw": 1.57}, "seed": 3},
        pytest.param({"sentence": "go to the kitchen", "seed": 3}, marks=pytest.mark.nightly),
        pytest.param({"file": MISSIONS / "fetch_drink.yaml", "seed": 1}, marks=pytest.mark.nightly),
    ],
    ids=["go a metre", "go", "fetch"],
)
def test_a_mission_through_ros_is_fulfilled(what, tmp_path):
    ended = through_ros(Request(**what, record=False, out=tmp_path / "out"))
    assert (ended.outcome, ended.verdict) == ("success", True), ended


@pytest.mark.mission
@pytest.mark.nightly
def test_a_run_whose_robot_is_silent_for_a_while_goes_on_by_itself(tmp_path):
    control, cuts = Control(attended=True, pace=None), []

    def with_cut(step):
        cuts.append(Cut(step.cut, control, tick=100))
        return {"visitors": cuts, "control": control}

    ended = through_ros(Request(sentence="go to the kitchen", seed=3, record=False, out=tmp_path / "out"), with_cut)
    assert cuts[0].seen == [(Mode.RUNNING, ""), (Mode.PAUSED, "Alice has not answered for 3 s"), (Mode.RUNNING, "")]
    assert (ended.outcome, ended.verdict) == ("success", True), ended
