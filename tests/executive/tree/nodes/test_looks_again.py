"""Conditions that look: each time that one is asked the robot looks again, so that it sees what changed meanwhile."""

from dataclasses import replace

import pytest

from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import AllOf, AnyOf, Look, Not, ValueIs
from executive.words.leaf_steps import Awaited, CallSkill, Check, Set, Wait
from executive.words.mission import Mission
from executive.words.policy import Policy
from executive.words.steps import Choose, Group, Handler, Loop, Repeat, Together, Try
from skills.api import Cause, Failed, Succeeded

BEER = Look.from_command(parse_command("Take [Nothing] to [shelf] and do [find] to [beer]"))
COUNTED = Look.from_command(parse_command("Take [Nothing] to [shelf] and do [find] to [2 beer]"))
SOMEBODY = Look.from_command(parse_command("Take [Nothing] to [hall] and do [find] to [person]"))
HOLDING = ValueIs(text="holding")


def block(made, policy=None):
    return made.with_policy(policy)


def do(name):
    return CallSkill(skill=name)


def put(n):
    return block(Set(set={"n": str(n)}))


def times(n, *steps):
    return block(Repeat(loop=Loop(times=n), steps=steps))


MARK, OTHER, FAILS = do("back_off"), do("relocalise"), do("fails")
BRANCH = block(Choose(condition=BEER, then=(MARK,), otherwise=(OTHER,)))
WAIT = block(Wait(awaited=Awaited(seconds=0.1)))

# What is looked for is there, or is not, at each look; and how often each branch is taken.
#
#   construct                                   there at each look    yes  no
TABLE = {
    "wait for": (block(Wait(awaited=Awaited(condition=BEER, every_s=1.0))), "NNY", 0, 0),
    "wait for its end": (block(Wait(awaited=Awaited(condition=Not(part=BEER), every_s=1.0))), "YYN", 0, 0),
    "repeat until": (block(Repeat(loop=Loop(until=BEER), steps=(MARK,))), "NNY", 3, 0),
    "repeat until it is gone": (block(Repeat(loop=Loop(until=Not(part=BEER)), steps=(MARK,))), "YYN", 3, 0),
    "repeat while": (block(Repeat(loop=Loop(while_=BEER), steps=(MARK,))), "YYN", 2, 0),
    "repeat every": (block(Repeat(loop=Loop(until=BEER, every_s=2.0), steps=(MARK,))), "NY", 2, 0),
    "if in repeat": (times(3, BRANCH), "YNY", 2, 1),
    "check in repeat": (times(3, block(Check(condition=BEER))), "YNY", 0, 0),
    "check of two in repeat": (times(2, block(Check(condition=AllOf(parts=(BEER, Not(part=HOLDING)))))), "YN", 0, 0),
    "check, then if": (times(2, block(Check(condition=BEER)), BRANCH), "YNNY", 1, 1),
    "its answer as a name": (
        times(
            2,
            block(Check(condition=BEER, gives={"answer": "beer"})),
            block(Choose(condition=ValueIs(text="beer"), then=(MARK,), otherwise=(OTHER,))),
        ),
        "NY",
        1,
        1,
    ),
    "one of two looks": (
        times(2, block(Choose(condition=AnyOf(parts=(BEER, BEER)), then=(MARK,), otherwise=(OTHER,)))),
        "NYNN",
        1,
        1,
    ),
    "a count": (times(2, block(Choose(condition=COUNTED, then=(MARK,), otherwise=(OTHER,)))), "YN", 1, 1),
    "a person": (times(2, block(Choose(condition=SOMEBODY, then=(MARK,), otherwise=(OTHER,)))), "NY", 1, 1),
    "try in repeat": (
        times(
            2, block(Try(steps=(block(Choose(condition=BEER, then=(FAILS,), otherwise=(OTHER,))),), otherwise=(MARK,)))
        ),
        "YN",
        1,
        1,
    ),
    "if in else": (times(2, block(Try(steps=(FAILS,), otherwise=(BRANCH,)))), "YN", 1, 1),
    "group in repeat": (times(2, block(Group(steps=(BRANCH,)))), "NY", 1, 1),
    "always in repeat": (times(2, block(Group(steps=(WAIT,), always=(BRANCH,)))), "NY", 1, 1),
    "together in repeat": (times(2, block(Together(steps=(BRANCH, WAIT)))), "YN", 1, 1),
    "each of several": (block(Group(steps=(block(Group(steps=(BRANCH,))), block(Group(steps=(BRANCH,)))))), "YN", 1, 1),
    "repeat in repeat": (times(2, times(2, BRANCH)), "YNNY", 2, 2),
    "retries": (block(Choose(condition=BEER, then=(FAILS,), otherwise=(OTHER,)), policy=Policy(retries=2)), "YN", 0, 1),
}


@pytest.fixture
def there():
    """What each look is to see, in order; it is used up."""
    return []


@pytest.fixture
def run_steps(knowledge, registry, run_tree, make, script, there):
    def seen(skill):
        if not there.pop(0):
            return Failed(Cause.POSTCONDITION, "not seen")
        apart = replace(make.COKE, position_W=(1.5, 2.0, 0.9))
        return Succeeded("seen", {"observation": make.COKE, "observations": (make.COKE, apart)})

    script.ends["detect"] = script.ends["find_people"] = seen
    script.ends["fails"] = lambda skill: Failed(Cause.EXECUTION, "no")
    registry["fails"] = make.scripted_skill(script, "fails", *make.PORTS["stow"])

    def run_them(*steps):
        mission = Mission(name="m", robot="Alice", steps=steps)
        result = run_tree(compile_mission(mission, knowledge=knowledge, registry=registry)).robots[0]
        assert result.outcome is Outcome.SUCCESS, result.message
        return result

    return run_them


@pytest.mark.parametrize(("step", "seen", "yes", "no"), TABLE.values(), ids=TABLE)
def test_a_condition_looks_each_time_that_it_is_asked(run_steps, script, there, step, seen, yes, no):
    there += [letter == "Y" for letter in seen]
    result = run_steps(step)
    assert there == []
    assert (script.begun.count("back_off"), script.begun.count("relocalise")) == (yes, no)
    found = [finding for finding in result.findings if "/look-" in finding.path_id]
    assert "".join("Y" if finding.answer else "N" for finding in found) == seen


def test_each_look_leaves_its_answer_with_its_time(run_steps, there):
    there += [False, True]
    findings = run_steps(times(2, BRANCH)).findings
    assert [finding.answer for finding in findings] == [False, True]
    assert findings[0].path_id == findings[1].path_id
    assert findings[0].t_s < findings[1].t_s


def test_a_handler_that_is_called_twice_looks_twice(run_steps, script, there):
    there += [True, False]
    called = Handler(condition=ValueIs(text="n > 0"), steps=(BRANCH,), times=5)
    run_steps(put(0), block(Group(steps=(times(2, put(1), WAIT, put(0), WAIT),), when=(called,))))
    assert there == []
    assert (script.begun.count("back_off"), script.begun.count("relocalise")) == (1, 1)


# How old an answer may be.


def aged(condition, max_age_s):
    return condition.model_copy(update={"max_age_s": max_age_s})


@pytest.mark.parametrize(("max_age_s", "looks"), [(0.0, 3), (0.1, 3), (60.0, 1)])
def test_an_answer_that_is_recent_enough_is_not_asked_for_again(run_steps, script, there, max_age_s, looks):
    there += [True] * looks
    run_steps(times(3, block(Choose(condition=aged(BEER, max_age_s), then=(MARK,), otherwise=(OTHER,)))))
    assert (there, script.begun.count("detect"), script.begun.count("back_off")) == ([], looks, 3)


def test_an_answer_that_is_too_old_is_asked_for_again(run_steps, script, there):
    there += [True, False]
    choose = block(Choose(condition=aged(BEER, 5.0), then=(MARK,), otherwise=(OTHER,)))
    run_steps(times(3, choose, block(Wait(awaited=Awaited(seconds=3.0)))))
    assert (there, script.begun.count("back_off"), script.begun.count("relocalise")) == ([], 2, 1)


def test_a_check_may_give_a_recent_answer(run_steps, there):
    there += [True]
    result = run_steps(times(2, block(Check(condition=aged(BEER, 60.0)))))
    assert [finding.answer for finding in result.findings if "/look-" not in finding.path_id] == [True, True]


def test_of_two_looks_only_the_one_that_is_too_old_is_taken(run_steps, script, there):
    there += [True, True, True]
    run_steps(
        times(2, block(Choose(condition=AllOf(parts=(aged(BEER, 60.0), BEER)), then=(MARK,), otherwise=(OTHER,))))
    )
    assert (there, script.begun.count("back_off")) == ([], 2)
