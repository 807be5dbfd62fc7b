"""`errand check`: what scripts rely on, and what people see."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.app import checker
from executive.cli import entry

ROOT = Path(__file__).parents[3]
GOOD = ROOT / "missions" / "go_living_room.yaml"


def invoke(*arguments):
    return CliRunner().invoke(entry.app, ["check", *map(str, arguments)])


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="m.yaml"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return to_file


def test_each_file_is_one_line_and_the_errors_stand_apart(write):
    bad = write("name: x\nsteps:\n  - {to: kichen}\n  - say: sing\n")
    result = invoke(GOOD, bad)
    good, broken = result.stdout.splitlines()
    assert (good[0], str(GOOD) in good, "of the battery" in good) == ("✓", True, True)
    assert broken == f"✗ {bad}: 2 errors"
    assert len(result.stderr.splitlines()) == 2


# Where the robot stands and what is given; whether the way is planned without an error, and why not.
GO = [
    (("--set", "x=2", "--set", "y=4.5"), ""),
    (("--start", "2", "4.5", "0"), ""),
    (("--set", "x=0", "--set", "y=0"), "is blocked"),
    (("--set", "z=1"), "has no parameter 'z'"),
    (("--start", "0", "0", "0"), "stands in an obstacle"),
]


@pytest.mark.parametrize(("options", "why"), GO)
def test_values_of_parameters_and_the_start_are_checked(options, why):
    result = invoke("go_to_pose", *options)
    assert (result.exit_code, why in result.stderr) == (2 if why else 0, True)


PARTS = """name: x
robots: {alice: spot, bob: fetch}
parts:
  alice: {steps: [{to: kitchen}]}
  bob: {steps: [{to: %s}]}
"""


def test_the_parts_of_all_robots_are_checked(write):
    good = json.loads(invoke(write(PARTS % "office"), "--json").stdout)
    assert [command.split()[3] for command in good["commands"]] == ["[kitchen]", "[office]"]
    assert invoke(write(PARTS % "ofice")).stderr.count(":5: unknown place or person 'ofice'") == 1


def test_robots_that_wait_for_each_other_take_as_long_as_one_after_the_other(write):
    def estimate(text):
        return checker.Checker().check_file(write(text)).estimate

    robots, _, alice, bob = PARTS.replace("%s", "office").split("\n")[1:5]
    together = f"name: x\n{robots}\nparts:\n{alice}\n{bob}\n"
    each = [estimate(f"name: x\n{robots}\nparts:\n{part}\n") for part in (alice, bob)]
    at_once, in_turn = estimate(together), estimate(together.replace("bob: {steps", "bob: {after: alice, steps"))
    assert at_once.duration_s == max(one.duration_s for one in each)
    assert in_turn.duration_s == pytest.approx(sum(one.duration_s for one in each))
    assert at_once.distance_m == in_turn.distance_m == pytest.approx(sum(one.distance_m for one in each))


def test_the_plan_is_shown_on_demand():
    result = invoke(GOOD, "-v")
    assert result.exit_code == 0
    assert "Take [Nothing] to [living room] and do [Nothing] to [Nothing]" in result.stdout
    assert "navigate" in result.stdout


def test_json_is_one_object_for_all_files(write):
    bad = write("name: x\nsteps:\n  - {to: kichen}\n  - {to: hall, timeout: 0}\n")
    result = invoke(GOOD, bad, "--json")
    assert result.exit_code == 2
    told = json.loads(result.stdout.splitlines()[-1])
    assert set(told) == {"ok", "errors", "warnings", "nodes", "commands", "estimates"}
    assert [one["file"] for one in told["estimates"]] == [str(GOOD)]
    assert told["ok"] is False
    assert told["nodes"] > 3
    assert told["commands"] == ["Take [Nothing] to [living room] and do [Nothing] to [Nothing]"]
    assert told["errors"] == [
        {
            "file": str(bad),
            "line": 4,
            "message": "steps.1.timeout: should be above 0 and at most 86400 s",
            "hint": "it reads 0 now",
        }
    ]


def test_all_errors_of_a_file_are_told(write):
    bad = write("name: x\nsteps:\n  - {to: kichen}\n  - say: sing\n  - {skill: fly}\n  - use: nowhere.yaml\n")
    told = json.loads(invoke(bad, "--json").stdout)
    assert [error["line"] for error in told["errors"]] == [3, 4, 6]
    assert told["errors"][0]["hint"] == "did you mean 'kitchen'?"


def test_a_good_file_alone_is_ok():
    assert json.loads(invoke(GOOD, "--json").stdout)["ok"] is True


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("name: x\nsteps:\n  - {skill: navigate, with: {x: 0.0, y: 0.0}}\n", 3, "blocked"),
        ("name: x\nsteps:\n  - {skill: navigate, with: {x: 60.0, y: 0.0}}\n", 3, "blocked"),
        ("name: x\nworld: moon\nsteps:\n  - say: go to the kitchen\n", 2, "unknown world 'moon'"),
    ],
)
def test_an_action_beyond_the_robot_is_refused(write, text, line, says):
    result = invoke(write(text), "--json")
    (error,) = json.loads(result.stdout)["errors"]
    assert (result.exit_code, error["line"], says in error["message"]) == (2, line, True), error
    assert error["hint"]


def test_people_read_the_errors_on_standard_error(write):
    result = invoke(write("name: x\nstep: []\n"))
    assert result.exit_code == 2
    assert "m.yaml:2: unknown key 'step'; did you mean 'steps'?" in result.stderr


def test_a_world_that_is_not_there_is_no_traceback():
    result = invoke(GOOD, "--world", "fla")
    assert (result.exit_code, "did you mean 'flat'?" in result.stderr) == (2, True)


def test_paths_are_planned_with_the_planner_of_a_stack_file(write):
    mission = write("name: x\nsteps:\n  - {to: kitchen}\n")
    wide = write("planner: {use: lattice, margin_m: 3.0, least_margin_m: 3.0}\n", "wide.yaml")
    assert json.loads(invoke(mission, "--json").stdout)["ok"] is True
    (error,) = json.loads(invoke(mission, "--json", "--stack", wide).stdout)["errors"]
    assert (error["file"], error["line"]) == (str(mission), 3)


def test_a_stack_file_that_cannot_be_used_is_refused_with_its_line(write):
    bad = write("planner: {use: lattice}\nlocaliser: {use: none_such}\n", "stack.yaml")
    (error,) = json.loads(invoke(GOOD, "--json", "--stack", bad).stdout)["errors"]
    assert (error["file"], error["line"]) == (str(bad), 2)


def test_a_broken_plug_in_fails_only_the_file_that_uses_it(write, tmp_path):
    info = tmp_path / "wavers-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: wavers\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[errand.skills]\nwave = wavers:Wave\n[errand.planners]\nbad = wavers:Bad\n")
    (tmp_path / "wavers.py").write_text("raise SystemExit(0)\n")
    bad, other = write("name: w\nsteps:\n  - skill: wave\n"), tmp_path / "other.yaml"
    other.write_text("name: o\nsteps:\n  - to: kitchen\n")
    command = [sys.executable, "-m", "executive.cli.entry", "check", "--json", str(GOOD), str(bad), str(other)]
    where = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": where}, capture_output=True, text=True, check=False)
    (error,) = json.loads(done.stdout)["errors"]
    assert (error["file"], error["line"], "distribution wavers" in error["message"]) == (str(bad), 3, True)
    assert "Traceback" not in done.stderr


def test_each_file_is_checked_on_its_own(write, monkeypatch):
    """A defect that one file brings about is its error, and the others are still checked."""
    poison, checked = write("name: x\nsteps:\n  - to: kitchen\n"), checker.prepare

    def prepared(request, **more):
        if request.file == poison:
            raise RecursionError("too deep")
        return checked(request, **more)

    monkeypatch.setattr(checker, "prepare", prepared)
    result = invoke(poison, GOOD, "--json")
    told = json.loads(result.stdout.splitlines()[-1])
    assert [(error["file"], "RecursionError" in error["message"]) for error in told["errors"]] == [(str(poison), True)]
    assert told["commands"]


def test_a_file_is_checked_for_the_robots_that_are_given(write):
    heavy = write("name: x\nsteps:\n  - {to: workshop, do: grasp, object: extinguisher}\n")
    assert invoke(heavy, "--robots", "bob=fetch").exit_code == 0
    unknown = invoke(heavy, "--robots", "bob=fatch")
    assert (unknown.exit_code, "unknown kind of robot 'fatch'" in unknown.stderr) == (2, True)


WALLS = """<sdf version="1.9"><model name="walls"><link name="walls"><collision name="c">
<geometry><sphere><radius>RADIUS</radius></sphere></geometry></collision></link></model></sdf>
"""


@pytest.mark.parametrize(("radius", "said"), [("1", ""), ("none", "the simulation cannot use it")])
def test_a_world_that_the_simulation_cannot_use_is_refused(tmp_path, write, radius, said):
    home = tmp_path / "home"
    home.mkdir()
    write("directives:\n- add_model: {name: walls, file: package://world/walls.sdf}\n", "home/world.dmd.yaml")
    write(WALLS.replace("RADIUS", radius), "home/walls.sdf")
    write("start: {x: 0, y: 0, yaw: 0}\n", "home/knowledge.yaml")
    result = invoke(write("name: x\nsteps: [{speak: hello}]\n"), "--world", home)
    assert (result.exit_code, said in result.stderr) == (2 if said else 0, True), result.stderr


def test_a_range_of_time_is_printed_with_its_reason_and_stands_in_the_json(write):
    file = write('name: wait\nworld: flat\nsteps:\n  - wait: {until_clock: "18:00"}\n')
    (estimate,) = json.loads(invoke(file, "--json").stdout)["estimates"]
    assert (estimate["least_s"], estimate["most_s"], estimate["reasons"]) == (0.0, 86400.0, ["until 18:00"])
    assert "0 min 00 s to 24 h 00 min (until 18:00)" in " ".join(invoke(file).stdout.split())


# The steps of `else` -> the least and the most that it may take (s)
@pytest.mark.parametrize(("otherwise", "least_s", "most_s"), [("", 0, 60), ("else: [{wait: {seconds: 15}}]", 15, 60)])
def test_an_if_takes_as_long_as_one_of_its_branches(write, otherwise, least_s, most_s):
    step = f"- if: battery > 0.5\n    then: [{{wait: {{seconds: 60}}}}]\n    {otherwise}\n"
    file = write(f"name: x\nworld: flat\nsteps:\n  {step}")
    (estimate,) = json.loads(invoke(file, "--json").stdout)["estimates"]
    assert (estimate["least_s"], estimate["most_s"]) == (least_s, most_s)
    assert estimate["reasons"] == ["battery > 0.5?"]
