"""Blocks in mission files: their models, and refusals with file, line and hint."""

import time

import pytest

from executive.mission.resolve import MAX_NESTING, mission_from_file
from executive.words.command import Command
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Look, Not, ValueIs
from executive.words.expression import Template
from executive.words.leaf_steps import Awaited, Charging, Check, Dock, Set, Speak, Wait
from executive.words.steps import Ask, Choose, Group, Handler, Repeat, Together, Try
from skills.files.errors import InputError

KITCHEN, HALL = Command(goal="kitchen"), Command(goal="hall")
BEER = Look(object="beer", at="kitchen")


@pytest.fixture
def load(tmp_path, parser, flat):
    """Loads the mission of a text, with other files by name."""

    def load_text(text, **others):
        for name, other in others.items():
            (tmp_path / f"{name}.yaml").write_text(other, encoding="utf-8")
        path = tmp_path / "mission.yaml"
        path.write_text(f"name: m\n{text}", encoding="utf-8")
        return mission_from_file(path, parser=parser, knowledge=flat)

    return load_text


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
    assert (found.condition, goals(found.then), goals(found.otherwise)) == (
        ValueIs(text="battery < 0.3"),
        ["kitchen"],
        ["hall"],
    )


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("holding", ValueIs(text="holding")),
        ("true", ValueIs(text="true")),
        ("{expression: holding}", ValueIs(text="holding")),
        ("{look: is there a beer in the kitchen}", BEER),
        ("{object: beer, at: kitchen}", BEER),
        ("{object: beer}", Look(object="beer")),
        ("{person: Robin, at: kitchen}", Look(object="Robin", at="kitchen")),
        ("{object: beer, at: kitchen, max_age_s: 20}", BEER.model_copy(update={"max_age_s": 20.0})),
        ("{look: is there a beer in the kitchen, max_age_s: 2 min}", BEER.model_copy(update={"max_age_s": 120.0})),
        ("{person: anybody}", Look(object="person")),
        ("{button: go}", ButtonPressed(button="go")),
        ("{all: [holding, {button: go}]}", AllOf(parts=(ValueIs(text="holding"), ButtonPressed(button="go")))),
        ("{any: [holding, {button: go}]}", AnyOf(parts=(ValueIs(text="holding"), ButtonPressed(button="go")))),
        ("{not: {button: go}}", Not(part=ButtonPressed(button="go"))),
    ],
)
def test_conditions(block, text, condition):
    assert block(f"- if: {text}\n  then: [dock]").condition == condition


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{times: 3}", {"times": 3}),
        ("{until: holding, times: 3}", {"until": ValueIs(text="holding"), "times": 3}),
        ("{while: holding}", {"while_": ValueIs(text="holding")}),
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


def test_for_each_in_for_each(block):
    inner = "{repeat: {for_each: [1, 2], as: b}, steps: [{speak: '${a}${b}'}]}"
    found = block(f"- repeat: {{for_each: [x, y], as: a}}\n  steps: [{inner}]")
    said = [step.speak for outer in found.steps for step in walk(outer) if isinstance(step, Speak)]
    assert said == ["x1", "x2", "y1", "y2"]


def walk(step):
    return list(step.walk())


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
        ("{seconds: 2 min}", Awaited(seconds=120.0)),
        ("{until_clock: '14:30'}", Awaited(until_clock="14:30")),
        ("{for: holding}", Awaited(condition=ValueIs(text="holding"))),
        ("{for: {button: go}, every: 3}", Awaited(condition=ButtonPressed(button="go"), every_s=3.0)),
    ],
)
def test_wait(block, text, expected):
    found = block(f"- wait: {text}")
    assert isinstance(found, Wait)
    assert found.awaited == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "- check: holding\n  gives: {answer: held}",
            Check(condition=ValueIs(text="holding"), gives={"answer": "held"}),
        ),
        ("- dock", Dock()),
        ("- dock:", Dock()),
        ("- dock: {level: 0.8}", Dock(charging=Charging(level=0.8))),
        ("- speak: '{battery}'", Speak(speak="{battery}")),
        ("- set: {a: 1, b: a + 1, c: true, d: \"'tea'\"}", Set(set={"a": 1, "b": "a + 1", "c": True, "d": "'tea'"})),
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
    found = block(
        "- ask: Tea or {battery}?\n  choices: {tea: [{to: kitchen}], coffee: null}\n  default: coffee\n  limit: 1 min\n"
        "  gives: {answer: drink}"
    )
    assert isinstance(found, Ask)
    assert (found.text, list(found.choices), goals(found.choices["tea"])) == (
        Template("Tea or {battery}?"),
        ["tea", "coffee"],
        ["kitchen"],
    )
    assert (found.choices["coffee"], found.default, found.limit_s, found.answer_name) == ((), "coffee", 60.0, "drink")


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


# Refusals: the line in the file below, a part of the message, and of the hint.

REFUSED = [
    ("- if: battery < 0.3", 3, "'if' needs 'then' beside it", ""),
    ("- if: battery < 0.3\n  then: []", 4, "should not be empty", ""),
    ("- then: [dock]", 3, "the step is empty", ""),
    ("- if: 3\n  then: [dock]", 3, "should be a mapping", ""),
    ("- if: 1 +\n  then: [dock]", 3, "'1 +' is no expression", "write it as in"),
    ("- if: {}\n  then: [dock]", 3, "it is empty", ""),
    ("- if: {all: []}\n  then: [dock]", 3, "should not be empty", ""),
    ("- if: {all: [holding], any: [holding]}\n  then: [dock]", 3, "it has all and any", ""),
    ("- if: {at: kitchen}\n  then: [dock]", 3, "it is empty", ""),
    (
        "- if: {button: go, max_age_s: 5}\n  then: [dock]",
        3,
        "'max_age_s' goes with 'look', 'object', 'person' or 'door'",
        "",
    ),
    ("- if: {button: go, at: kitchen}\n  then: [dock]", 3, "'at' goes with 'object' or 'person'", ""),
    ("- if: {door: [kitchn, hall]}\n  then: [dock]", 3, "unknown room 'kitchn'", "did you mean 'kitchen'?"),
    ("- if: {door: [a, b, c]}\n  then: [dock]", 3, "too many parts", ""),
    (
        "- if: {look: go to the kitchen}\n  then: [dock]",
        3,
        "is no single question that a look can answer",
        "ask one thing",
    ),
    ("- if:\n    all:\n      - {look: blah blah}\n  then: [dock]", 5, "I do not understand", "say it in other words"),
    ("- if:\n    object: unicorn\n  then: [dock]", 4, "unknown object 'unicorn'", "known are"),
    ("- if: {object: beer, at: mars}\n  then: [dock]", 3, "unknown place or person 'mars'", "known are"),
    ("- if: {person: Robyn}\n  then: [dock]", 3, "unknown person 'Robyn'", "did you mean 'Robin'?"),
    ("- if: {button: ''}\n  then: [dock]", 3, "should not be empty", ""),
    ("- if: holding\n  then: [dock]\n  to: kitchen", 3, "either 'if' or to, not both", ""),
    ("- if: holding\n  then: [dock]\n  name: x", 3, "'name' goes with 'group'", ""),
    ("- repeat: {for_each: [a], as: x}", 3, "'repeat' needs 'steps' beside it", "add what is to be done"),
    ("- repeat: {for_each: [a]}\n  steps: [dock]", 3, "'for_each' and 'as' go together", ""),
    ("- repeat: {as: a}\n  steps: [dock]", 3, "'for_each' and 'as' go together", ""),
    ("- repeat: {for_each: [a], as: x, times: 2}\n  steps: [dock]", 3, "'for_each' stands alone", ""),
    ("- repeat: {for_each: [], as: x}\n  steps: [dock]", 3, "nothing to go through", "list up to 1000 values"),
    ("- repeat:\n    as: x\n    for_each:\n      - a\n      - [1]\n  steps: [dock]", 7, "no plain value", "list texts"),
    (f"- repeat: {{for_each: {list(range(1001))}, as: x}}\n  steps: [dock]", 3, "1001 values are too many", "list up"),
    ("- repeat: {for_each: planets, as: x}\n  steps: [dock]", 3, "'planets' is no list", "write a list"),
    ("- repeat: {for_each: rooms in kitchen, as: x}\n  steps: [dock]", 3, "is no list", "write a list"),
    ("- repeat: {for_each: surfaces in mars, as: x}\n  steps: [dock]", 3, "unknown place 'mars'", "known are"),
    ("- repeat: {for_each: people in hall, as: x}\n  steps: [dock]", 3, "nothing to go through", ""),
    ("- repeat: {for_each: rooms, as: x}\n  steps:\n  - to: '${y}'", 5, "unknown parameter 'y'", "declare it"),
    ("- repeat: {for_each: [hall, mars], as: x}\n  steps:\n  - to: '${x}'", 5, "unknown place or person 'mars'", ""),
    ("- repeat: {for_each: [hall], as: x}\n  steps:\n  - too: '${x}'", 5, "unknown key 'too'", "did you mean 'to'?"),
    ("- repeat: {}\n  steps: [dock]", 3, "it does not say how often", ""),
    ("- repeat: {times: 0}\n  steps: [dock]", 3, "should be from 1 to 100000", ""),
    ("- repeat: {until: holding, while: holding}\n  steps: [dock]", 3, "'until' or 'while', not both", ""),
    ("- repeat: {every: soon}\n  steps: [dock]", 3, "should be a number", ""),
    ("- repeat: {every: 0}\n  steps: [dock]", 3, "should be above 0", ""),
    ("- repeat: {times: 2}", 3, "'repeat' needs 'steps' beside it", ""),
    ("- try: [dock]", 3, "'try' needs 'else' beside it", ""),
    ("- try: []\n  else: [dock]", 3, "should not be empty", ""),
    ("- together: [dock]", 3, "should have 2 parts or more", ""),
    ("- together: [dock, dock]\n  done_when: 3", 4, "3 of 2 steps cannot be done", "give 2 at most"),
    ("- together: [dock, dock]\n  done_when: some", 4, "should be 'all' or 'any' or a whole number", ""),
    ("- wait: {}", 3, "give one of 'for', 'seconds' and 'until_clock'", ""),
    ("- wait: {seconds: 1, for: holding}", 3, "give one of", ""),
    ("- wait: {until_clock: '25:00'}", 3, "from 00:00 to 23:59", "write it as"),
    ("- wait: {seconds: 5 parsecs}", 3, "should be a number", ""),
    ("- check: holding\n  gives: {anser: x}", 4, "it gives no 'anser'", "write {answer: NAME}"),
    ("- dock: {level: 2}", 3, "should be from 0 to 1", ""),
    ("- dock: {levl: 1}", 3, "unknown key 'levl'", "did you mean 'level'?"),
    ("- group: [dock]\n  when: [{do: [dock]}]", 4, "key 'if' is missing", ""),
    ("- group: [dock]\n  when: [{if: holding}]", 4, "key 'do' is missing", ""),
    ("- group: [dock]\n  when: [{if: holding, do: [dock], times: 0}]", 4, "should be from 1 to 100000", ""),
    ("- always: [dock]", 3, "the step is empty", ""),
    ("- speak: ''", 3, "should not be empty", ""),
    ("- speak: 'a {'", 3, "a brace '{' stands alone", "write an expression in {braces}"),
    ("- ask: q\n  choices: {}", 4, "should not be empty", ""),
    ("- ask: q\n  choices: [a, b]\n  default: c", 5, "'c' is none of the choices", "they are a and b"),
    ("- ask: q\n  choices:\n    tea: [dock]\n    Tea: [dock]", 6, "the same to one who answers", "different names"),
    ("- ask: q\n  choices: [yes, no]", 4, "yes, no, on and off mean true and false", ""),
    ("- ask: q\n  choices: [a]\n  match: number", 3, "not both", ""),
    ("- ask: q\n  match: colour", 4, "should be 'place', 'person'", ""),
    ("- ask: q\n  limit: 0", 4, "should be above 0", ""),
    ("- ask: q\n  gives: {anser: x}", 4, "it gives no 'anser'", ""),
    ("- set: {x: 1 +}", 3, "'1 +' is no expression", "write it as in"),
    ("- set: {x: null}", 3, "'x' gets no value", "give a number"),
    ("- set: {x: [1]}", 3, "should be a text or true or false or a whole number or a number", ""),
    ("- set: {x: .inf}", 3, "a finite number", ""),
    ("- set:\n    y: 1\n    x: 1.0e+300", 5, "a number that is too large", "smaller"),
]


@pytest.mark.parametrize(("text", "line", "message", "hint"), REFUSED, ids=[each[0][:40] for each in REFUSED])
def test_refused(load, tmp_path, text, line, message, hint):
    with pytest.raises(InputError) as refusal:
        load(f"steps:\n{text}")
    error = refusal.value
    assert message in error.message
    assert hint in error.hint
    assert error.hint
    assert (error.file, error.line) == (tmp_path / "mission.yaml", line)


# What takes names, types and rooms to be told: when the mission is compiled.

NOT_COMPILED = [
    ("- if: batery < 0.3\n  then: [dock]", 3, "unknown name 'batery'", "did you mean 'battery'?"),
    ("- if: battery\n  then: [dock]", 3, "'battery' is not true or false", "compare it"),
    ("- dock\n- if: battery == 'full'\n  then: [dock]", 4, "compares number with text", ""),
    ("- set: {x: 1 / 0}", 3, "divides by zero", ""),
    ("- set: {x: 1}\n- set: {y: x + 'a'}", 4, "mixes number with text", ""),
    ("- set: {battery: 1}", 3, "'battery' cannot be the name of a value", "letters, digits"),
    ("- set: {a b: 1}", 3, "cannot be the name of a value", ""),
    ("- repeat: {until: true == false}\n  steps: [dock]", 3, "nothing in a round changes whether", "give 'times'"),
    (
        "- set: {n: 0}\n- repeat: {while: n < 3}\n  steps: [dock]",
        4,
        "nothing in a round changes whether n < 3",
        "'set'",
    ),
    ("- group: [dock]\n  while: {holds: {object: beer}}", 3, "takes a look, and cannot be watched", "look once"),
    ("- group: [dock]\n  when: [{if: {person: anybody}, do: [dock]}]", 3, "takes a look, and cannot be watched", ""),
    ("- together: [{to: kitchen}, {to: hall}]", 3, "steps 1 and 2 both use the base", "one after the other"),
    ("- ask: '{x}?'", 3, "unknown name 'x'", ""),
    ("- ask: q\n  match: number\n  default: five", 3, "the default 'five' is no number", ""),
    ("- ask: q\n  match: place\n  default: mars", 3, "the default 'mars' is unknown", ""),
    ("- ask: q\n  choices: {a/b: [dock], a b: [dock]}", 3, "two nodes have this path id", "different names"),
    ("- say: go to the kitchen\n  gives: {answer: x}", 3, "this step gives no answer", ""),
]


@pytest.mark.parametrize(("text", "line", "message", "hint"), NOT_COMPILED, ids=[each[0][:40] for each in NOT_COMPILED])
def test_faults_that_only_the_compiler_finds(compile_text, tmp_path, text, line, message, hint):
    with pytest.raises(InputError) as refusal:
        compile_text(f"name: m\nsteps:\n{text}")
    error = refusal.value
    assert message in error.message
    assert hint in error.hint
    assert error.hint
    assert (error.file, error.line) == (tmp_path / "mission.yaml", line)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (".inf", "finite number"),
        ("1.0e+300", "too large"),
        ("a" * 600, "letters"),
        ("[1]", "should be"),
        ("null", "should"),
    ],
)
def test_a_variable_that_cannot_be_one_is_refused_where_it_stands(load, value, message):
    with pytest.raises(InputError, match=message) as refusal:
        load(f"variables:\n  good: 1\n  bad: {value}\nsteps: [dock]")
    assert refusal.value.line == 4


def test_all_errors_in_blocks_are_reported_together(load):
    with pytest.raises(InputError) as refusal:
        load("steps:\n- if: holding\n  then:\n  - to: mars\n  else:\n  - group:\n    - to: venus\n- to: pluto")
    assert {5, 9} <= {error.line for error in (refusal.value, *refusal.value.others)}


# Files that use files, and files that are too much.

CIRCLES = [
    "- if: holding\n  then: [{use: a.yaml}]",
    "- repeat: {times: 2}\n  steps: [{use: a.yaml}]",
    "- repeat: {for_each: [a], as: file}\n  steps: [{use: '${file}.yaml'}]",
    "- group: [dock]\n  always: [{use: a.yaml}]",
    "- group: [dock]\n  when: [{if: holding, do: [{use: a.yaml}]}]",
    "- ask: q\n  choices: {a: [{use: a.yaml}]}",
    "- try: [dock]\n  else: [{use: a.yaml}]",
    "- together: [{wait: {seconds: 1}}, {use: a.yaml}]",
    "- dock\nalways: [{use: a.yaml}]",
]


@pytest.mark.parametrize("text", CIRCLES)
def test_files_that_use_each_other_in_a_circle_through_blocks(load, text):
    with pytest.raises(InputError, match=r"mission\.yaml -> a\.yaml -> mission\.yaml") as refusal:
        load(f"steps:\n{text}", a="name: a\nsteps: [dock, {use: mission.yaml}]")
    assert (refusal.value.file.name, refusal.value.line, refusal.value.hint) == ("a.yaml", 2, "break the circle")


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
