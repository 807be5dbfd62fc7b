"""How blocks are compiled: which names and types are known where, what is in the gripper, what cannot go together."""

from dataclasses import replace

import pytest

from executive.tree.compiler import compile_mission
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
from executive.words.command import parse_command
from executive.words.condition import ButtonPressed, Condition, Look, Not, ValueIs
from executive.words.expression import Expression, Template
from executive.words.steps import DEFAULT_WORLD, Mission, MissionStep, OnFailure, SkillCall, StepPolicy
from skills.files.errors import InputError

HOLDING, PRESSED = ValueIs(Expression("holding")), ButtonPressed("go")
LOOK = Look(parse_command("Take [Nothing] to [kitchen] and do [find] to [beer]"))
TAKE = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
BRING = "Take [coke] to [kitchen] and do [Nothing] to [Nothing]"


def block(made, **more):
    return MissionStep(block=made, **more)


def go(text):
    return MissionStep((parse_command(text),))


def to(place):
    return go(f"Take [Nothing] to [{place}] and do [Nothing] to [Nothing]")


def put(**values):
    return block(Set({name: Expression(str(value)) for name, value in values.items()}))


def reads(text):
    """A step that is only right where the names in `text` are known."""
    return block(Check(ValueIs(Expression(text))))


@pytest.fixture
def compiled_steps(knowledge, registry, make):
    registry["speak"] = make.scripted_skill(make.Script(), "speak", *SPEAK)

    def compile_steps(*steps, **more):
        mission = Mission("m", DEFAULT_WORLD, "Alice", steps, **more)
        return compile_mission(mission, knowledge=knowledge, registry=registry)

    return compile_steps


def speak_ports():
    import dataclasses

    return dataclasses.make_dataclass("SpeakInputs", [("text", str)], frozen=True), {}


SPEAK = speak_ports()


@pytest.fixture
def refusal(compiled_steps):
    def message(*steps, **more):
        with pytest.raises(InputError) as error:
            compiled_steps(*steps, **more)
        assert error.value.hint
        return error.value.message

    return message


# Names: known after it where all ways through it give them.

CONDITION: Condition = HOLDING
GIVEN = {
    "in both branches": block(Choose(CONDITION, (put(x=1),), (put(x=2),))),
    "in every round": block(Repeat((put(x=1),), times=2)),
    "in a round before until": block(Repeat((put(x=1),), until=HOLDING)),
    "both times of a try": block(Try((put(x=1),), (put(x=2),))),
    "in a group": block(Group((put(x=1),))),
    "beside another": block(Together((put(x=1), block(Wait(seconds=1.0))))),
    "by every answer": block(Ask(Template("q"), {"a": (put(x=1),), "b": (put(x=2),)})),
    "as an answer": block(Ask(Template("q"), match="number", gives="x")),
    "by a skipped step beside it": block(
        Group((put(x=1), block(Dock(), policy=StepPolicy(on_failure=OnFailure.SKIP))))
    ),
}
NOT_SURELY_GIVEN = {
    "in then alone": block(Choose(CONDITION, (put(x=1),))),
    "in else alone": block(Choose(CONDITION, (to("hall"),), (put(x=1),))),
    "with two types": block(Choose(CONDITION, (put(x=1),), (put(y="true"),))),
    "in rounds of while": block(Repeat((put(x=1),), while_=HOLDING)),
    "in try alone": block(Try((put(x=1),), (to("hall"),))),
    "in one of two beside each other": block(Together((put(x=1), block(Wait(seconds=1.0))), needed=1)),
    "by one answer": block(Ask(Template("q"), {"a": (put(x=1),), "b": ()})),
    "in a handler": block(Group((to("hall"),), when=(Handler(PRESSED, (put(x=1),)),))),
    "by what may be skipped": block(Group((put(x=1),)), policy=StepPolicy(on_failure=OnFailure.SKIP)),
    "by what is asked about": block(Group((put(x=1),)), policy=StepPolicy(on_failure=OnFailure.ASK)),
}


@pytest.mark.parametrize("way", GIVEN)
def test_names_that_are_surely_given_are_known_afterwards(compiled_steps, way):
    assert compiled_steps(GIVEN[way], reads("x > 0"))


@pytest.mark.parametrize("way", NOT_SURELY_GIVEN)
def test_names_that_may_lack_a_value_are_refused_afterwards(compiled_steps, refusal, way):
    assert "unknown name 'x'" in refusal(NOT_SURELY_GIVEN[way], reads("x > 0"))
    assert compiled_steps(NOT_SURELY_GIVEN[way], reads("x > 0"), variables={"x": 0})


@pytest.mark.parametrize(
    "made",
    [
        Group((to("hall"),), always=(reads("x > 0"),)),
        Group((put(y=1), to("hall"), put(x=1)), always=(reads("x > 0"),)),
        Group((put(x=1),), when=(Handler(PRESSED, (reads("x > 0"),)),)),
        Group((put(x=1),), holds=ValueIs(Expression("x > 0"))),
        Repeat((put(x=1),), while_=ValueIs(Expression("x > 0"))),
        Try((put(x=1),), (reads("x > 0"),)),
        Together((put(x=1), reads("x > 0"))),
        Choose(ValueIs(Expression("x > 0")), (put(x=1),)),
    ],
)
def test_a_name_is_not_known_before_it_is_given(refusal, made):
    assert "unknown name 'x'" in refusal(block(made))


def test_until_reads_what_the_round_has_given(compiled_steps):
    assert compiled_steps(block(Repeat((put(x=1),), until=ValueIs(Expression("x > 0")))))


# Types: a name keeps its type, since steps may be repeated and interrupted.


@pytest.mark.parametrize(
    "steps",
    [
        (put(x=1), put(x="'a'")),
        (put(x=1), block(Repeat((reads("x + 1 > 0"), put(x="'a'")), times=2))),
        (put(x=1), block(Try((put(x="'a'"), to("hall")), (reads("x + 1 > 0"),)))),
        (put(x=1), block(Group((to("hall"), reads("x > 0")), when=(Handler(PRESSED, (put(x="'a'"),)),)))),
        (block(Choose(HOLDING, (put(x=1),), (put(x="true"),))),),
    ],
)
def test_a_name_with_two_types_is_refused(refusal, steps):
    assert "'x' is elsewhere number, and gets" in refusal(*steps)


def test_a_declared_name_keeps_its_type(refusal):
    assert "'x' is declared as text, and gets number" in refusal(put(x=1), variables={"x": "a"})


@pytest.mark.parametrize("name", ["battery", "clock", "true", "a b", "1a", ""])
def test_names_that_cannot_be_given(refusal, name):
    assert "cannot be the name of a value" in refusal(block(Set({name: Expression("1")})))


def test_the_answer_of_a_question_has_the_type_of_what_is_asked_for(compiled_steps, refusal):
    question = block(Ask(Template("how many?"), match="number", gives="n"))
    assert compiled_steps(question, reads("n + 1 > 2"))
    assert "compares number with text" in refusal(question, reads("n == 'two'"))


def test_names_in_texts_are_checked(compiled_steps, refusal):
    assert compiled_steps(put(x=1), block(Speak(Template("{x}"))))
    assert "unknown name 'y'" in refusal(put(x=1), block(Speak(Template("{y}"))))
    assert "unknown name 'y'" in refusal(block(Ask(Template("{y}?"))))


# The gripper, as the steps after it are told.


def held(tree, number):
    """What the gripper holds before the last step, and whether that is what it held at first."""
    part = tree.parts[number]
    return (None if part.held is None else (part.held.sure, str(part.held.thing))), part.opening


@pytest.mark.parametrize(
    ("steps", "holds"),
    [
        ((go(TAKE),), (True, "coke")),
        ((block(Group((go(TAKE),))),), (True, "coke")),
        ((block(Choose(HOLDING, (go(TAKE),), (go(TAKE),))),), (True, "coke")),
    ],
)
def test_the_gripper_after_a_block_that_surely_takes_something(compiled_steps, holds, steps):
    tree = compiled_steps(*steps, to("bathroom"))
    assert held(tree, -1) == (holds, False)


@pytest.mark.parametrize(
    "made",
    [
        Choose(HOLDING, (go(TAKE),)),
        Repeat((go(TAKE),), times=2),
        Try((go(TAKE),), (to("hall"),)),
        Together((go(TAKE), block(Wait(seconds=1.0))), needed=1),
        Ask(Template("q"), {"a": (go(TAKE),), "b": ()}),
    ],
)
def test_the_gripper_after_a_block_that_may_take_something_is_unsure(compiled_steps, made):
    tree = compiled_steps(block(made), to("bathroom"))
    part = tree.parts[-1]
    assert part.held is not None
    assert (part.held.sure, part.opening) == (False, False)


@pytest.mark.parametrize(("times", "unsure"), [(1, False), (2, True), (None, True)])
def test_a_round_may_begin_with_what_the_one_before_has_taken(compiled_steps, times, unsure):
    tree = compiled_steps(block(Repeat((go(TAKE),), times=times, until=None if times else HOLDING)))
    (part,) = tree.parts
    assert (part.held is not None and not part.held.sure) is unsure
    assert any(node.name == "the coke is in the gripper" for node in tree.root.walk()) is unsure


BEER = "Take [Nothing] to [kitchen] and do [grasp] to [beer]"


@pytest.mark.parametrize(("then", "counts"), [(TAKE, True), (BEER, False)])
def test_what_a_branch_may_have_taken_counts_only_as_what_it_is(compiled_steps, then, counts):
    """A coke that may be in the gripper is no beer."""
    tree = compiled_steps(block(Choose(HOLDING, (go(TAKE),))), go(then))
    assert any(node.kind == "only if holding" and "in-gripper" in node.path_id for node in tree.root.walk()) is counts


def test_what_is_taken_before_a_block_is_held_in_its_branches(compiled_steps):
    tree = compiled_steps(go(TAKE), block(Choose(HOLDING, (go(BRING),), (to("bathroom"),))))
    assert [held(tree, n)[0] for n in (-2, -1)] == [(True, "coke")] * 2


# Together, and what is watched.


def skill(name, **values):
    return MissionStep(skill=SkillCall(name, values))


@pytest.mark.parametrize(
    "steps",
    [
        (to("hall"), to("kitchen")),
        (to("hall"), block(Group((block(Wait(seconds=1.0)), block(Choose(HOLDING, (to("hall"),))))))),
        (to("hall"), block(Choose(LOOK, (block(Wait(seconds=1.0)),)))),
        (to("hall"), block(Wait(LOOK))),
        (to("hall"), block(Dock())),
        (block(Try((block(Wait(seconds=1.0)),), (to("hall"),))), block(Repeat((to("hall"),), times=2))),
        (to("hall"), block(Group((block(Wait(seconds=1.0)),), always=(to("hall"),)))),
        (to("hall"), block(Group((block(Wait(seconds=1.0)),), when=(Handler(PRESSED, (to("hall"),)),)))),
    ],
)
def test_steps_that_use_the_same_part_of_the_robot_cannot_go_together(refusal, steps):
    assert "steps 1 and 2 both use the" in refusal(block(Together(steps)))


@pytest.mark.parametrize(
    "other",
    [
        block(Wait(seconds=1.0)),
        block(Wait(PRESSED)),
        block(Ask(Template("q"), {"a": ()})),
        block(Check(HOLDING)),
        block(Repeat((block(Wait(seconds=1.0)),), times=3)),
    ],
)
def test_steps_that_use_nothing_in_common_can_go_together(compiled_steps, other):
    tree = compiled_steps(block(Together((to("hall"), other))))
    assert any(node.kind == "together" for node in tree.root.walk())


@pytest.mark.parametrize(
    "made",
    [
        Group((to("hall"),), holds=LOOK),
        Group((to("hall"),), holds=Not(LOOK)),
        Group((to("hall"),), when=(Handler(PRESSED, (to("hall"),)), Handler(LOOK, (to("hall"),)))),
    ],
)
def test_what_is_watched_cannot_take_a_look(refusal, made):
    assert "takes a look, and cannot be watched" in refusal(block(made))
    assert "takes a look, and cannot be watched" in refusal(
        to("hall"), whole=Group((), holds=made.holds, when=made.when)
    )


@pytest.mark.parametrize(
    ("made", "endless"),
    [
        (Repeat((to("hall"),), until=ValueIs(Expression("x > 1"))), True),
        (Repeat((put(x=1),), until=ValueIs(Expression("x > 1"))), False),
        (Repeat((block(Group((put(x=1),))),), until=ValueIs(Expression("x > 1"))), False),
        (Repeat((to("hall"),), until=ValueIs(Expression("x > 1 or battery < 0.1"))), False),
        (Repeat((to("hall"),), until=ValueIs(Expression("x > 1")), times=3), False),
        (Repeat((to("hall"),), until=PRESSED), False),
        (Repeat((to("hall"),), while_=LOOK), False),
    ],
)
def test_rounds_that_never_end_are_refused(compiled_steps, refusal, made, endless):
    if endless:
        assert "nothing in a round changes whether" in refusal(block(made), variables={"x": 0})
        assert compiled_steps(block(made, policy=StepPolicy(timeout_s=9.0)), variables={"x": 0})
    else:
        assert compiled_steps(block(made), variables={"x": 0})


def test_a_world_without_a_dock(compiled_steps, knowledge, registry):
    bare = knowledge.model_copy(update={"dock": None})
    mission = Mission("m", DEFAULT_WORLD, "Alice", (block(Dock()),))
    with pytest.raises(InputError, match="no dock"):
        compile_mission(mission, knowledge=bare, registry=registry)


def test_path_ids_are_unique_through_all_blocks(compiled_steps):
    steps = (
        block(Choose(LOOK, (to("hall"),), (to("kitchen"),))),
        block(Repeat((to("hall"), to("hall")), until=LOOK)),
        block(Try((to("hall"),), (to("hall"),))),
        block(Together((to("hall"), block(Wait(seconds=1.0))))),
        block(Group((to("hall"),), always=(to("hall"),), when=(Handler(PRESSED, (to("hall"),)),), holds=HOLDING)),
        block(Ask(Template("q"), {"a": (to("hall"),), "b": (to("hall"),)})),
        block(Wait(LOOK)),
        block(Check(LOOK)),
        block(Dock()),
        block(Speak(Template("hello"))),
    )
    tree = compiled_steps(*steps, *steps)
    assert len(set(tree.path_ids)) == len(tree.path_ids) > 200


def keys_of_reads(tree, name):
    """The blackboard keys under which the nodes of a tree read a value."""
    found = []
    for node in tree.root.walk():
        keys = node.options.get("keys") or getattr(node.options.get("decision"), "keys", {})
        found += [keys[name]] if name in keys else []
    return found


def test_a_loop_reads_the_answer_that_its_own_steps_change(compiled_steps):
    question = block(Ask(Template("how many?"), match="number", gives="n"))
    loop = block(Repeat((block(Speak(Template("{n}"))), put(n="n + 1")), while_=ValueIs(Expression("n < 5"))))
    tree = compiled_steps(question, loop, block(Speak(Template("{n}"))))
    assert len(keys_of_reads(tree, "n")) >= 3
    assert len(set(keys_of_reads(tree, "n"))) == 1


def test_a_count_that_a_round_lowers_may_fall_below_zero(compiled_steps):
    count = MissionStep((replace(LOOK.command, object_count=0),), gives={"count": "n"})
    assert compiled_steps(count, block(Repeat((put(n="n - 1"),), until=ValueIs(Expression("n < 0")))))
    assert compiled_steps(count, block(Repeat((put(n="n - 1"),), while_=ValueIs(Expression("n > -3")))))
