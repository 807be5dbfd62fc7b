"""Collects `*.skilltest.yaml` files for pytest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from executive.testing.skill_test import SkillTestFile, load_skill_tests
from executive.testing.suite import PARTS, SuiteCase
from executive.testing.trial import BenchMakers, bench_of_setup, carry_out
from skills.api import Skill
from skills.faults.kinds import STANDARD_FAULTS, FaultKind
from skills.files.errors import InputError
from skills.robot import Capabilities


class SkillTestSettings:
    """Settings of all skill tests of a session; a conftest may add to `fault_kinds` or replace benches in `makers`."""

    def __init__(self, skills: Mapping[str, type[Skill[Any]]], makers: BenchMakers, capabilities: Capabilities) -> None:
        self.skills, self.makers, self.capabilities = dict(skills), dict(makers), capabilities
        self.fault_kinds: list[FaultKind] = [*STANDARD_FAULTS]


class SkillTestError(Exception):
    """A skill test did not meet its expectation."""


class SkillTestModule(pytest.File):
    """One file of skill tests."""

    settings: SkillTestSettings

    def collect(self) -> Iterable[pytest.Item]:
        """The tests, and the parts of the suite if the file asks for them. A broken file is one error with its line."""
        try:
            tests = load_skill_tests(self.path, self.settings.skills, self.settings.fault_kinds)
        except InputError as error:
            raise self.CollectError(str(error)) from error
        for index, test in enumerate(tests.tests):
            yield SkillTestItem.from_parent(self, name=test.name, tests=tests, index=index)
            if tests.suite and test.expect.outcome == "success" and not test.faults:
                yield from self._suite(tests, index)

    def _suite(self, tests: SkillTestFile, index: int) -> Iterator[pytest.Item]:
        """One item for each part; they share the run in which nothing goes wrong."""
        test, skill = tests.tests[index], self.settings.skills[tests.skill]
        make = partial(bench_of_setup, self.settings.capabilities, test.robot or tests.robot, test.world or tests.world)
        case = SuiteCase(skill, tests.inputs(index, skill), make)
        for name, part in PARTS.items():
            yield SuiteItem.from_parent(
                self, name=f"{test.name}: {name}", tests=tests, index=index, findings=partial(part, case)
            )


class _Item(pytest.Item):
    """A test at one line of a file of skill tests."""

    def __init__(self, *, tests: SkillTestFile, index: int, **options: Any) -> None:
        super().__init__(**options)
        self.tests, self.index = tests, index

    @property
    def settings(self) -> SkillTestSettings:
        """The session's."""
        assert isinstance(self.parent, SkillTestModule)
        return self.parent.settings

    @property
    def skill(self) -> type[Skill[Any]]:
        """The skill that is tested."""
        return self.settings.skills[self.tests.skill]

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where it stands: file, line (from 0), name."""
        return self.path, self.tests.line(self.index) - 1, self.name

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """A plain report for a failed test, and a traceback for a defect."""
        if isinstance(excinfo.value, SkillTestError | InputError):
            return f"{self.path}:{self.tests.line(self.index)}: skill '{self.tests.skill}'\n{excinfo.value}"
        return super().repr_failure(excinfo, style)


class SkillTestItem(_Item):
    """One test."""

    def runtest(self) -> None:
        """Runs the test. Raises SkillTestError if it fails."""
        settings = self.settings
        trial = carry_out(self.tests, self.index, self.skill, settings.makers, settings.fault_kinds)
        if trial.differences:
            raise SkillTestError(trial.report())


class SuiteItem(_Item):
    """One part of the suite for every skill, with a test's ports, robot and world; the robot is a scripted one."""

    def __init__(self, *, findings: Callable[[], Iterable[str]], **options: Any) -> None:
        super().__init__(**options)
        self.findings = findings

    def runtest(self) -> None:
        """Runs the part. Raises SkillTestError if it fails."""
        found = list(self.findings())
        if found:
            raise SkillTestError("\n".join(found))
