"""Schema of mission files: refusals with line and hint, and the JSON Schema for editors."""

import json

import pytest

from executive.mission.json_schema import mission_json_schema
from executive.mission.load import load_mission
from executive.words.mission import Mission
from executive.words.policy import Guards, OnFailure, OperatorQuestion, StaleData
from skills.files.errors import InputError

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
    question: {text: What now?, limit: 9, default: skip}
  - skill: navigate
    with: {x: 5.2, y: 4.5}
"""


@pytest.fixture
def load(tmp_path):
    def load_text(text):
        (tmp_path / "mission.yaml").write_text(text, encoding="utf-8")
        return load_mission(tmp_path / "mission.yaml")

    return load_text


def test_a_steps_policy_is_its_own_and_else_that_of_each(load):
    file = load(GOOD.replace("What now?", '"What now?"'))
    first, second, third = (step.with_policy(file.each) for step in file.steps)
    assert first.guards == Guards(battery=0.3, localised=True, time_s=300.0, stale=StaleData.FAIL)
    assert (first.timeout_s, first.further_attempts, first.on_failure) == (20.0, 1, OnFailure.SKIP)
    assert second.question == OperatorQuestion(text="What now?", limit_s=9.0, default="skip")
    assert (second.timeout_s, second.further_attempts, second.on_failure) == (None, 0, OnFailure.ASK)
    assert (third.timeout_s, third.further_attempts, third.on_failure) == (None, 1, OnFailure.SKIP)
    assert (file.timeout_s, file.further_attempts, file.on_failure) == (600.0, 0, None)


def test_on_failure_retry_is_one_retry_unless_said(load):
    text = "name: x\nsteps:\n  - {to: hall, on_failure: retry}\n  - {to: hall, on_failure: retry, retries: 3}\n"
    assert [step.further_attempts for step in load(text).steps] == [1, 3]


def test_moving_aside_is_allowed_for_a_step_or_for_each(load):
    text = "name: x\neach: {move_aside: 1}\nsteps:\n  - {to: hall}\n  - {to: hall, move_aside: 0}\n"
    file = load(text)
    assert [step.with_policy(file.each).move_aside for step in file.steps] == [1, 0]


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("timeout: 600", "timeuot: 600", 2, "did you mean 'timeout'?"),
        ("timeout: 600", "timeout: 0", 2, "above 0"),
        ("timeout: 600", "timeout: soon", 2, "timeout: should be a number"),
        ("timeout: 600", "timeout: true", 2, "timeout: should be a number"),
        ("timeout: 600", "timeout: .nan", 2, "finite"),
        ("timeout: 600", "on_failure: skip", 2, "a whole mission cannot be skipped"),
        ("timeout: 600", "on_failure: ask\nquestion: {default: skip}", 3, "a whole mission cannot be skipped"),
        ("retries: 1", "retries: 1.5", 3, "each.retries: should be a whole number"),
        ("retries: 1", "retries: -1", 3, "from 0 to 100"),
        ("on_failure: skip", "on_failure: skipp", 3, "did you mean 'skip'?"),
        ("each: {", "each: {to: hall, ", 3, "unknown key 'to'"),
        ("battery: 0.3", "battery: 30", 7, "from 0 to 1; it reads 30 now; write 0.3 for 30 %"),
        ("battery: 0.3", "batery: 0.3", 7, "did you mean 'battery'?"),
        ("localised: true", 'localised: "yes"', 7, "guards.localised: should be true or false"),
        ("stale: fail", "stale: faill", 7, "did you mean 'fail'?"),
        ("on_failure: ask\n", "on_failure: stop\n", 8, "'question' is that of 'on_failure: ask'"),
        ("default: skip", "default: retry", 11, "'skip' or 'stop'"),
        ("default: skip", "default: panic", 11, "'skip' or 'stop'"),
        ("skill: navigate", "skil: navigate", 12, "did you mean 'skill'?"),
        ("skill: navigate", "to: hall", 12, "'with' goes with 'skill' or 'use'"),
        ("skill: navigate", "skill: navigate\n    to: hall", 12, "either 'skill' or to, not both"),
        ("skill: navigate", "skill: navigate\n    use: x.yaml", 12, "either 'skill' or use, not both"),
        ("skill: navigate", "skill: navigate\n    elsewhere: false", 12, "'elsewhere' goes with 'say'"),
        ("say: go to the hall", "to: hall\n    gives: {a: b}", 8, "'gives' goes with 'skill'"),
    ],
)
def test_invalid_value_is_refused_with_line_and_hint(load, old, new, line, says):
    good = GOOD.replace("What now?", '"What now?"')
    assert old in good
    with pytest.raises(InputError) as error:
        load(good.replace(old, new, 1))
    assert (error.value.line, says in str(error.value)) == (line, True), str(error.value)
    assert error.value.hint


def test_all_errors_are_reported_together(load):
    with pytest.raises(InputError) as error:
        load("name: 3\ntimeout: 0\nsteps:\n  - {too: hall}\n  - {do: juggle, object: coke}\n")
    lines = [one.line for one in (error.value, *error.value.others)]
    assert lines == [4, 1, 2, 5]


def test_the_json_schema_names_every_key_with_a_description():
    schema = mission_json_schema()
    steps = [schema["$defs"][ref["$ref"].rpartition("/")[2]] for ref in schema["$defs"]["AnyStep"]["anyOf"]]
    keys = {key: facts for step in steps for key, facts in step["properties"].items()}
    assert set(schema["properties"]) == {field.alias or name for name, field in Mission.model_fields.items()}
    assert {"say", "take", "to", "do", "object", "skill", "use", "with", "gives", "timeout"} <= set(keys)
    assert all("description" in facts for facts in (*schema["properties"].values(), *keys.values()))
    assert not any(each["additionalProperties"] for each in (schema, *steps))


def test_parameter_may_replace_a_number():
    timeout = mission_json_schema()["$defs"]["Do"]["properties"]["timeout"]
    assert '"pattern"' in json.dumps(timeout)


@pytest.mark.parametrize("goal", ["[1.0, 2.0]", "{x: 5.0, y: 4.5}"])
def test_a_pose_as_a_goal_points_to_the_skill_that_takes_one(load, goal):
    with pytest.raises(InputError, match="name of a place or person; for a pose write 'skill: navigate'"):
        load(f"name: m\nsteps:\n  - to: {goal}\n")


def test_a_default_answer_is_a_finite_number(load):
    with pytest.raises(InputError, match=r"default: .* a finite number"):
        load("name: m\nsteps:\n  - {ask: how many, match: number, default: .inf}\n")
