"""Blocks in mission files: their models, and refusals with file, line and hint."""

import time

import pytest

from executive.mission.resolve import MAX_NESTING
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Look, Not, ValueIs
from executive.words.expression import Template
from executive.words.leaf_steps import Awaited, Charging, Check, Dock, Set, Speak, Wait
from executive.words.steps import Ask, Choose, Group, Handler, Repeat, Together, Try
from skills.inputs.errors import InputError

BEER = Look(object="beer", at="kitchen")
HOLDING, PRESSED = ValueIs(text="holding"), ButtonPressed(button="go")


@pytest.fixture
def load(load):
    """Loads the mission of a text without its name, with other files by name."""
    return lambda text, **others: load(f"name: m\n{text}", **others)


@pytest.fixture
def block(load):
    """Block of the only step."""

    def read(text):
        (step,) = load(f"steps:\n{text}").steps
        return step

    return read


def goals(steps):
    return [step.commands[0].goal for step in steps]


# From YAML to blocks.


def test_if(block):
    found = block("- if: battery < 0.3\n  then: [{to: kitchen}]\n  else: [{to: hall}]")
    assert isinstance(found, Choose)
    assert found.condition == ValueIs(text="battery < 0.3")
    assert (goals(found.then), goals(found.otherwise)) == (["kitchen"], ["hall"])


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("holding", HOLDING),
        ("true", ValueIs(text="true")),
        ("{expression: holding}", HOLDING),
        ("{look: is there a beer in the kitchen}", BEER),
        ("{object: beer, at: kitchen}", BEER),
        ("{object: beer}", Look(object="beer")),
        ("{person: Robin, at: kitchen}", Look(object="Robin", at="kitchen")),
        ("{object: beer, at: kitchen, max_age_s: 20}", BEER.model_copy(update={"max_age_s": 20.0})),
        ("{look: is there a beer in the kitchen, max_age_s: 2 min}", BEER.model_copy(update={"max_age_s": 120.0})),
        ("{person: anybody}", Look(object="person")),
        ("{button: go}", PRESSED),
        ("{all: [holding, {button: go}]}", AllOf(parts=(HOLDING, PRESSED))),
        ("{any: [holding, {button: go}]}", AnyOf(parts=(HOLDING, PRESSED))),
        ("{not: {button: go}}", Not(part=PRESSED)),
    ],
)
def test_conditions(block, text, condition):
    assert block(f"- if: {text}\n  then: [dock]").condition == condition


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{times: 3}", {"times": 3}),
        ("{until: holding, times: 3}", {"until": HOLDING, "times": 3}),
        ("{while: holding}", {"while_": HOLDING}),
        ("{every: 30 min}", {"every_s": 1800.0}),
        ("{every: 2, times: 4}", {"every_s": 2.0, "times": 4}),
    ],
)
def test_repeat(block, text, expected):
    found = block(f"- repeat: {text}\n  steps: [{{to: kitchen}}]")
    assert isinstance(found, Repeat)
    assert goals(found.steps) == ["kitchen"]
    given = {key: getattr(found.loop, key) for key in ("times", "until", "while_", "every_s")}
    assert given == {"times": None, "until": None, "while_": None, "every_s": None, **expected}


def test_for_each_is_a_group_of_rounds_with_the_values_put_in(block):
    found = block("- repeat: {for_each: [kitchen, hall], as: room}\n  steps: [{to: '${room}'}, {speak: 'in ${room}'}]")
    assert isinstance(found, Group)
    rounds = found.steps
    assert [(each.name, goals(each.steps[:1])) for each in rounds] == [("kitchen", ["kitchen"]), ("hall", ["hall"])]
    assert rounds[1].steps[1].speak == "in hall"


@pytest.mark.parametrize(
    ("of", "some"), [("rooms", "workshop"), ("people", "Robin"), ("surfaces in the kitchen", "kitchen table")]
)
def test_for_each_goes_through_what_the_world_has(block, of, some):
    found = block(f"- repeat: {{for_each: {of}, as: it}}\n  steps: [{{speak: '${{it}}'}}]")
    assert some in [step.name for step in found.steps]


POSES = """\
knowledge:
  places: {pump: {pose: {x: 8.4, y: 6.5, yaw: 0}}, fuse box: {pose: {x: 2.9, y: 2.7}}}
steps:
  - repeat: {for_each: poses, as: point}
    steps: [{to: "${point}"}]
"""


@pytest.mark.parametrize(("of", "named"), [("poses", ["pump", "fuse box"]), ("poses in the bedroom", ["fuse box"])])
def test_for_each_goes_through_the_named_poses(compile_text, of, named):
    text = POSES.replace("for_each: poses", f"for_each: {of}")
    assert [command.goal for command in compile_text(f"name: m\n{text}").commands] == named


def test_for_each_in_for_each(block):
    inner = "{repeat: {for_each: [1, 2], as: b}, steps: [{speak: '${a}${b}'}]}"
    found = block(f"- repeat: {{for_each: [x, y], as: a}}\n  steps: [{inner}]")
    said = [step.speak for outer in found.steps for step in outer.walk() if isinstance(step, Speak)]
    assert said == ["x1", "x2", "y1", "y2"]


def test_try(block):
    found = block("- try: [{to: kitchen}]\n  else: [{to: hall}]")
    assert isinstance(found, Try)
    assert (goals(found.steps), goals(found.otherwise)) == (["kitchen"], ["hall"])


@pytest.mark.parametrize(("when", "needed"), [("", 2), ("all", 2), ("any", 1), ("2", 2)])
def test_together(block, when, needed):
    more = f"\n  done_when: {when}" if when else ""
    found = block(f"- together: [{{to: kitchen}}, {{wait: {{seconds: 1}}}}]{more}")
    assert isinstance(found, Together)
    assert (len(found.steps), found.needed) == (2, needed)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("- check: holding\n  gives: {answer: held}", Check(condition=HOLDING, gives={"answer": "held"})),
        ("- dock", Dock()),
        ("- dock:", Dock()),
        ("- dock: {level: 0.8}", Dock(charging=Charging(level=0.8))),
        ("- set: {a: 1, b: a + 1, c: true, d: \"'tea'\"}", Set(set={"a": 1, "b": "a + 1", "c": True, "d": "'tea'"})),
        ("- speak: '{battery}'", Speak(speak="{battery}")),
        ("- wait: {for: holding}", Wait(awaited=Awaited(condition=HOLDING))),
        ("- wait: {for: {button: go}, every: 3}", Wait(awaited=Awaited(condition=PRESSED, every_s=3.0))),
        ("- wait: {seconds: 2 min}", Wait(awaited=Awaited(seconds=120.0))),
        ("- wait: {until_clock: '14:30'}", Wait(awaited=Awaited(until_clock="14:30"))),
    ],
)
def test_small_blocks(block, text, expected):
    assert block(text).with_place(None) == expected


def test_values_are_expressions(block):
    values = block("- set: {a: 1, b: a + 1, c: true}").values
    assert {name: str(value) for name, value in values.items()} == {"a": "1", "b": "a + 1", "c": "true"}


def test_group(block):
    found = block(
        "- group: [{to: kitchen}]\n  name: rounds\n  always: [dock]\n  while: {holds: battery > 0.1}\n"
        "  when: [{if: {button: tea}, do: [{to: hall}], times: 2}]"
    )
    assert isinstance(found, Group)
    assert (found.name, goals(found.steps)) == ("rounds", ["kitchen"])
    assert [type(step) for step in found.always] == [Dock]
    assert found.while_.holds == ValueIs(text="battery > 0.1")
    (handler,) = found.when
    assert isinstance(handler, Handler)
    assert (handler.condition, goals(handler.steps), handler.times) == (ButtonPressed(button="tea"), ["hall"], 2)


def test_ask(block):
    more = "choices: {tea: [{to: kitchen}], coffee: null}\n  default: coffee\n  limit: 1 min\n  gives: {answer: drink}"
    found = block(f"- ask: Tea or {{battery}}?\n  {more}")
    assert isinstance(found, Ask)
    assert found.text == Template("Tea or {battery}?")
    assert [(choice, goals(steps)) for choice, steps in found.choices.items()] == [("tea", ["kitchen"]), ("coffee", [])]
    assert (found.default, found.limit_s, found.answer_name) == ("coffee", 60.0, "drink")


def test_choices_may_be_a_list(block):
    assert list(block("- ask: which?\n  choices: [tea, coffee]").choices) == ["tea", "coffee"]


def test_mission_with_guards_and_final_steps(load):
    mission = load(
        "variables: {n: 2, name: tea, hot: true}\nalways: [dock]\nwhile: {holds: battery > 0.1}\n"
        "when: [{if: {button: x}, do: [dock]}]\nsteps: [{to: kitchen}]"
    )
    assert mission.variables == {"n": 2, "name": "tea", "hot": True}
    assert [type(step) for step in mission.always] == [Dock]
    assert [type(step) for step in mission.framing_steps] == [Dock, Dock]


# Refusals; the others stand in refusals.yaml.


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        (
            f"steps:\n- repeat: {{for_each: {list(range(1001))}, as: x}}\n  steps: [dock]",
            "1001 values are too many",
            "list up",
        ),
        (f"variables:\n  bad: {'a' * 600}\nsteps: [dock]", "letters", ""),
    ],
    ids=["list", "text"],
)
def test_a_value_that_is_too_long_is_refused_in_its_line(load, text, message, hint):
    with pytest.raises(InputError, match=message) as refusal:
        load(text)
    assert (refusal.value.line, hint in refusal.value.hint, bool(refusal.value.hint)) == (3, True, True)


def test_all_errors_in_blocks_are_reported_together(load):
    with pytest.raises(InputError) as refusal:
        load("steps:\n- if: holding\n  then:\n  - to: mars\n  else:\n  - group:\n    - to: venus\n- to: pluto")
    assert {5, 9} <= {error.line for error in (refusal.value, *refusal.value.others)}


# Files that use files, and files that are too much.


@pytest.mark.parametrize("use", ["../mission.yaml", "/etc/passwd", "sub/../../mission.yaml", "link.yaml"])
def test_a_used_file_outside_the_folder_is_refused(load, tmp_path, use):
    (tmp_path / "link.yaml").symlink_to("/etc/passwd")
    with pytest.raises(InputError, match="leaves the folder of the mission") as refusal:
        load(f"steps:\n- use: {use}")
    assert refusal.value.line == 3


def test_a_file_of_50_megabytes_is_refused_at_once(load, tmp_path):
    with (tmp_path / "big.yaml").open("wb") as big:
        big.write(b"name: big\nsteps: [dock]\n")
        big.truncate(50_000_000)
    begun = time.process_time()
    with pytest.raises(InputError, match="too large") as refusal:
        load("steps:\n- use: big.yaml")
    assert time.process_time() - begun < 0.5
    assert refusal.value.file.name == "big.yaml"


def test_an_alias_inside_of_what_it_repeats_is_refused(load):
    with pytest.raises(InputError, match="inside of what it repeats") as refusal:
        load("steps:\n- dock\n- &a {group: [*a]}")
    assert refusal.value.line is not None


def test_steps_share_what_an_anchor_names(load):
    mission = load("each: &p {retries: 3}\nsteps:\n- {to: office, <<: *p}\n- {to: hall, <<: [*p, {timeout: 7}]}")
    first, second = mission.steps
    assert (first.retries, second.retries, second.timeout_s) == (3, 3, 7)


def nested(depth, opening="{group: [", closing="]}", inner="dock"):
    return f"steps:\n- {opening * depth}{inner}{closing * depth}"


def test_blocks_that_are_nested_too_deeply_are_refused(load):
    assert load(nested(MAX_NESTING - 1)).steps
    for depth in (MAX_NESTING, 60, 200, 400):
        with pytest.raises(InputError, match=r"deep") as refusal:
            load(nested(depth))
        assert (refusal.value.line, bool(refusal.value.hint)) == (3, True)


@pytest.mark.parametrize("depth", [100, 400])
def test_conditions_that_are_nested_too_deeply_are_refused(load, depth):
    with pytest.raises(InputError, match="nested more than"):
        load(nested(1, f"{{if: {'{not: ' * depth}holding{'}' * depth}, then: [", "]}"))


def test_used_files_count_for_the_depth(load):
    files = {f"f{n}": f"name: f{n}\n{nested(9, inner=f'{{use: f{n + 1}.yaml}}')}" for n in range(3)}
    with pytest.raises(InputError, match="deep"):
        load("steps: [{use: f0.yaml}]", **files, f3="name: f3\nsteps: [dock]")


def test_rounds_that_make_too_many_steps_are_refused(load, monkeypatch):
    monkeypatch.setattr("executive.mission.resolve.MAX_STEPS", 500)
    with pytest.raises(InputError, match="more than 500 steps") as refusal:
        load("steps:\n" + nested(13, "{repeat: {for_each: [a, b], as: x}, steps: [")[7:])
    assert refusal.value.line == 3
