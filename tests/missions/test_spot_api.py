"""Missions through Spot's API: adapter and server in lock-step, judged by the plant's referee.

go to the kitchen   fulfilled, as in process
fetch a drink       fulfilled, as in process (nightly)
"""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install 'spot-errand[spot]'")
sys.path.insert(0, str(Path(__file__).parents[1] / "plant" / "spot_api"))
from lock_step import LockStep

from executive.app.goal_conditions import verdict_of
from executive.app.mission_run import run_request
from executive.app.prepare import prepare
from executive.app.real_spot import ApiBackend
from executive.app.simulated import simulate
from executive.mission.request import Request
from plant.spot_api.server.identity import credentials
from skills.stack import default_stack


class Judged(ApiBackend):
    """The backend of a real Spot, with the referee of the plant behind the server."""

    def __init__(self, step, simulation, prepared):
        super().__init__(step.robot, step, prepared.world, default_stack(), prepared.world.start)
        self._simulation = simulation

    def judge(self, tree, result, *, before=(), since_s=0.0):
        return verdict_of(tree, result, self._simulation.referee.judge, before=before, since_s=since_s)


@pytest.mark.mission
@pytest.mark.parametrize(
    "request_made",
    [
        Request(sentence="go to the kitchen", seed=3, record=False),
        pytest.param(Request(file=Path("fetch_drink"), seed=1, record=False), marks=pytest.mark.nightly),
    ],
    ids=["go", "fetch"],
)
def test_a_mission_through_the_api_is_fulfilled(request_made, tmp_path):
    prepared = prepare(replace(request_made, out=tmp_path / "out"))
    made = []

    def build():
        made.append(simulate(prepared.world, prepared.robots, seed=request_made.seed, record=False))
        return made[0].robots["Alice"], made[0].clock

    step = LockStep(build, credentials(tmp_path / "credentials"))
    try:
        step.stand_up()
        report = run_request(prepared, Judged(step, made[0], prepared)).report
        assert (report.achieved, report.seen.success) == (True, True), report
    finally:
        made.clear()
        step.close()
