"""Conditions that look: each time that one is asked the robot looks again, so that it sees what changed meanwhile."""

from dataclasses import replace

import pytest

from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.mission import Mission
from skills.api import Cause, Failed, Succeeded
from tests.tables import yaml_beside

TABLE = yaml_beside(__file__, "looks_again.yaml")
CASES, BRANCH, WAIT = TABLE["cases"], TABLE["steps"]["branch"], TABLE["steps"]["wait"]
BEER = BRANCH["if"]


@pytest.fixture
def there():
    """What each look is to see, in order; it is used up."""
    return []


@pytest.fixture
def run_steps(knowledge, registry, run_tree, make, script, there):
    """Runs steps until all looks are used up; the result, and how often the branches for yes and no were taken."""

    def seen(skill):
        if not there.pop(0):
            return Failed(Cause.POSTCONDITION, "not seen")
        apart = replace(make.COKE, position_W=(1.5, 2.0, 0.9))
        return Succeeded("seen", {"observation": make.COKE, "observations": (make.COKE, apart), "unexplained": ()})

    script.ends["detect"] = script.ends["find_people"] = seen
    script.ends["fails"] = lambda skill: Failed(Cause.EXECUTION, "no")
    registry["fails"] = make.scripted_skill(script, "fails", *make.PORTS["stow"])

    def run_them(*steps, times=1, looks):
        there.extend(letter == "Y" for letter in looks)
        rounds = {"repeat": {"times": times}, "steps": steps} if times > 1 else steps[0]
        mission = Mission.model_validate({"name": "m", "robot": "Alice", "steps": [rounds]})
        result = run_tree(compile_mission(mission, knowledge=knowledge, registry=registry)).robots[0]
        assert (result.outcome, there) == (Outcome.SUCCESS, []), result.message
        return result, (script.begun.count("back_off"), script.begun.count("relocalise"))

    return run_them


@pytest.mark.parametrize(("step", "seen", "yes", "no"), CASES.values(), ids=CASES)
def test_a_condition_looks_each_time_that_it_is_asked(run_steps, step, seen, yes, no):
    result, taken = run_steps(step, looks=seen)
    assert taken == (yes, no)
    found = [finding for finding in result.findings if "/look-" in finding.path_id]
    assert "".join("Y" if finding.answer else "N" for finding in found) == seen


def test_each_look_leaves_its_answer_with_its_time(run_steps):
    result, _ = run_steps(BRANCH, times=2, looks="NY")
    first, second = result.findings
    assert (first.answer, second.answer) == (False, True)
    assert first.path_id == second.path_id
    assert first.t_s < second.t_s


def test_a_handler_that_is_called_twice_looks_twice(run_steps):
    called, quiet = {"set": {"n": 1}}, {"set": {"n": 0}}
    rounds = {"repeat": {"times": 2}, "steps": [called, WAIT, quiet, WAIT]}
    group = {"group": [rounds], "when": [{"if": "n > 0", "do": [BRANCH], "times": 5}]}
    assert run_steps({"group": [quiet, group]}, looks="YN")[1] == (1, 1)


# How old an answer may be.


def branch_of(condition):
    return {**BRANCH, "if": condition}


@pytest.mark.parametrize(("max_age_s", "looks"), [(0.0, "YYY"), (0.1, "YYY"), (60.0, "Y")])
def test_an_answer_that_is_recent_enough_is_not_asked_for_again(run_steps, script, max_age_s, looks):
    _, (yes, _) = run_steps(branch_of({**BEER, "max_age_s": max_age_s}), times=3, looks=looks)
    assert (script.begun.count("detect"), yes) == (len(looks), 3)


def test_an_answer_that_is_too_old_is_asked_for_again(run_steps):
    choose = branch_of({**BEER, "max_age_s": 5.0})
    assert run_steps(choose, {"wait": {"seconds": 3}}, times=3, looks="YN")[1] == (2, 1)


def test_a_check_may_give_a_recent_answer(run_steps):
    result, _ = run_steps({"check": {**BEER, "max_age_s": 60.0}}, times=2, looks="Y")
    assert [finding.answer for finding in result.findings if "/look-" not in finding.path_id] == [True, True]


def test_of_two_looks_only_the_one_that_is_too_old_is_taken(run_steps):
    assert run_steps(branch_of({"all": [{**BEER, "max_age_s": 60.0}, BEER]}), times=2, looks="YYY")[1][0] == 2
