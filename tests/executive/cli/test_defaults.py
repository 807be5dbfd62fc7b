"""Defaults of options from `errand.toml` and `pyproject.toml`."""

from types import SimpleNamespace

import pytest
import typer
from typer.testing import CliRunner

from executive.cli.defaults import default_map
from executive.cli.options import StartCommand, takes_request
from skills.inputs.errors import InputError

MISSION = "name: there\n{more}steps:\n  - to: hall\n"


@pytest.fixture
def request_of(tmp_path, monkeypatch):
    """Returns the request of typed words beside a file of defaults."""
    monkeypatch.chdir(tmp_path)

    def call(defaults, *words):
        (tmp_path / "errand.toml").write_text(defaults)
        made = SimpleNamespace()

        @takes_request()
        def asked(request):
            made.request = request

        alone = typer.Typer(add_completion=False)
        alone.command(cls=StartCommand)(asked)
        found = CliRunner().invoke(alone, words, default_map=default_map(tmp_path)["run"])
        assert found.exit_code == 0, found.output
        return made.request

    return call


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, "a = " + "{a = " * 5000, "a = " + "9" * 5000])
def test_a_file_that_cannot_be_parsed_is_named(tmp_path, text):
    (tmp_path / "errand.toml").write_text(text)
    with pytest.raises(InputError, match=r"errand.toml: .*; correct it there$"):
        default_map(tmp_path)


def test_defaults_count_for_a_sentence_and_what_is_typed_counts_more(request_of, tmp_path):
    (tmp_path / "own.yaml").write_text("")
    words = 'world = "shop"\nstack = "own.yaml"\nout = "runs"\n'
    request = request_of(words, "--say", "go to the hall")
    assert (request.world, str(request.stack), str(request.out)) == ("shop", "own.yaml", "runs")
    assert request_of(words, "--say", "go to the hall", "--world", "lab").world == "lab"


def test_the_world_and_the_robots_of_a_mission_file_count_more_than_defaults(request_of, tmp_path):
    (tmp_path / "plain.yaml").write_text(MISSION.format(more=""))
    (tmp_path / "own.yaml").write_text(MISSION.format(more="world: lab\nrobots: {Bob: fetch}\n"))
    words = 'world = "shop"\nrobots = "alice=spot"\n'
    plain, own = request_of(words, "plain.yaml"), request_of(words, "own.yaml")
    assert (plain.world, [robot.name for robot in plain.robots]) == ("shop", ["Alice"])
    assert (own.world, own.robots) == (None, ())


def test_typed_robots_and_a_default_stack_do_not_contradict(request_of, tmp_path):
    (tmp_path / "own.yaml").write_text("")
    assert request_of('stack = "own.yaml"\n', "--say", "go", "--robots", "alice=spot").stack is None
    assert request_of('robots = "alice=spot"\n', "--say", "go", "--start", "1", "2", "0").robots == ()


def test_paths_count_from_the_folder_of_the_file_above(tmp_path, monkeypatch):
    (tmp_path / "below").mkdir()
    (tmp_path / "office").mkdir()
    (tmp_path / "pyproject.toml").write_text('[tool.errand]\nworld = "office"\nout = "runs"\n')
    monkeypatch.chdir(tmp_path / "below")
    found = default_map(tmp_path / "below")
    assert found["run"] == {"world": "../office", "out": "../runs"}
    assert (found["queue"]["list"], found["teleop"]) == ({"out": "../runs"}, {"world": "../office"})


def test_a_project_without_the_section_and_a_folder_without_a_file_give_no_defaults(tmp_path):
    (tmp_path / "pyproject.toml").write_text("[tool.other]\n")
    assert default_map(tmp_path) == {}
