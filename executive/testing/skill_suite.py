"""Test suite that every skill must pass: cancellation at any tick, exceptions in any verb, stale sensors.

Write a class in a test file and pytest runs all of it:

    class TestWave(SkillSuite):
        skill = Wave
        inputs = WaveInputs(times=2)

Override `bench` to put the robot elsewhere. Without faults the skill must succeed. Pytest also collects files
`*.skilltest.yaml`, which may ask for the suite.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import pytest
from py_trees.common import Status

from executive.testing.bench import SkillBench, SkillRun, scripted_bench
from executive.testing.skill_test import (
    BenchMakers,
    SkillTestFile,
    bench_of_setup,
    carry_out,
    load_skill_tests,
    scripted_maker,
)
from skills.api import Cause, Skill
from skills.faults.fault_kinds import SENSE_VERBS, STANDARD_FAULTS, Call, Effect, FaultKind, InjectedFault
from skills.faults.faulty_robot import Fault
from skills.inputs.errors import InputError
from skills.robot import Capabilities
from skills.robot_wrapper import VERBS
from skills.testing.robot import ScriptedRobot

STILL_WITHIN_S = 0.2
_OWN_VERBS = ("acquire_lease", "take_lease", "return_lease", "lease_holder")


@dataclass(frozen=True)
class SuiteCase:
    """Case for the suite: a skill, inputs with which it succeeds, and a factory of benches with a scripted robot."""

    skill: type[Skill[Any]]
    inputs: Any
    bench: Callable[[], tuple[SkillBench, ScriptedRobot]]
    samples: int = 8

    @property
    def limit_s(self) -> float:
        """Time limit (s) for a run with a fault: 1.5 times the duration of the nominal run, plus 5 s."""
        return 1.5 * self.nominal[0].time_s + 5.0

    @cached_property
    def nominal(self) -> tuple[SkillRun, Counter[str]]:
        """Run without faults, and how often the skill calls each verb in it."""
        bench, _ = self.bench()
        calls: Counter[str] = Counter()

        def act(call: Call) -> Any:
            calls[call.verb] += not bench.sensing
            return call.proceed()

        bench.add_faults(Fault("nothing", Effect(frozenset(VERBS), act)))
        return bench.run(self.skill, self.inputs), calls

    def sampled(self, ticks: int) -> list[int]:
        """Returns tick numbers spread over a run, including the first and the last; all ticks if the run is short."""
        if ticks <= self.samples:
            return list(range(1, ticks))
        step = (ticks - 2) / (self.samples - 1)
        return sorted({round(1 + n * step) for n in range(self.samples)})


def cancelled_at_every_tick(case: SuiteCase) -> Iterator[str]:
    """Cancels the skill at sampled ticks; yields a sentence for each violation.

    The cause must be CANCELLED, the robot must stop within 0.2 s, and a second `end` must do nothing.
    """
    run, _ = case.nominal
    if run.outcome != "success":
        yield f"the skill fails without any fault: {run.cause} {run.message}"
        return
    for tick in case.sampled(run.ticks):
        yield from (f"cancelled at tick {tick}: {what}" for what in _cancelled(case, tick))


def _cancelled(case: SuiteCase, tick: int) -> Iterator[str]:
    bench, robot = case.bench()
    made: list[Skill[Any]] = []
    leaf = bench.leaf(_recorded(case.skill, made), case.inputs)
    for _ in range(tick):
        bench.tick(leaf)
    leaf.stop(Status.INVALID)
    if leaf.cause is not Cause.CANCELLED:
        yield f"the cause is {leaf.cause}, not CANCELLED: {leaf.message}"
    before = list(robot.calls)
    try:
        for skill in made:
            skill.end()
    except Exception as defect:
        yield f"a second end raises {type(defect).__name__}: {defect}"
    moved = sorted({call for call in robot.calls[len(before) :] if call not in (*SENSE_VERBS, "command_status")})
    if moved:
        yield f"a second end calls {', '.join(moved)}"
    bench.clock.advance(STILL_WITHIN_S)
    if robot.moving_parts:
        yield f"{', '.join(robot.moving_parts)} still under way {STILL_WITHIN_S} s later"


def exception_in_every_verb(case: SuiteCase) -> Iterator[str]:
    """Lets each verb raise at its first call and halfway; the skill must fail with ERROR, and the robot must stop."""
    _, called = case.nominal
    for verb in (verb for verb in VERBS if called[verb] and verb not in _OWN_VERBS):
        for calls in sorted({0, called[verb] // 2}):
            yield from (f"{verb} raises after {calls} calls: {what}" for what in _raising(case, verb, calls))


def _raising(case: SuiteCase, verb: str, calls: int) -> Iterator[str]:
    (bench, robot), left = case.bench(), calls
    met: list[str] = []

    def act(call: Call) -> Any:
        nonlocal left
        left -= not bench.sensing
        if bench.sensing or left >= 0:
            return call.proceed()
        met.append(call.verb)
        raise InjectedFault(f"{call.verb} does not answer")

    bench.add_faults(Fault(f"{verb} raises", Effect(frozenset((verb,)), act)))
    run = bench.run(case.skill, case.inputs, limit_s=case.limit_s)
    if met and (run.outcome, run.cause) != ("failure", Cause.ERROR):
        yield f"it ends with {run.outcome} {run.cause}: {run.message}"
    bench.close()
    bench.clock.advance(STILL_WITHIN_S)
    if robot.moving_parts:
        yield f"{', '.join(robot.moving_parts)} still under way {STILL_WITHIN_S} s after the end"


def stale_sensors(case: SuiteCase) -> Iterator[str]:
    """Freezes all sensors at sampled ticks; the skill must not succeed on data older than it declares."""
    run, called = case.nominal
    sensed = [verb for verb in SENSE_VERBS if called[verb] and verb != "image"]  # a picture has a stamp of its own
    declared = case.skill.max_data_age_s
    if sensed and not declared:
        yield f"it uses {', '.join(sensed)} and declares no max_data_age_s"
        return
    for tick in case.sampled(run.ticks):
        frozen_s = tick * run.time_s / run.ticks
        bench, _ = case.bench()
        bench.inject(f"sensors freezes at {frozen_s:.3f} s")
        ended = bench.run(case.skill, case.inputs, limit_s=case.limit_s)
        age_s = ended.time_s - frozen_s
        if ended.outcome == "success" and age_s > min(declared.values(), default=age_s) + 0.1:
            yield f"sensors frozen at {frozen_s:.2f} s, and it claims success {age_s:.2f} s later: {ended.message}"


def _recorded(skill: type[Skill[Any]], made: list[Skill[Any]]) -> type[Skill[Any]]:
    """Returns a subclass of the skill that appends each of its instances to `made`."""

    def init(self: Any, *arguments: Any, **options: Any) -> None:
        skill.__init__(self, *arguments, **options)
        made.append(self)

    return type(skill.__name__, (skill,), {"__init__": init, "__doc__": skill.__doc__})


PARTS: dict[str, Callable[[SuiteCase], Iterator[str]]] = {
    "cancelled at every tick": cancelled_at_every_tick,
    "exception in every verb": exception_in_every_verb,
    "stale sensors": stale_sensors,
}


class SkillSuite:
    """Base class for tests of a skill: set `skill` and `inputs`, and override `bench` if necessary."""

    skill: ClassVar[type[Skill[Any]]]
    inputs: ClassVar[Any]
    samples: ClassVar[int] = 8

    def bench(self, capabilities: Capabilities) -> tuple[SkillBench, ScriptedRobot]:
        """Returns a new bench; by default the scripted Spot stands at the origin of the room, facing the table."""
        return scripted_bench(capabilities)

    def test_it_can_be_cancelled_at_every_tick(self, robot_capabilities: Capabilities) -> None:
        """Checks that motion ends within 0.2 s and that nothing raises."""
        _raise_findings(cancelled_at_every_tick(self._case(robot_capabilities)))

    def test_an_exception_in_any_verb_is_a_failure_with_cause_error(self, robot_capabilities: Capabilities) -> None:
        """Checks that the skill fails with ERROR and that the robot is still afterwards."""
        _raise_findings(exception_in_every_verb(self._case(robot_capabilities)))

    def test_no_success_is_claimed_on_stale_data(self, robot_capabilities: Capabilities) -> None:
        """Checks that the skill claims no success on data older than it declares."""
        _raise_findings(stale_sensors(self._case(robot_capabilities)))

    def _case(self, capabilities: Capabilities) -> SuiteCase:
        return SuiteCase(self.skill, self.inputs, lambda: self.bench(capabilities), self.samples)


def _raise_findings(found: Iterable[str]) -> None:
    """Raises AssertionError with all findings, if there are any."""
    sentences = list(found)
    if sentences:
        raise AssertionError("\n".join(sentences))


class SkillTestSettings:
    """Settings of a session's skill tests; a conftest may extend `fault_kinds`, set `samples` or replace `makers`."""

    def __init__(self, skills: Mapping[str, type[Skill[Any]]], makers: BenchMakers, capabilities: Capabilities) -> None:
        self.skills, self.makers, self.capabilities = dict(skills), dict(makers), capabilities
        self.samples = SuiteCase.samples
        self.fault_kinds: list[FaultKind] = [*STANDARD_FAULTS]

    def use_robot(self, capabilities: Capabilities) -> None:
        """Gives these capabilities to the scripted robot in all tests and in the suite."""
        self.capabilities, self.makers["scripted"] = capabilities, scripted_maker(capabilities)


class SkillTestModule(pytest.File):
    """File of skill tests as a pytest collector."""

    settings: SkillTestSettings

    def collect(self) -> Iterable[pytest.Item]:
        """Collects the tests, and the suite if the file wants it. Raises CollectError with the line of an error."""
        try:
            tests = load_skill_tests(self.path, self.settings.skills, self.settings.fault_kinds)
        except InputError as error:
            raise self.CollectError(str(error)) from error
        for index, test in enumerate(tests.tests):
            yield self._item(tests, index, test.name, partial(self._carried_out, tests, index))
            if tests.suite and test.expect.outcome == "success" and not test.faults:
                case = self._case(tests, index)
                for name, part in PARTS.items():
                    yield self._item(tests, index, f"{test.name}: {name}", partial(part, case))

    def _item(self, tests: SkillTestFile, index: int, name: str, findings: Callable[[], Iterable[str]]) -> pytest.Item:
        item: SkillTestItem = SkillTestItem.from_parent(self, name=name, tests=tests, index=index, findings=findings)
        return item

    def _carried_out(self, tests: SkillTestFile, index: int) -> Iterator[str]:
        """Runs a test; yields a report if the result differs from the test's expectation."""
        settings = self.settings
        trial = carry_out(tests, index, settings.skills[tests.skill], settings.makers, settings.fault_kinds)
        if trial.differences:
            yield trial.report()

    def _case(self, tests: SkillTestFile, index: int) -> SuiteCase:
        """Returns the case that all checks of the suite use, built from a test, with a scripted robot."""
        test, skill = tests.tests[index], self.settings.skills[tests.skill]
        make = partial(bench_of_setup, self.settings.capabilities, test.robot or tests.robot, test.world or tests.world)
        return SuiteCase(skill, tests.inputs(index, skill), make, self.settings.samples)


class SkillTestItem(pytest.Item):
    """Test, or check of the suite, at a line of a file; it fails if `findings` yields a sentence."""

    def __init__(
        self, *, tests: SkillTestFile, index: int, findings: Callable[[], Iterable[str]], **options: Any
    ) -> None:
        super().__init__(**options)
        self.tests, self.index, self.findings = tests, index, findings

    def runtest(self) -> None:
        """Runs the test. Raises pytest's failure exception."""
        found = "\n".join(self.findings())
        if found:
            pytest.fail(found, pytrace=False)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Returns file, line (from 0) and name."""
        return self.path, self.tests.line(self.index) - 1, self.name

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Returns a plain report for a failed test, and a traceback for any other error."""
        if isinstance(excinfo.value, pytest.fail.Exception | InputError):
            return f"{self.path}:{self.tests.line(self.index)}: skill '{self.tests.skill}'\n{excinfo.value}"
        return super().repr_failure(excinfo, style)
