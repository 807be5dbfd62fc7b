"""The written form of steps reads back to the same steps."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.words.blocks import (
    Ask,
    Check,
    Choose,
    Dock,
    Group,
    Handler,
    Repeat,
    Set,
    Speak,
    Together,
    Try,
    Wait,
)
from executive.words.command import Command, Task, Thing
from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Look, Not, ValueIs
from executive.words.expression import Expression, Template
from executive.words.steps import MissionStep, OnFailure, SkillCall, StepPolicy
from executive.words.written import parse_written, written

texts = st.text(st.characters(exclude_characters="{}", exclude_categories=["Cs"]), max_size=12)
names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=8)
words = st.sampled_from(["beer", "red wine", "kitchen", "Nothing", "then", "If", "not", "a at b", "it's", "three"])
seconds = st.floats(0.1, 1e6) | st.integers(1, 5000).map(float)
expressions = st.sampled_from(["battery < 0.3 and not holding", 'clock >= "14:30"', "1 + 2", '"}" == drink']).map(
    Expression
)
commands = st.builds(
    Command,
    item=st.none() | st.builds(Thing, words),
    goal=words,
    task=st.none() | st.sampled_from(Task),
    object=st.none() | st.builds(Thing, words),
)
leaves = st.one_of(
    st.builds(ValueIs, expressions),
    st.builds(Look, commands, st.just(0.0) | seconds),
    st.builds(DoorOpen, st.tuples(names, names), st.just(0.0) | seconds),
    st.builds(ButtonPressed, names),
)
conditions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(Not, inner),
        st.builds(AllOf, st.lists(inner, max_size=3).map(tuple)),
        st.builds(AnyOf, st.lists(inner, max_size=3).map(tuple)),
    ),
    max_leaves=4,
)
small = st.one_of(
    st.builds(Wait, condition=conditions, every_s=seconds),
    st.builds(Wait, seconds=seconds),
    st.builds(Wait, until_clock_s=seconds),
    st.builds(Check, conditions, st.none() | names),
    st.builds(Dock, st.none() | st.floats(0.01, 1.0)),
    st.builds(Speak, texts.map(Template)),
    st.builds(Set, st.dictionaries(names, expressions, min_size=1, max_size=3)),
)


def holding(steps):
    return st.one_of(
        st.builds(Choose, conditions, steps, steps),
        st.builds(
            Repeat, steps, st.none() | st.integers(1, 99), st.none() | conditions, st.none() | conditions,
            st.none() | seconds,
        ),
        st.builds(Try, steps, steps),
        st.builds(Together, steps, st.none() | st.integers(1, 3)),
        st.builds(
            Group, steps, st.none() | texts, steps, st.none() | conditions,
            st.lists(st.builds(Handler, conditions, steps, st.integers(1, 9)), max_size=2).map(tuple),
        ),
        st.builds(
            Ask, texts.map(Template), st.dictionaries(names, steps, max_size=2), st.none() | names, seconds,
            st.none() | st.booleans() | st.integers(-5, 5) | texts, st.none() | names,
        ),
    )  # fmt: skip


plain = st.lists(commands, min_size=1, max_size=3).map(lambda found: MissionStep(tuple(found)))
rows = st.recursive(
    st.lists(plain | small.map(lambda block: MissionStep(block=block)), max_size=3).map(tuple),
    lambda steps: st.lists(holding(steps).map(lambda block: MissionStep(block=block)) | plain, max_size=2).map(tuple),
    max_leaves=6,
)


@settings(max_examples=200, deadline=None)
@given(rows)
def test_the_written_form_reads_back_to_the_same_steps(steps):
    assert parse_written(written(steps)) == steps


def test_each_step_is_one_line():
    beer = Command(goal="kitchen", task=Task.FIND, object=Thing("beer"))
    go = MissionStep((Command(goal="hall"),))
    found = written((MissionStep(block=Choose(Look(beer), (go,))), go))
    assert found == (
        "If (Take [Nothing] to [kitchen] and do [find] to [beer])"
        " {Take [Nothing] to [hall] and do [Nothing] to [Nothing]}",
        "Take [Nothing] to [hall] and do [Nothing] to [Nothing]",
    )


def test_it_reads_as_well_with_line_breaks():
    line = 'Repeat 2 times {\n  Say "hello";\n  Wait 5 s\n}'
    steps = (MissionStep(block=Speak(Template("hello"))), MissionStep(block=Wait(seconds=5.0)))
    assert parse_written([line]) == (MissionStep(block=Repeat(steps, times=2)),)


@pytest.mark.parametrize(
    "line",
    [
        "Go to the kitchen",
        "If () {}",
        "If (value true) {}",
        'If (value "true") {',
        'If (value "1 +") {}',
        "Repeat 2 {}",
        "Wait",
        "Wait for 5 s",
        'Say hello',
        "Take [Nothing] to [hall] and do [juggle] to [Nothing]",
        "Take [Nothing] to [hall] and do [Nothing] to [Nothing] then",
        "Dock }",
        r'Say "\q"',
        'Set "a" "1"',
    ],
)  # fmt: skip
def test_what_is_no_written_form_is_an_error(line):
    with pytest.raises(ValueError):
        parse_written([line])


@pytest.mark.parametrize(
    "step",
    [
        MissionStep(skill=SkillCall("wave")),
        MissionStep((Command(goal="hall"),), policy=StepPolicy(on_failure=OnFailure.SKIP)),
        MissionStep((Command(goal="hall"),), elsewhere=False),
        MissionStep(),
    ],
)
def test_what_only_a_file_can_say_has_no_written_form(step):
    with pytest.raises(ValueError, match="mission file"):
        written((step,))
