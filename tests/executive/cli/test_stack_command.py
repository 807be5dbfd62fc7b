from pathlib import Path

from executive.cli.stack_command import stack_file
from executive.mission.stack_file import load_stack


def test_a_stack_that_comes_with_errand_is_taken_by_its_name():
    chosen = stack_file(Path("no_map"))
    assert chosen is not None and load_stack(chosen).names["localiser"] == "dead_reckoning"


def test_a_file_is_taken_as_it_is(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text("planner: {use: lattice, greed: 1.5}\n")
    assert stack_file(own) == own
    assert stack_file(None) is None
    assert stack_file(Path("no_such")) == Path("no_such")
