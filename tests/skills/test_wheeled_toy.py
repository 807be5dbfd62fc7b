"""Every skill runs, with its suite, on a robot that is not Spot."""

import functools
from dataclasses import replace

import pytest
from wheeled_toy import TOY

from executive.testing.skill_suite import PARTS, SuiteCase
from executive.testing.skill_test import bench_of_setup, carry_out, load_skill_tests, scripted_maker
from skills.faults.fault_kinds import STANDARD_FAULTS
from skills.robot import BaseKind
from tests.project import NEEDS_FIGURES, project_skills, skill_tests

SKILLS = {name: skill for name, skill in project_skills().items() if name not in NEEDS_FIGURES}
DRIVING = ("navigate", "approach", "back_off", "place", "hand_over", "relocalise", "find_people")


def well(name):
    """The tests of a skill in which all goes well, with their indices."""
    file = load_skill_tests(skill_tests(name), SKILLS, [*STANDARD_FAULTS])
    return file, [n for n, test in enumerate(file.tests) if test.expect.outcome == "success" and not test.faults]


@pytest.mark.parametrize("name", sorted(SKILLS))
def test_skill_tests_that_pass_with_spot_pass_with_the_toy(name):
    assert differences(name, TOY) == []


@pytest.mark.parametrize("name", DRIVING)
def test_and_with_one_that_cannot_go_sideways(name):
    """The scripted robot refuses to go sideways then."""
    assert differences(name, replace(TOY, base_kind=BaseKind.DIFFERENTIAL)) == []


def differences(name, capabilities):
    """What differs from the expected in the tests of a skill in which all goes well."""
    file, indices = well(name)
    assert indices
    trials = [carry_out(file, n, SKILLS[name], {"scripted": scripted_maker(capabilities)}) for n in indices]
    return [trial.report() for trial in trials if trial.differences]


@functools.cache
def case_of(name):
    """The suite's case of a skill on the toy; what goes well is run once for all parts."""
    file, (n, *_) = well(name)
    test = file.tests[n]
    make = functools.partial(bench_of_setup, TOY, test.robot or file.robot, test.world or file.world)
    return SuiteCase(SKILLS[name], file.inputs(n, SKILLS[name]), make, samples=3)


LONG = ("approach", "follow_person", "grasp", "guide_person", "hand_over", "meet_person", "navigate")
"""Those of `place` are like them: it drives, looks, and moves the arm and the gripper."""


@pytest.mark.parametrize("part", sorted(PARTS))
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * (name in LONG)) for name in sorted(SKILLS)]
)
def test_the_suite_of_every_skill(name, part):
    """With fewer samples than Spot's own suites take: it is the robot that is new here."""
    assert list(PARTS[part](case_of(name))) == []
