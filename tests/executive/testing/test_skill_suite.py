"""The suite for every skill finds skills that break its rules, and lets good ones pass."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import pytest

from executive.testing.bench import scripted_bench
from executive.testing.skill_suite import (
    PARTS,
    SkillSuite,
    SuiteCase,
    cancelled_at_every_tick,
    exception_in_every_verb,
    stale_sensors,
)
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Failed, Running, Skill, Succeeded
from skills.testing.robot import BASE_ONLY


@dataclass(frozen=True)
class CreepInputs:
    seconds: float = 1.0


class Creep(Skill[CreepInputs]):
    """Creeps ahead for a while."""

    name = "creep"
    Inputs = CreepInputs
    causes: ClassVar[Mapping[Cause, str]] = {Cause.EXECUTION: "never"}
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.3}

    def begin(self, inputs):
        self.command = None
        self.end_s = self.context.clock.now() + inputs.seconds

    def step(self):
        context = self.context
        context.robot.odometry()
        if context.clock.now() >= self.end_s:
            return Succeeded("crept")
        self.command = context.robot.drive(0.1, 0.0, 0.0, until_s=context.clock.now() + 1.0, lease=context.lease)
        return Running("creeping")

    def end(self):
        command, self.command = self.command, None
        if command is not None:
            self.context.robot.stop(lease=self.context.lease, only=command)


class Runaway(Creep):
    """Never stops."""

    def end(self):
        pass


class Fussy(Creep):
    """Cannot be ended twice."""

    def end(self):
        if self.command is None:
            raise RuntimeError("ended already")
        super().end()


class Careless(Creep):
    """Takes every exception for a failed execution."""

    def step(self):
        try:
            return super().step()
        except Exception as defect:
            return Failed(Cause.EXECUTION, str(defect))


class Blind(Creep):
    """Declares nothing about the age of what it senses."""

    max_data_age_s: ClassVar[Mapping[str, float]] = {}


class Generous(Creep):
    """Declares the IMU, which it does not look at, and believes in an old odometry."""

    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 30.0}


class Lost(Creep):
    """Never succeeds."""

    def step(self):
        return Failed(Cause.PLANNING, "no idea")


def case_of(skill):
    return SuiteCase(skill, CreepInputs(), partial(scripted_bench, BASE_ONLY))


class TestCreep(SkillSuite):
    """The suite as a user writes it."""

    skill = Creep
    inputs = CreepInputs(0.5)


def test_a_good_skill_gives_no_findings():
    assert [found for part in PARTS.values() for found in part(case_of(Creep))] == []


def test_motion_that_outlives_a_cancel_is_found():
    found = list(cancelled_at_every_tick(case_of(Runaway)))
    assert "cancelled at tick 1: drive still under way 0.2 s later" in found


def test_an_end_that_cannot_be_repeated_is_found():
    assert any("a second end raises RuntimeError" in each for each in cancelled_at_every_tick(case_of(Fussy)))


def test_a_swallowed_exception_is_found():
    found = list(exception_in_every_verb(case_of(Careless)))
    assert any(each.startswith("drive raises after 0 calls: it ends with failure Cause.EXECUTION") for each in found)


def test_a_skill_that_senses_must_declare_how_old_its_data_may_be():
    assert list(stale_sensors(case_of(Blind))) == ["it uses odometry and declares no max_data_age_s"]


class Looks(Blind):
    """Reads pictures only, which carry their own stamps."""

    def begin(self, inputs):
        self._looked = 0

    def step(self):
        self._looked += 1
        picture = self.context.robot.image("hand")
        return Succeeded(f"seen at {picture.stamp_s}") if self._looked > 5 else Running("looking")

    def end(self, outcome):
        """Moves nothing."""


def test_a_skill_that_reads_only_pictures_need_not_declare_an_age():
    assert list(stale_sensors(SuiteCase(Looks, CreepInputs(), partial(scripted_bench, spot_capabilities())))) == []


def test_a_success_on_frozen_sensors_is_found_when_the_leaf_does_not_catch_it(monkeypatch):
    monkeypatch.setattr("executive.tree.nodes.skill_leaf.refuse_stale", lambda skill, success, context: success)
    found = list(stale_sensors(case_of(Creep)))
    assert any("it claims success" in each for each in found)


def test_the_leaf_refuses_a_success_on_data_older_than_declared():
    bench, _ = scripted_bench(BASE_ONLY)
    bench.inject("odometry freezes at 0.2 s")
    run = bench.run(Creep, CreepInputs())
    assert (run.outcome, run.cause) == ("failure", Cause.POSTCONDITION)
    assert run.message == "creep cannot be sure: its odometry data is 0.9 s old, more than 0.3 s"


def test_data_as_old_as_declared_is_good_enough():
    bench, _ = scripted_bench(BASE_ONLY)
    bench.inject("odometry freezes at 0.2 s")
    assert bench.run(Generous, CreepInputs()).outcome == "success"


def test_a_case_that_fails_by_itself_is_found():
    assert "the skill fails without any fault" in next(cancelled_at_every_tick(case_of(Lost)))


@pytest.mark.parametrize(("ticks", "expected"), [(5, [1, 2, 3, 4]), (100, [1, 15, 29, 43, 57, 71, 85, 99])])
def test_ticks_are_sampled_with_first_and_last(ticks, expected):
    assert case_of(Creep).sampled(ticks) == expected
