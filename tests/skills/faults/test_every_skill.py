"""Each kind of fault with each skill: the skill succeeds after waiting, or fails with the cause of the table.

Each skill does what the first test of its file says; the fault begins soon after it, and lasts 3 s where it may pass.
"""

from pathlib import Path

import pytest

from executive.testing.skill_test import carry_out, load_skill_tests, scripted_maker
from executive.tree.registry import built_in_skills
from skills.api import Cause
from skills.faults.fault_kinds import STANDARD_FAULTS
from skills.faults.faulty_robot import parse_fault

FOLDER = Path(__file__).parents[1]
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


@pytest.fixture(scope="module")
def skills():
    return built_in_skills()


def test_every_kind_of_fault_is_in_the_table():
    kinds = {kind.pattern for kind in STANDARD_FAULTS}
    assert {kind.pattern for kind in STANDARD_FAULTS for words in FAULTS if _is_kind(words, kind)} == kinds


def _is_kind(words, kind):
    try:
        return bool(parse_fault(words, [kind]))
    except ValueError:
        return False


@pytest.mark.parametrize("name", [*TABLE, *(pytest.param(name, marks=pytest.mark.nightly) for name in NIGHTLY)])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_skill_waits_a_fault_out_or_fails_with_its_cause(skills, robot_capabilities, name, fault):
    (path,) = FOLDER.rglob(f"{name}.skilltest.yaml")
    file = load_skill_tests(path, skills)
    first = next(test for test in file.tests if test.expect.outcome == "success" and not test.faults)
    index = file.tests.index(first)
    tests = list(file.tests)
    tests[index] = first.model_copy(update={"faults": (fault,)})
    makers = {"scripted": scripted_maker(robot_capabilities)}
    run = carry_out(file.model_copy(update={"tests": tuple(tests)}), index, skills[name], makers).run
    failures = {**TABLE, **NIGHTLY}[name]
    expected = next((cause for words, cause in failures.items() if fault.startswith(words)), None)
    assert (run.outcome, run.cause) == ("failure" if expected else "success", expected), run.message
    assert run.time_s < 60.0
