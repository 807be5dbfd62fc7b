"""Policies of steps in mission files."""

import pytest

from executive.mission.load import load_mission
from executive.words.step import Guards, OnFailure, OperatorQuestion, StaleData
from skills.inputs.errors import InputError

GOOD = """\
name: round
timeout: 600
each: {retries: 1, on_failure: skip}
steps:
  - to: kitchen
    timeout: 20
    guards: {battery: 0.3, localised: true, time: 300, stale: fail}
  - say: go to the hall
    on_failure: ask
    retries: 0
    question: {text: "What now?", limit: 9, default: skip}
  - skill: navigate
    with: {x: 5.2, y: 4.5}
"""


@pytest.fixture
def load(write):
    return lambda text: load_mission(write(text))


def test_a_steps_policy_is_its_own_and_else_that_of_each(load):
    file = load(GOOD)
    first, second, third = (step.with_policy(file.each) for step in file.steps)
    assert first.guards == Guards(battery=0.3, localised=True, time_s=300.0, stale=StaleData.FAIL)
    assert (first.timeout_s, first.further_attempts, first.on_failure) == (20.0, 1, OnFailure.SKIP)
    assert second.question == OperatorQuestion(text="What now?", limit_s=9.0, default="skip")
    assert (second.timeout_s, second.further_attempts, second.on_failure) == (None, 0, OnFailure.ASK)
    assert (third.timeout_s, third.further_attempts, third.on_failure) == (None, 1, OnFailure.SKIP)
    assert (file.timeout_s, file.further_attempts, file.on_failure) == (600.0, 0, None)


def test_on_failure_retry_is_one_retry_unless_said(load):
    steps = load("name: x\nsteps: [{to: hall, on_failure: retry}, {to: hall, on_failure: retry, retries: 3}]\n").steps
    assert [step.further_attempts for step in steps] == [1, 3]


def test_moving_aside_is_allowed_for_a_step_or_for_each(load):
    file = load("name: x\neach: {move_aside: 1}\nsteps: [{to: hall}, {to: hall, move_aside: 0}]\n")
    assert [step.with_policy(file.each).move_aside for step in file.steps] == [1, 0]


def test_all_errors_are_reported_together(load):
    with pytest.raises(InputError) as error:
        load("name: 3\ntimeout: 0\nsteps:\n  - {too: hall}\n  - {do: juggle, object: coke}\n")
    assert [one.line for one in (error.value, *error.value.others)] == [4, 1, 2, 5]
