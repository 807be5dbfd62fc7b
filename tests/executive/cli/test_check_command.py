"""`errand check`: what scripts rely on, and what people see."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from executive.app.prepare import checker
from executive.mission.request import Request
from tests.executive.cli.calls import errand, json_of
from tests.executive.distribution import write_distribution
from tests.skills.exported_networks import mean_colour

ROOT = Path(__file__).parents[3]
GOOD = ROOT / "missions" / "go_living_room.yaml"


def check(*words):
    return errand("check", *words)


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="m.yaml"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return to_file


def test_each_file_is_one_line_and_the_errors_stand_apart(write):
    bad = write("name: x\nsteps:\n  - {to: kichen}\n  - say: sing\n")
    result = check(GOOD, bad)
    good, broken = result.stdout.splitlines()
    assert (good[0], str(GOOD) in good, "of the battery" in good) == ("✓", True, True)
    assert (broken, len(result.stderr.splitlines())) == (f"✗ {bad}: 2 errors", 2)


PARTS = """name: x
robots: {alice: spot, bob: fetch}
parts:
  alice: {steps: [{to: kitchen}]}
  bob: {steps: [{to: %s}]}
"""


def test_the_parts_of_all_robots_are_checked(write):
    good = json_of(check(write(PARTS % "office"), "--json"))
    assert [command.split()[3] for command in good["commands"]] == ["[kitchen]", "[office]"]


def test_robots_that_wait_for_each_other_take_as_long_as_one_after_the_other(write):
    def estimate(text):
        return checker.Checker().check(Request(file=write(text))).estimate

    robots, _, alice, bob = PARTS.replace("%s", "office").split("\n")[1:5]
    together = f"name: x\n{robots}\nparts:\n{alice}\n{bob}\n"
    each = [estimate(f"name: x\n{robots}\nparts:\n{part}\n") for part in (alice, bob)]
    at_once, in_turn = estimate(together), estimate(together.replace("bob: {steps", "bob: {after: alice, steps"))
    assert at_once.duration_s == max(one.duration_s for one in each)
    assert in_turn.duration_s == pytest.approx(sum(one.duration_s for one in each))
    assert at_once.distance_m == in_turn.distance_m == pytest.approx(sum(one.distance_m for one in each))


def test_the_plan_is_shown_on_demand():
    result = check(GOOD, "-v")
    assert result.exit_code == 0
    assert "Take [Nothing] to [living room] and do [Nothing] to [Nothing]" in result.stdout
    assert "navigate" in result.stdout


def test_json_is_one_object_for_all_files(write):
    bad = write("name: x\nsteps:\n  - {to: kichen}\n  - {to: hall, timeout: 0}\n")
    result = check(GOOD, bad, "--json")
    assert result.exit_code == 2
    told = json_of(result)
    assert set(told) == {"ok", "errors", "warnings", "detectors", "nodes", "commands", "estimates"}
    assert [one["file"] for one in told["estimates"]] == [str(GOOD)]
    assert told["ok"] is False
    assert told["nodes"] > 3
    assert told["commands"] == ["Take [Nothing] to [living room] and do [Nothing] to [Nothing]"]
    error = {"message": "steps.1.timeout: should be above 0 and at most 86400 s", "hint": "it reads 0 now"}
    assert told["errors"] == [{"file": str(bad), "line": 4, **error}]


def test_all_errors_of_a_file_are_told(write):
    bad = write("name: x\nsteps:\n  - {to: kichen}\n  - say: sing\n  - {skill: fly}\n  - use: nowhere.yaml\n")
    told = json_of(check(bad, "--json"))
    assert [error["line"] for error in told["errors"]] == [3, 4, 6]
    assert told["errors"][0]["hint"] == "did you mean 'kitchen'?"


def test_paths_are_planned_with_the_planner_of_a_stack_file(write):
    mission = write("name: x\nsteps:\n  - {to: kitchen}\n")
    wide = write("planner: {use: lattice, margin_m: 3.0, least_margin_m: 3.0}\n", "wide.yaml")
    assert [json_of(check(file, "--json"))["ok"] for file in (GOOD, mission)] == [True, True]
    (error,) = json_of(check(mission, "--json", "--stack", wide))["errors"]
    assert (error["file"], error["line"]) == (str(mission), 3)


def test_the_detector_of_a_stack_file_is_tried_and_described(write, tmp_path):
    mean_colour(tmp_path / "own.onnx")
    mission = write("name: x\nsteps:\n  - {to: kitchen}\n")
    stack = write("detector: {use: onnx, file: own.onnx, classes: {red: beer}}\n", "stack.yaml")
    assert "detector: Ultralytics YOLO" in check(mission, "--stack", stack).stdout
    (about,) = json_of(check(mission, "--json", "--stack", stack))["detectors"]
    assert "labels 0 red (beer), 1 green, 2 blue" in about


def test_a_broken_plug_in_fails_only_the_file_that_uses_it(write, tmp_path):
    broken = ("wave = wavers:Wave", "[errand.planners]", "bad = wavers:Bad")
    write_distribution(tmp_path, "wavers", "errand.skills", *broken)
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
    result = check(poison, GOOD, "--json")
    told = json_of(result)
    assert [(error["file"], "RecursionError" in error["message"]) for error in told["errors"]] == [(str(poison), True)]
    assert told["commands"]


def test_a_file_is_checked_for_the_robots_that_are_given(write):
    heavy = write("name: x\nsteps:\n  - {to: workshop, do: grasp, object: extinguisher}\n")
    assert check(heavy, "--robots", "bob=fetch").exit_code == 0


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
    result = check(write("name: x\nsteps: [{speak: hello}]\n"), "--world", home)
    assert (result.exit_code, said in result.stderr) == (2 if said else 0, True), result.stderr


def test_a_range_of_time_is_printed_with_its_reason_and_stands_in_the_json(write):
    file = write('name: wait\nworld: flat\nsteps:\n  - wait: {until_clock: "18:00"}\n')
    (estimate,) = json_of(check(file, "--json"))["estimates"]
    assert (estimate["least_s"], estimate["most_s"], estimate["reasons"]) == (0.0, 86400.0, ["until 18:00"])
    assert "0 s to 24 h 00 min (until 18:00)" in " ".join(check(file).stdout.split())


def test_a_time_of_day_sets_the_limit_of_a_wait(write):
    file = write('name: wait\nworld: flat\nsteps:\n  - wait: {until_clock: "18:00"}\n')
    (estimate,) = json_of(check(file, "--time-of-day", "17:00", "--json"))["estimates"]
    assert estimate["time_limit_s"] == 1200.0 + 3600.0


def test_check_says_when_the_time_limit_ends_a_run(write):
    endless = write('name: endless\nworld: flat\nsteps:\n  - repeat: {every: "10 min"}\n    steps: [dock]\n')
    told = " ".join(check(endless).stdout.split())
    assert "a run ends after 20 min 00 s at the latest, unless --time-limit says otherwise" in told
    assert json_of(check(endless, "--json"))["estimates"][0]["time_limit_s"] == 1200.0
    assert "at the latest" not in check(GOOD).stdout


# The steps of `else` -> the least and the most that it may take (s)
@pytest.mark.parametrize(("otherwise", "least_s", "most_s"), [("", 0, 60), ("else: [{wait: {seconds: 15}}]", 15, 60)])
def test_an_if_takes_as_long_as_one_of_its_branches(write, otherwise, least_s, most_s):
    step = f"- if: battery > 0.5\n    then: [{{wait: {{seconds: 60}}}}]\n    {otherwise}\n"
    file = write(f"name: x\nworld: flat\nsteps:\n  {step}")
    (estimate,) = json_of(check(file, "--json"))["estimates"]
    assert (estimate["least_s"], estimate["most_s"]) == (least_s, most_s)
    assert estimate["reasons"] == ["battery > 0.5?"]


def test_a_sentence_is_checked_as_a_file_is():
    good = check("--say", "Hey Alice, go to the kitchen")
    assert (good.exit_code, good.stdout[:32]) == (0, "✓ Hey Alice, go to the kitchen: ")
    values = json_of(check("--say", "go to the kitchen", "--json"))
    assert (values["ok"], values["estimates"][0]["file"], len(values["commands"])) == (True, None, 1)
    assert check("--say", "go to the moon").exit_code == 2


@pytest.mark.parametrize("words", [(), (GOOD, "--say", "go to the kitchen")])
def test_either_files_or_a_sentence_is_checked(words):
    assert "name files, or give a sentence" in check(*words).stderr


def test_an_empty_sentence_is_shown_as_the_user_typed_it():
    assert errand("check", "--say", "").stdout == "✗ --say '': 1 error\n"
