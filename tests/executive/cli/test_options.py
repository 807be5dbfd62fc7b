"""The options of a request: each is read to the JSON form that is written down, and comes back by every way."""

import json
import shlex
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from executive.app.evaluate.results import RunSpec
from executive.cli.entry import shipped_command
from executive.cli.options import StartCommand, join_values, takes_request
from executive.mission.request import Request
from executive.mission.request_fields import request_arguments
from executive.store.database import form
from executive.store.missions import MissionStore
from executive.store.standing_missions import StandingMissions
from executive.store.triggers import OnCall
from tests.tables import yaml_beside

GOLDEN: dict[str, Any] = yaml_beside(__file__, "request_options.yaml")
NOT_OF_THE_REQUEST = {
    *("--listen", "--json", "--quiet", "--tree", "--profile", "--store", "--anyway", "--voice"),
    *("--view", "--view-port", "--view-host", "--observe", "--help"),
    "--robot",
}


def request_of(words: str) -> Request:
    """The request that a command with all options makes of these words."""
    made: list[Request] = []

    @takes_request()
    def asked(request: Request) -> None:
        made.append(request)

    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    alone.command(cls=StartCommand)(asked)
    result = CliRunner().invoke(alone, shlex.split(words))
    assert result.exit_code == 0, result.output
    return made[0]


@pytest.mark.parametrize("words", GOLDEN)
def test_an_option_makes_the_request_that_is_written_down(words):
    assert json.loads(request_of(words).to_json()) == GOLDEN[words]


def test_every_option_of_run_that_is_of_the_request_is_written_down():
    typed = {option for each in shipped_command("run").params for option in (*each.opts, *each.secondary_opts)} - {
        "file"
    }
    written = {word.partition("=")[0] for words in GOLDEN for word in shlex.split(words) if word.startswith("--")}
    assert typed - NOT_OF_THE_REQUEST == written


@pytest.mark.parametrize("words", GOLDEN)
def test_a_request_comes_back_from_its_arguments(words):
    request = request_of(words)
    assert request_of(shlex.join(request_arguments(request))) == request


@pytest.mark.parametrize("words", GOLDEN)
def test_a_request_comes_back_from_the_store_and_a_standing_mission(words, tmp_path):
    request = request_of(words)
    with MissionStore(tmp_path / "missions.sqlite") as store:
        store.add(request, queued=True)
        standing = StandingMissions(store).add(request, OnCall("now"))
        StandingMissions(store).fire([(standing, request)], "")
    with MissionStore(tmp_path / "missions.sqlite", create=False) as store:
        assert [each.request for each in store.missions()] == [request] * 3


@pytest.mark.parametrize("words", GOLDEN)
def test_a_request_comes_back_from_a_run_of_an_evaluation(words):
    spec = RunSpec(request_of(words), "mission")
    back = form(RunSpec).validate_json(form(RunSpec).dump_json(spec))
    assert (back, back.id) == (spec, spec.id)


def test_three_numbers_after_start_are_one_value():
    assert join_values(["run", "--start", "1", "-2", "0.5", "m.yaml"]) == ["run", "--start=1 -2 0.5", "m.yaml"]
    assert join_values(["run", "--start", "unknown", "m.yaml"]) == ["run", "--start", "unknown", "m.yaml"]


@pytest.mark.parametrize(
    ("words", "joined"),
    [
        (["--ros2"], ["--observe=ros2="]),
        (["--ros2", "7", "patrol"], ["--observe=ros2=7", "patrol"]),
        (["--ros2", "@:7448"], ["--observe=ros2=@:7448"]),
        (["--ros2", "patrol"], ["--observe=ros2=", "patrol"]),
        (["--ros2", "--quiet"], ["--observe=ros2=", "--quiet"]),
        (["--foxglove", "my/patrol.yaml"], ["--observe=foxglove=", "my/patrol.yaml"]),
        (["--foxglove", "0.0.0.0:9000", "patrol"], ["--observe=foxglove=0.0.0.0:9000", "patrol"]),
        (["--foxglove", "[::1]:9000"], ["--observe=foxglove=[::1]:9000"]),
        (["--foxglove=host:x"], ["--observe=foxglove=host:x"]),
    ],
)
def test_a_name_with_dashes_is_short_for_its_observer(words, joined):
    assert join_values(words) == joined
