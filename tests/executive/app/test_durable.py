"""The arguments by which another process runs the same request."""

from pathlib import Path

import pytest

from executive.app.durable import run_arguments
from executive.app.prepare import prepare
from executive.mission.request import Request, Start

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("start", "given", "arguments"),
    [
        (Start.of("unknown"), {}, ["--start=unknown"]),
        (Start.of("2 4.5 0.1"), {"x": 3.0}, ["--start=2.0 4.5 0.1", "--set=x=3.0"]),
        (None, {}, []),
    ],
)
def test_start_and_values_go_along(start, given, arguments):
    file = ROOT / "missions" / "go_to_pose.yaml"
    asked = Request(file=file, start=start, given=given)
    assert run_arguments(asked, prepare(asked)) == [str(file), *arguments]
