"""Missions through Spot's API: adapter and server in lock-step, judged by the plant's referee.

go to the kitchen   fulfilled, as in process
fetch a drink       fulfilled, as in process (nightly)
"""

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install 'spot-errand[spot]'")

from executive.mission.request import Request
from tests.benchmarks.spot_missions import MISSIONS, through_api


@pytest.mark.mission
@pytest.mark.parametrize(
    "what",
    [
        {"sentence": "go to the kitchen", "seed": 3},
        pytest.param({"file": MISSIONS / "fetch_drink.yaml", "seed": 1}, marks=pytest.mark.nightly),
    ],
    ids=["go", "fetch"],
)
def test_a_mission_through_the_api_is_fulfilled(what, tmp_path):
    ended = through_api(Request(**what, record=False, out=tmp_path / "out"), tmp_path / "credentials")
    assert (ended.outcome, ended.verdict) == ("success", True), ended
