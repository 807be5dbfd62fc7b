"""Each kind of fault with each skill: the skill succeeds after waiting, or fails with the cause of the table.

Each skill does what the first test of its file says; the fault begins soon after it, and lasts 3 s where it may pass.
"""

import re
from functools import cache

import pytest

from executive.testing.skill_test import bench_of_setup, load_skill_tests
from skills.api import Cause
from skills.faults.fault_kinds import STANDARD_FAULTS, Effect
from skills.faults.faulty_robot import Fault, parse_fault
from skills.robot_wrapper import VERBS
from tests.project import project_skills, skill_tests

PARTS = ("arm", "base", "body", "set_gripper")
FAULTS = (
    "sensors freezes 3 s at 0.2 s",
    "camera: dropout 3 s at 0.2 s",
    "joints raises at 0.2 s",
    *(f"{part} refuses 3 s at 0.2 s" for part in PARTS),
    *(f"{part} never ends 3 s at 0.2 s" for part in PARTS),
    *(f"{part} is stopped 3 s at 0.2 s" for part in PARTS),
    "gripper reports holding nothing 3 s at 0.2 s",
    "gripper loses it at 0.2 s",
    "image returns no depth 3 s at 0.2 s",
    "camera is black 3 s at 0.2 s",
    "scan is missing 3 s at 0.2 s",
    "joints returns garbage 3 s at 0.2 s",
    "hand is pulled with 15 N 3 s at 0.2 s",
    "odometry jumps 0.1 m at 0.2 s",
    "battery falls to 5 % at 0.2 s",
    "robot reports motor too hot 3 s at 0.2 s",
    "robot dies at 0.2 s",
    "lease taken at 0.2 s",
)

# What each skill does not live through, by the first words of the fault; all else ends well.
FREEZES, RAISES, DIES, LEASE = "sensors freezes", "joints raises", "robot dies", "lease taken"
ARM = {RAISES: Cause.ERROR, DIES: Cause.ERROR, LEASE: Cause.EXECUTION}
TABLE = {
    "back_off": {DIES: Cause.ERROR, LEASE: Cause.EXECUTION},
    "charge": {DIES: Cause.ERROR, "battery falls": Cause.POSTCONDITION},
    "check_door": {DIES: Cause.ERROR},
    "clear_costmap": {},
    "locate_dock": {DIES: Cause.ERROR},
    "navigate": {RAISES: Cause.ERROR, DIES: Cause.ERROR, LEASE: Cause.PRECONDITION},
    "pose_arm": ARM,
    "relocalise": {DIES: Cause.PRECONDITION},
    "speak": {},
    "stow": ARM,
}
HANDS = {RAISES: Cause.ERROR, "joints returns garbage": Cause.EXECUTION, DIES: Cause.ERROR, LEASE: Cause.EXECUTION}
LOST = {"gripper reports": Cause.POSTCONDITION, "gripper loses": Cause.POSTCONDITION}
NIGHTLY = {
    "approach": HANDS,
    "detect": {**HANDS, FREEZES: Cause.EXECUTION},
    "grasp": {**HANDS, FREEZES: Cause.EXECUTION, "gripper loses": Cause.POSTCONDITION},
    "place": {**HANDS, **LOST, "odometry jumps": Cause.POSTCONDITION},  # nothing corrects it here: it looks beside it
    "follow_person": {DIES: Cause.ERROR},
    "find_people": {DIES: Cause.ERROR, LEASE: Cause.EXECUTION},
    "hand_over": {**HANDS, **LOST, "arm never ends": Cause.TIMEOUT},  # the person pulls before it is held out
}


SKILLS = project_skills()


@cache
def file_of(name):
    """A skill's file of tests, and the index of the first in which all goes well."""
    file = load_skill_tests(skill_tests(name), SKILLS)
    return file, next(n for n, test in enumerate(file.tests) if test.expect.outcome == "success" and not test.faults)


def run_with(name, capabilities, fault):
    """Outcome and cause of that test with a fault."""
    file, n = file_of(name)
    bench, _ = bench_of_setup(capabilities, file.tests[n].robot or file.robot, file.tests[n].world or file.world)
    bench.add_faults(fault)
    run = bench.run(SKILLS[name], file.inputs(n, SKILLS[name]))
    assert run.time_s < 60.0
    return run.outcome, run.cause


def test_every_kind_of_fault_is_in_the_table():
    said = [words.partition(" at ")[0].removesuffix(" 3 s").replace(": ", " ") for words in FAULTS]
    assert all(any(re.fullmatch(kind.pattern, words) for words in said) for kind in STANDARD_FAULTS)


@pytest.mark.parametrize("name", [*TABLE, *(pytest.param(name, marks=pytest.mark.nightly) for name in NIGHTLY)])
def test_a_skill_waits_a_fault_out_or_fails_with_its_cause(robot_capabilities, name):
    """A fault of verbs that the skill does not call changes nothing, and needs no run of its own."""
    called, failures = set(), {**TABLE, **NIGHTLY}[name]
    notes = Effect(frozenset(VERBS), lambda call: called.add(call.verb) or call.proceed())
    untouched = run_with(name, robot_capabilities, Fault("nothing", notes))
    ends, expected = {}, {}
    for words in FAULTS:
        fault = parse_fault(words)
        reached = called & (fault.effect.verbs | fault.effect.always)
        ends[words] = run_with(name, robot_capabilities, fault) if reached else untouched
        cause = next((cause for start, cause in failures.items() if words.startswith(start)), None)
        expected[words] = ("failure" if cause else "success", cause)
    assert ends == expected
