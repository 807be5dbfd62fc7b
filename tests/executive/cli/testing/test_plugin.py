"""The pytest plug-in as a user's tests meet it: fixtures, and skill tests collected from YAML."""

import re
import subprocess
import sys
import textwrap
from contextlib import redirect_stdout
from io import StringIO

import pytest

from skills.api import ObjectObservation, Surface
from skills.detect.skill import Detect, DetectInputs
from skills.manipulation.posture import Stow, StowInputs
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D

OPTIONS = (
    *("-q", "-p", "no:cacheprovider", "-p", "no:warnings"),
    *("--continue-on-collection-errors", "--import-mode=importlib"),
)


def write(folder, **files):
    """Writes files of the given texts; returns the words of a call of pytest for them."""
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(textwrap.dedent(text))
    return [*OPTIONS, "--rootdir", str(folder), str(folder)]


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    """What pytest says of skill tests, one file broken, and a conftest with a fault and a skill of its own."""
    words = write(
        tmp_path_factory.mktemp("skill_tests"),
        conftest__py="""\
        import sys
        from pathlib import Path

        from skills.faults.fault_kinds import Effect, FaultKind

        sys.path.insert(0, str(Path(__file__).parent))

        def pytest_errand_skill_tests(settings):
            from crashing import Wave

            settings.skills["wave"] = Wave

            def effect(match):
                def act(call):
                    raise OSError("the moon is full")
                return Effect(frozenset(("joints",)), act)
            settings.fault_kinds.append(FaultKind("full moon", "full moon", "odd things happen", effect))
        """,
        stow__skilltest__yaml="""\
        skill: stow
        tests:
          - name: stowed already
            expect: {outcome: success}
          - name: hopeful
            faults: [arm refuses]
            robot: {arm: [0.4, -1.6, 1.6, 0.0, 0.4, 0.0]}
            expect: {outcome: success}
        """,
        broken__skilltest__yaml="skill: stow\ntests:\n  - nam: x\n    expect: {outcome: success}\n",
        moon__skilltest__yaml="""\
        skill: stow
        tests:
          - {name: moon, faults: [full moon], expect: {outcome: failure, cause: ERROR, message: the moon is full}}
        """,
        walk__skilltest__yaml="""\
        skill: navigate
        robot: {kind: plant}
        with: {goal: {x: -0.3, y: 0.0}}
        tests:
          - {name: it loses the robot, faults: [robot dies at 0.3 s], expect: {outcome: failure}}
        """,
        crashing__py="""\
        from dataclasses import dataclass

        from skills.api import Skill


        @dataclass(frozen=True)
        class Nothing:
            \"""No inputs.\"""


        class Wave(Skill[Nothing]):
            \"""Waves.\"""

            name = "wave"
            Inputs = Nothing

            def begin(self, inputs):
                self.times = 0

            def step(self):
                return 1 / self.times
        """,
        wave__skilltest__yaml="""\
        skill: wave
        suite: true
        tests:
          - {name: it waves, expect: {outcome: success}}
          - {name: its driver fails, faults: [stop raises], expect: {outcome: failure, cause: ERROR}}
        """,
        test_wave__py="""\
        from crashing import Nothing, Wave

        def test_it_waves(skill_bench):
            assert skill_bench.run(Wave, Nothing()).outcome == "success"
        """,
    )
    with redirect_stdout(StringIO()) as shown, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", sys.path.copy())
        pytest.main(words)
        patch.delitem(sys.modules, "crashing")
    return shown.getvalue()


def test_skill_tests_are_collected_by_name_and_fail_with_line_and_messages(output):
    assert "stow.skilltest.yaml:5: skill 'stow'" in output
    assert "expected success, got failure EXECUTION" in output
    assert "Traceback" not in output.partition("_ hopeful _")[2].partition("\n____")[0]


def test_a_broken_file_is_one_error_with_its_line(output):
    assert "broken.skilltest.yaml:3: unknown key 'nam'" in output


def test_tests_in_the_plant_and_with_faults_of_a_conftest_pass(output):
    assert "4 failed, 6 passed, 1 error" in output, output


def test_tests_that_use_nothing_of_it_load_nothing_heavy(tmp_path):
    words = write(
        tmp_path,
        test_light__py="""\
        import sys

        def test_light():
            assert not {"pydrake", "numpy", "pydantic"} & set(sys.modules)
        """,
    )
    done = subprocess.run([sys.executable, "-m", "pytest", *words], capture_output=True, text=True, timeout=120)
    assert "1 passed" in done.stdout, done.stdout


def test_the_bench_runs_a_skill_with_faults(skill_bench, scripted_robot, virtual_clock):
    skill_bench.inject("lease taken at 1 s")
    run = skill_bench.run(Navigate, NavigateInputs(Pose2D(-1.0, -1.0, 0.0)))
    assert (run.outcome, run.cause.value) == ("failure", "EXECUTION")
    assert virtual_clock.now() == pytest.approx(run.time_s)
    assert scripted_robot.lease_holder().holder == "the tablet"


def test_a_context_can_be_made_for_a_robot(skill_context, make_scripted_robot):
    robot = make_scripted_robot(name="Bob")
    context = skill_context(robot)
    assert (context.robot.name, context.pose()) == ("Bob", Pose2D(0.0, 0.0, 0.0))
    skill = Stow(context)
    skill.begin(StowInputs())
    assert skill.step() is not None


def test_the_small_plant_has_a_robot_a_table_and_a_can(small_plant):
    table = small_plant.world.surfaces["table"]
    surface = Surface(table.name, table.polygon_W, table.height_m)
    bench = small_plant.bench
    there = bench.run(Navigate, NavigateInputs(Pose2D(0.35, 0.0, 0.0)))
    assert there.outcome == "success", there.message
    seen = bench.run(Detect, DetectInputs(("coke",), (surface,)))
    assert seen.outcome == "success", seen.message
    observation = seen.outputs["observation"]
    assert isinstance(observation, ObjectObservation)
    assert observation.position_W[2] == pytest.approx(0.81, abs=0.03)


def test_a_skill_that_crashes_shows_its_traceback_with_the_line(output):
    reports = re.split(r"^_{3,} (.*) _{3,}$", output, flags=re.MULTILINE)
    said = dict(zip(reports[1::2], reports[2::2], strict=True))
    crashed = ("it waves", "it waves: cancelled at every tick", "test_it_waves")
    assert {*crashed, "hopeful", "ERROR collecting broken.skilltest.yaml"} == said.keys(), output
    for report in map(said.get, crashed):
        assert re.search(r'crashing.py", line 21, in step\s+return 1 / self.times', report), report
        assert "ZeroDivisionError: division by zero" in report
