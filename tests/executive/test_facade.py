"""Errand as a library: the few functions of `executive` itself."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import executive
from executive.app.evaluate.results import Case, Cases, RunSpec
from executive.app.prepare.mission_files import request_of
from executive.app.report.run_report import RunReport
from executive.testing.bench import room_knowledge
from skills.inputs.errors import InputError

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
@pytest.mark.nightly  # the notebook `five_lines` does the same in `make test`
def test_a_sentence_is_run_and_judged_and_its_report_shows_itself(tmp_path):
    report = executive.run_mission("go to the kitchen", out=tmp_path / "out", record=False)
    assert (report.achieved, report.seen.success) == (True, True)
    assert (tmp_path / "out" / "log.mcap").is_file()
    shown = report._repr_html_()
    assert "The referee saw: fulfilled" in shown and 'srcdoc="&lt;!' in shown


def test_a_scenario_that_names_an_unknown_world_is_refused_before_any_run(tmp_path):
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("missions: [go to the kitchen]\nworlds: [nowhere]\nseeds: '1'\n", encoding="utf-8")
    with pytest.raises(InputError, match="unknown world 'nowhere'"):
        executive.evaluate(scenario, out=tmp_path / "out")


@pytest.mark.mission
def test_the_runs_of_a_scenario_are_judged_and_kept(tmp_path):
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("missions: [say hello]\nseeds: '1'\n", encoding="utf-8")
    (case,) = executive.evaluate(scenario, out=tmp_path / "out", jobs=1)
    assert (case.report.achieved, case.run.request.seed) == (True, 1)
    assert executive.evaluate(scenario, out=tmp_path / "out", jobs=1)[0] == case


@pytest.mark.parametrize(
    ("mission", "expected"),
    [("go to the hall", ("go to the hall", None)), ("patrol", (None, Path("patrol"))), (Path("a"), (None, Path("a")))],
)
def test_a_mission_is_a_sentence_a_file_or_the_name_of_a_shipped_one(mission, expected):
    asked = request_of(mission)
    assert (asked.sentence, asked.file) == expected


def test_keyword_arguments_are_the_fields_of_a_request_as_they_are_typed():
    asked = request_of("go", robots="bob=fetch", start="unknown", faults=["arm refuses at 3 s"], people=2, out="runs")
    assert [(robot.name, robot.kind) for robot in asked.robots] == [("Bob", "fetch")]
    assert (asked.start, asked.scenario.faults, asked.variation.people) == ("unknown", ("arm refuses at 3 s",), 2)
    assert (request_of(asked, seed=4).seed, request_of(asked, seed=4).variation.people) == (4, 2)


@pytest.mark.parametrize(("field", "value"), [("colour", "red"), ("seed", -1), ("light", 3), ("people", 99)])
def test_a_keyword_argument_that_cannot_be_used_is_refused_by_name(field, value):
    with pytest.raises(InputError, match=field):
        request_of("go", **{field: value})


def test_a_printed_check_is_a_few_lines_also_of_a_long_mission():
    checked = executive.check("patrol")
    lines = str(checked).splitlines()
    assert (len(lines), lines[2]) == (4, f"and {sum(len(tree.commands) for tree in checked.trees) - 2} more")
    assert lines[-1] == str(checked.estimate)
    assert str(executive.check("go to the moon")).startswith("error: I do not understand 'go to the moon'")


def test_results_show_themselves_in_a_notebook():
    checked = executive.check("go to the kitchen", world="flat")
    assert all(each in checked._repr_html_() for each in ("Take [Nothing] to [kitchen]", "m of driving", "<svg"))
    drawn = checked._repr_html_().partition("<svg")[2]
    assert "STEP" in drawn and "battery" not in drawn
    assert "error: " in executive.check("go to the moon")._repr_html_()
    assert GO in executive.parse("go to the kitchen")._repr_html_()
    assert "moon" in executive.parse("go to the moon")._repr_html_()
    plan = executive.load_world()._repr_html_()
    assert plan.startswith("<svg") and plan.count("<polygon") == 7 and ">kitchen<" in plan
    case = Case(RunSpec(executive.Request("go <there>", seed=3), "go"), report_of(3))
    assert "<td>3</td><td>go &lt;there&gt;</td><td>claimed, not judged</td>" in Cases([case])._repr_html_()


def report_of(seed):
    return RunReport("success", None, "done", None, (), "flat", seed, 9.0, 1.0, 9.0, 90, "")


def test_there_is_nothing_else():
    with pytest.raises(AttributeError, match="has no attribute 'fly'"):
        executive.fly  # noqa: B018
