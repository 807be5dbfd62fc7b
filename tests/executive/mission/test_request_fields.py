"""The command line that repeats a run."""

from pathlib import Path

from executive.mission.request import Request
from executive.mission.request_fields import command_of


def test_the_command_that_repeats_a_run_does_not_write_into_its_folder():
    asked = Request("go to the kitchen", seed=4, out=Path("out/2026-11-28-1712-go-kitchen"))
    assert command_of(asked) == "errand run '--say=go to the kitchen' --seed=4"
