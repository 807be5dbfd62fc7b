"""Runs that a studio starts: their arguments, their live page, their end."""

import asyncio
from pathlib import Path

import pytest
from studio_user import play

from errand_studio.running import MissionRuns, RunOptions


@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        (RunOptions(), ["--seed=1"]),
        (RunOptions(world="shop", seed=7, robots="alice=fetch", people=2), None),
        (RunOptions(faults="camera.hand: dropout 5 s at 20 s\n\n lidar: dropout 1 s at 2 s "), None),
        (RunOptions(world="--store=/tmp/x"), ["--world=--store=/tmp/x", "--seed=1"]),
    ],
)
def test_a_form_becomes_arguments(options: RunOptions, arguments: list[str] | None) -> None:
    known = {
        "shop": ["--world=shop", "--robots=alice=fetch", "--seed=7", "--people=2"],
        "": ["--fault=camera.hand: dropout 5 s at 20 s", "--fault=lidar: dropout 1 s at 2 s", "--seed=1"],
    }
    assert options.arguments() == (arguments or known[options.world])


def test_a_mission_that_is_refused_says_why(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("name: a\nsteps:\n  - to: nowhere at all\n")

    async def scenario() -> None:
        runs = MissionRuns(tmp_path / "out")
        running = await runs.start(tmp_path / "a.yaml", RunOptions())
        await asyncio.wait_for(running.process.wait(), 120)
        while not running.lines:
            await asyncio.sleep(0.05)
        assert "a.yaml:3" in running.lines[-1]
        assert not running.goes_on

    play(scenario)
