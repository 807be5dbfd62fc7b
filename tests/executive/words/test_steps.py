"""Steps written as YAML read back to the same steps."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.words import steps as blocks
from executive.words.command import Command
from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Look, Not, ValueIs
from executive.words.leaf_steps import Awaited, Charging, Check, Do, Dock, Set, Speak, Wait, steps_of_commands
from executive.words.task import task_named
from skills.api import ObjectKind
from skills.inputs.yaml_source import parse_yaml

texts = st.text(st.characters(exclude_characters="{}", exclude_categories=["C", "Z"]), min_size=1, max_size=12)
names = texts
words = st.sampled_from(["beer", "red wine", "kitchen", "Nothing", "then", "if", "not", "a at b", "it's", "yes", "3"])
seconds = st.floats(0.1, 86_000.0) | st.integers(1, 5000).map(float)
expressions = st.sampled_from(["battery < 0.3 and not holding", 'clock >= "14:30"', "1 + 2", '"}" == drink', "true"])
commands = st.builds(Command, item=st.none() | st.builds(ObjectKind, words), goal=words)
checks = st.builds(
    Command, goal=st.none() | words, task=st.just(task_named("find")), object=st.builds(ObjectKind, words)
)


def built(model, **values):
    """Model of fields by their names; hypothesis would use their aliases."""
    return st.fixed_dictionaries(values).map(lambda given: model(**given))


def row(each):
    return st.tuples(each) | st.tuples(each, each)


leaves = st.one_of(
    built(ValueIs, text=expressions),
    st.builds(Look.from_command, checks, st.just(0.0) | seconds),
    built(DoorOpen, door=st.tuples(names, names), max_age_s=st.just(0.0) | seconds),
    built(ButtonPressed, button=names),
)
conditions = st.recursive(
    leaves,
    lambda inner: st.one_of(built(Not, part=inner), built(AllOf, parts=row(inner)), built(AnyOf, parts=row(inner))),
    max_leaves=4,
)
awaited = st.one_of(
    built(Awaited, condition=conditions, every_s=seconds),
    built(Awaited, seconds=seconds),
    built(Awaited, until_clock=st.sampled_from(["00:00", "09:05", "14:30"])),
)
loops = st.one_of(
    built(blocks.Loop, times=st.integers(1, 99), every_s=st.none() | seconds),
    built(blocks.Loop, until=conditions, times=st.none() | st.integers(1, 99)),
    built(blocks.Loop, while_=conditions),
)
small = st.one_of(
    st.builds(Do.from_command, commands),
    built(Wait, awaited=awaited),
    built(Check, condition=conditions, gives=st.none() | st.fixed_dictionaries({"answer": names})),
    built(Dock, charging=built(Charging, level=st.none() | st.floats(0.01, 1.0))),
    built(Speak, speak=texts),
    built(Set, set=st.dictionaries(names, expressions | st.integers(0, 9) | st.booleans(), min_size=1, max_size=3)),
)


def holding(steps):
    some = row(steps)
    branch = st.just(()) | some
    handler = built(blocks.Handler, condition=conditions, steps=some, times=st.integers(1, 9))
    return st.one_of(
        built(blocks.Choose, condition=conditions, then=some, otherwise=branch),
        built(blocks.Repeat, loop=loops, steps=some),
        built(blocks.Try, steps=some, otherwise=some),
        built(blocks.Together, steps=st.tuples(steps, steps), done_when=st.just("any")),
        built(
            blocks.Group,
            steps=some,
            name=st.none() | names,
            always=branch,
            while_=st.none() | built(blocks.While, holds=conditions),
            when=st.none() | row(handler),
        ),
        built(blocks.Ask, ask=texts, choices=st.dictionaries(words, branch, min_size=1, max_size=2), limit_s=seconds),
        built(blocks.Ask, ask=texts, match=st.just("place"), default=st.none() | words),
    )


missions = row(st.recursive(small, holding, max_leaves=6))


@settings(max_examples=120, deadline=None)
@given(missions)
def test_yaml_reads_back_to_the_same_steps(steps):
    assert blocks.steps_from_yaml(blocks.steps_to_yaml(steps)) == steps


WRITTEN = """\
- if: {object: beer, at: kitchen}
  then:
  - {to: kitchen, do: grasp, object: beer}
  - {take: beer, to: start}
  else:
  - {speak: there is none}
- wait: {for: battery > 0.5}
- repeat: {times: 2, every: 600}
  steps:
  - ask: Tea?
    choices:
      'yes':
      - dock: {}
      'no': null"""


def test_it_is_what_a_person_would_write():
    beer = ObjectKind("beer")
    look = Look.from_command(Command(goal="kitchen", task=task_named("find"), object=beer))
    grasp = Command(goal="kitchen", task=task_named("grasp"), object=beer, verb="fetch")
    fetch = steps_of_commands([grasp, Command(item=beer, goal="start")])
    steps = (
        blocks.Choose(condition=look, then=fetch, otherwise=(Speak(speak="there is none"),)),
        Wait(awaited=Awaited(condition=ValueIs(text="battery > 0.5"))),
        blocks.Repeat(
            loop=blocks.Loop(times=2, every_s=600.0),
            steps=(blocks.Ask(ask="Tea?", choices={"yes": (Dock(),), "no": ()}),),
        ),
    )
    assert list(blocks.steps_to_yaml(steps)) == WRITTEN.splitlines()


def test_data_are_plain():
    assert blocks.steps_to_data([Dock(), Set(set={"n": 1})]) == [{"dock": {}}, {"set": {"n": 1}}]


@pytest.mark.parametrize("lines", [["- {to: hall"], ["- 3"], ["to: hall"], ["- {if: holding}"], ["- {to_: hall}"]])
def test_document_without_steps_is_refused(lines):
    with pytest.raises(ValueError, match=r".+"):
        blocks.steps_from_yaml(lines)


@pytest.mark.parametrize(
    ("written", "answer"),
    [
        ("{choices: {yes: , no: }, default: no}", "no"),
        ("{choices: {yes: , no: }, default: yes}", "yes"),
        ('{choices: ["Yes", "No"], default: No}', "No"),
        ("{choices: {on: , off: }, default: off}", "off"),
        ('{choices: ["1", "2"], default: 2}', "2"),
        ("{default: no}", "no"),
        ("{match: number, default: 2}", 2),
        ("{match: text, default: maybe}", "maybe"),
    ],
)
def test_a_default_is_read_as_the_answer_that_is_written(written, answer):
    data = parse_yaml(written, Path("m.yaml")).data
    assert blocks.Ask.model_validate({"ask": "Really?", **data}).default == answer
