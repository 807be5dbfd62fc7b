"""Errand as a library: the few functions of `executive` itself."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import executive
from executive.testing.small_room import room_knowledge
from skills.files.errors import InputError

ROOT = Path(__file__).parents[2]
GO = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"


def test_importing_it_loads_nothing_else():
    program = """
        import sys
        before = set(sys.modules)
        import executive
        loaded = {name.partition(".")[0] for name in set(sys.modules) - before}
        assert not loaded & {"numpy", "pydantic", "pydrake", "plant", "skills"}, loaded
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(program)], cwd=ROOT, check=True)


def test_a_sentence_becomes_commands_in_the_usual_world():
    assert [str(command) for command in executive.parse("go to the kitchen").commands] == [GO]


def test_a_sentence_is_understood_by_what_is_known_of_a_world():
    known = room_knowledge()
    assert executive.parse("Hey Alice, pick up the coke from the table", knowledge=known).commands[0].goal == "table"
    assert executive.parse("go to the table", knowledge=known, require_wake=True).commands == ()


def test_a_sentence_may_name_what_no_world_has():
    assert executive.parse("go to the cellar").commands == ()
    assert executive.parse("go to the cellar", open_words=True).commands[0].goal == "cellar"


def test_a_check_says_how_long_a_mission_takes_and_where_it_goes():
    checked = executive.check(executive.Request("go to the kitchen"))
    assert (checked.ok, checked.errors) == (True, ())
    assert checked.estimate.duration_s > 5.0
    assert [str(command) for tree in checked.trees for command in tree.commands] == [GO]


def test_a_check_says_what_is_wrong_and_raises_nothing():
    checked = executive.check(executive.Request("go to the moon"))
    assert not checked.ok
    assert "moon" in str(checked.errors[0])


def test_a_world_has_a_name_and_an_unknown_one_is_refused():
    assert executive.load_world().name == "flat"
    with pytest.raises(InputError, match="unknown world 'nowhere'"):
        executive.load_world("nowhere")


def test_an_impossible_request_is_not_run(tmp_path):
    with pytest.raises(InputError, match="moon"):
        executive.run_mission(executive.Request("go to the moon", out=tmp_path))


@pytest.mark.mission
def test_a_sentence_is_run_and_judged(tmp_path):
    report = executive.run_mission(executive.Request("go to the kitchen", out=tmp_path / "out", record=False))
    assert (report.achieved, report.seen.success) == (True, True)
    assert (tmp_path / "out" / "log.mcap").is_file()


def test_a_scenario_that_names_an_unknown_world_is_refused_before_any_run(tmp_path):
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("missions: [go to the kitchen]\nworlds: [nowhere]\nseeds: '1'\n", encoding="utf-8")
    with pytest.raises(InputError, match="unknown world 'nowhere'"):
        executive.evaluate(scenario, out=tmp_path / "out")


@pytest.mark.mission
def test_the_runs_of_a_scenario_are_judged_and_kept(tmp_path):
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("missions: [go to the kitchen]\nseeds: '1'\n", encoding="utf-8")
    (case,) = executive.evaluate(scenario, out=tmp_path / "out", jobs=1)
    assert (case.report.achieved, case.run.request.seed) == (True, 1)
    assert executive.evaluate(scenario, out=tmp_path / "out", jobs=1)[0] == case


def test_there_is_nothing_else():
    with pytest.raises(AttributeError, match="has no attribute 'fly'"):
        executive.fly  # noqa: B018
