"""How blocks are compiled: which names and types are known where, what is in the gripper, what cannot go together."""

from dataclasses import replace

import pytest

from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import ButtonPressed, Condition, Look, Not, ValueIs
from executive.words.leaf_steps import Awaited, CallSkill, Check, Do, Dock, Set, Speak, Wait
from executive.words.mission import Mission
from executive.words.policy import OnFailure, Policy
from executive.words.steps import Ask, Choose, Group, Handler, Loop, Repeat, Together, Try, While
from skills.files.errors import InputError

HOLDING, PRESSED = ValueIs(text="holding"), ButtonPressed(button="go")
LOOK = Look.from_command(parse_command("Take [Nothing] to [kitchen] and do [find] to [beer]"))
TAKE = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
BRING = "Take [coke] to [kitchen] and do [Nothing] to [Nothing]"


def block(made, policy=None):
    return made.with_policy(policy)


def go(text):
    return Do.from_command(parse_command(text))


def to(place):
    return go(f"Take [Nothing] to [{place}] and do [Nothing] to [Nothing]")


def put(**values):
    return block(Set(set={name: str(value) for name, value in values.items()}))


def reads(text):
    """A step that is only right where the names in `text` are known."""
    return block(Check(condition=ValueIs(text=text)))


@pytest.fixture
def compiled_steps(knowledge, registry, make):
    registry["speak"] = make.scripted_skill(make.Script(), "speak", *SPEAK)

    def compile_steps(*steps, **more):
        mission = Mission(name="m", robot="Alice", steps=steps, **more)
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
    "in both branches": block(Choose(condition=CONDITION, then=(put(x=1),), otherwise=(put(x=2),))),
    "in every round": block(Repeat(loop=Loop(times=2), steps=(put(x=1),))),
    "in a round before until": block(Repeat(loop=Loop(until=HOLDING), steps=(put(x=1),))),
    "both times of a try": block(Try(steps=(put(x=1),), otherwise=(put(x=2),))),
    "in a group": block(Group(steps=(put(x=1),))),
    "beside another": block(Together(steps=(put(x=1), block(Wait(awaited=Awaited(seconds=1.0)))))),
    "by every answer": block(Ask(ask="q", choices={"a": (put(x=1),), "b": (put(x=2),)})),
    "as an answer": block(Ask(ask="q", match="number", gives={"answer": "x"})),
    "by a skipped step beside it": block(
        Group(steps=(put(x=1), block(Dock(), policy=Policy(on_failure=OnFailure.SKIP))))
    ),
}
NOT_SURELY_GIVEN = {
    "in then alone": block(Choose(condition=CONDITION, then=(put(x=1),))),
    "in else alone": block(Choose(condition=CONDITION, then=(to("hall"),), otherwise=(put(x=1),))),
    "with two types": block(Choose(condition=CONDITION, then=(put(x=1),), otherwise=(put(y="true"),))),
    "in rounds of while": block(Repeat(loop=Loop(while_=HOLDING), steps=(put(x=1),))),
    "in try alone": block(Try(steps=(put(x=1),), otherwise=(to("hall"),))),
    "in one of two beside each other": block(
        Together(steps=(put(x=1), block(Wait(awaited=Awaited(seconds=1.0)))), done_when=1)
    ),
    "by one answer": block(Ask(ask="q", choices={"a": (put(x=1),), "b": ()})),
    "in a handler": block(Group(steps=(to("hall"),), when=(Handler(condition=PRESSED, steps=(put(x=1),)),))),
    "by what may be skipped": block(Group(steps=(put(x=1),)), policy=Policy(on_failure=OnFailure.SKIP)),
    "by what is asked about": block(Group(steps=(put(x=1),)), policy=Policy(on_failure=OnFailure.ASK)),
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
        Group(steps=(to("hall"),), always=(reads("x > 0"),)),
        Group(steps=(put(y=1), to("hall"), put(x=1)), always=(reads("x > 0"),)),
        Group(steps=(put(x=1),), when=(Handler(condition=PRESSED, steps=(reads("x > 0"),)),)),
        Group(steps=(put(x=1),), while_=While(holds=ValueIs(text="x > 0"))),
        Repeat(loop=Loop(while_=ValueIs(text="x > 0")), steps=(put(x=1),)),
        Try(steps=(put(x=1),), otherwise=(reads("x > 0"),)),
        Together(steps=(put(x=1), reads("x > 0"))),
        Choose(condition=ValueIs(text="x > 0"), then=(put(x=1),)),
    ],
)
def test_a_name_is_not_known_before_it_is_given(refusal, made):
    assert "unknown name 'x'" in refusal(block(made))


def test_until_reads_what_the_round_has_given(compiled_steps):
    assert compiled_steps(block(Repeat(loop=Loop(until=ValueIs(text="x > 0")), steps=(put(x=1),))))


# Types: a name keeps its type, since steps may be repeated and interrupted.


@pytest.mark.parametrize(
    "steps",
    [
        (put(x=1), put(x="'a'")),
        (put(x=1), block(Repeat(loop=Loop(times=2), steps=(reads("x + 1 > 0"), put(x="'a'"))))),
        (put(x=1), block(Try(steps=(put(x="'a'"), to("hall")), otherwise=(reads("x + 1 > 0"),)))),
        (
            put(x=1),
            block(Group(steps=(to("hall"), reads("x > 0")), when=(Handler(condition=PRESSED, steps=(put(x="'a'"),)),))),
        ),
        (block(Choose(condition=HOLDING, then=(put(x=1),), otherwise=(put(x="true"),))),),
    ],
)
def test_a_name_with_two_types_is_refused(refusal, steps):
    assert "'x' is elsewhere number, and gets" in refusal(*steps)


def test_a_declared_name_keeps_its_type(refusal):
    assert "'x' is declared as text, and gets number" in refusal(put(x=1), variables={"x": "a"})


@pytest.mark.parametrize("name", ["battery", "clock", "true", "a b", "1a"])
def test_names_that_cannot_be_given(refusal, name):
    assert "cannot be the name of a value" in refusal(block(Set(set={name: "1"})))


def test_the_answer_of_a_question_has_the_type_of_what_is_asked_for(compiled_steps, refusal):
    question = block(Ask(ask="how many?", match="number", gives={"answer": "n"}))
    assert compiled_steps(question, reads("n + 1 > 2"))
    assert "compares number with text" in refusal(question, reads("n == 'two'"))


def test_names_in_texts_are_checked(compiled_steps, refusal):
    assert compiled_steps(put(x=1), block(Speak(speak="{x}")))
    assert "unknown name 'y'" in refusal(put(x=1), block(Speak(speak="{y}")))
    assert "unknown name 'y'" in refusal(block(Ask(ask="{y}?")))


# The gripper, as the steps after it are told.


def held(tree, number):
    """What the gripper holds before the last step, and whether that is what it held at first."""
    part = tree.parts[number]
    return (None if part.held is None else (part.held.sure, str(part.held.kind))), part.opening


@pytest.mark.parametrize(
    ("steps", "holds"),
    [
        ((go(TAKE),), (True, "coke")),
        ((block(Group(steps=(go(TAKE),))),), (True, "coke")),
        ((block(Choose(condition=HOLDING, then=(go(TAKE),), otherwise=(go(TAKE),))),), (True, "coke")),
    ],
)
def test_the_gripper_after_a_block_that_surely_takes_something(compiled_steps, holds, steps):
    tree = compiled_steps(*steps, to("bathroom"))
    assert held(tree, -1) == (holds, False)


@pytest.mark.parametrize(
    "made",
    [
        Choose(condition=HOLDING, then=(go(TAKE),)),
        Repeat(loop=Loop(times=2), steps=(go(TAKE),)),
        Try(steps=(go(TAKE),), otherwise=(to("hall"),)),
        Together(steps=(go(TAKE), block(Wait(awaited=Awaited(seconds=1.0)))), done_when=1),
        Ask(ask="q", choices={"a": (go(TAKE),), "b": ()}),
    ],
)
def test_the_gripper_after_a_block_that_may_take_something_is_unsure(compiled_steps, made):
    tree = compiled_steps(block(made), to("bathroom"))
    part = tree.parts[-1]
    assert part.held is not None
    assert (part.held.sure, part.opening) == (False, False)


@pytest.mark.parametrize(("times", "unsure"), [(1, False), (2, True), (None, True)])
def test_a_round_may_begin_with_what_the_one_before_has_taken(compiled_steps, times, unsure):
    tree = compiled_steps(block(Repeat(loop=Loop(times=times, until=None if times else HOLDING), steps=(go(TAKE),))))
    (part,) = tree.parts
    assert (part.held is not None and not part.held.sure) is unsure
    assert any(node.name == "the coke is in the gripper" for node in tree.root.walk()) is unsure


BEER = "Take [Nothing] to [kitchen] and do [grasp] to [beer]"


@pytest.mark.parametrize(("then", "counts"), [(TAKE, True), (BEER, False)])
def test_an_object_that_a_branch_may_have_grasped_is_not_certain(compiled_steps, then, counts):
    """A coke that may be in the gripper is no beer."""
    tree = compiled_steps(block(Choose(condition=HOLDING, then=(go(TAKE),))), go(then))
    assert any(node.kind == "only if holding" and "in-gripper" in node.path_id for node in tree.root.walk()) is counts


def test_an_object_taken_before_a_block_is_held_in_its_branches(compiled_steps):
    tree = compiled_steps(go(TAKE), block(Choose(condition=HOLDING, then=(go(BRING),), otherwise=(to("bathroom"),))))
    assert [held(tree, n)[0] for n in (-2, -1)] == [(True, "coke")] * 2


# Together, and what is watched.


def skill(name, **values):
    return CallSkill(skill=name, values=values)


@pytest.mark.parametrize(
    "steps",
    [
        (to("hall"), to("kitchen")),
        (
            to("hall"),
            block(
                Group(
                    steps=(
                        block(Wait(awaited=Awaited(seconds=1.0))),
                        block(Choose(condition=HOLDING, then=(to("hall"),))),
                    )
                )
            ),
        ),
        (to("hall"), block(Choose(condition=LOOK, then=(block(Wait(awaited=Awaited(seconds=1.0))),)))),
        (to("hall"), block(Wait(awaited=Awaited(condition=LOOK)))),
        (to("hall"), block(Dock())),
        (
            block(Try(steps=(block(Wait(awaited=Awaited(seconds=1.0))),), otherwise=(to("hall"),))),
            block(Repeat(loop=Loop(times=2), steps=(to("hall"),))),
        ),
        (to("hall"), block(Group(steps=(block(Wait(awaited=Awaited(seconds=1.0))),), always=(to("hall"),)))),
        (
            to("hall"),
            block(
                Group(
                    steps=(block(Wait(awaited=Awaited(seconds=1.0))),),
                    when=(Handler(condition=PRESSED, steps=(to("hall"),)),),
                )
            ),
        ),
    ],
)
def test_steps_that_use_the_same_part_of_the_robot_cannot_go_together(refusal, steps):
    assert "steps 1 and 2 both use the" in refusal(block(Together(steps=steps)))


@pytest.mark.parametrize(
    "other",
    [
        block(Wait(awaited=Awaited(seconds=1.0))),
        block(Wait(awaited=Awaited(condition=PRESSED))),
        block(Ask(ask="q", choices={"a": ()})),
        block(Check(condition=HOLDING)),
        block(Repeat(loop=Loop(times=3), steps=(block(Wait(awaited=Awaited(seconds=1.0))),))),
    ],
)
def test_steps_that_use_nothing_in_common_can_go_together(compiled_steps, other):
    tree = compiled_steps(block(Together(steps=(to("hall"), other))))
    assert any(node.kind == "together" for node in tree.root.walk())


@pytest.mark.parametrize(
    "made",
    [
        Group(steps=(to("hall"),), while_=While(holds=LOOK)),
        Group(steps=(to("hall"),), while_=While(holds=Not(part=LOOK))),
        Group(
            steps=(to("hall"),),
            when=(Handler(condition=PRESSED, steps=(to("hall"),)), Handler(condition=LOOK, steps=(to("hall"),))),
        ),
    ],
)
def test_a_monitored_condition_cannot_take_a_look(refusal, made):
    assert "takes a look, and cannot be watched" in refusal(block(made))
    assert "takes a look, and cannot be watched" in refusal(to("hall"), while_=made.while_, when=made.when)


@pytest.mark.parametrize(
    ("made", "endless"),
    [
        (Repeat(loop=Loop(until=ValueIs(text="x > 1")), steps=(to("hall"),)), True),
        (Repeat(loop=Loop(until=ValueIs(text="x > 1")), steps=(put(x=1),)), False),
        (Repeat(loop=Loop(until=ValueIs(text="x > 1")), steps=(block(Group(steps=(put(x=1),))),)), False),
        (Repeat(loop=Loop(until=ValueIs(text="x > 1 or battery < 0.1")), steps=(to("hall"),)), False),
        (Repeat(loop=Loop(times=3, until=ValueIs(text="x > 1")), steps=(to("hall"),)), False),
        (Repeat(loop=Loop(until=PRESSED), steps=(to("hall"),)), False),
        (Repeat(loop=Loop(while_=LOOK), steps=(to("hall"),)), False),
    ],
)
def test_rounds_that_never_end_are_refused(compiled_steps, refusal, made, endless):
    if endless:
        assert "nothing in a round changes whether" in refusal(block(made), variables={"x": 0})
        assert compiled_steps(block(made, policy=Policy(timeout_s=9.0)), variables={"x": 0})
    else:
        assert compiled_steps(block(made), variables={"x": 0})


def test_a_world_without_a_dock(compiled_steps, knowledge, registry):
    bare = knowledge.model_copy(update={"dock": None})
    mission = Mission(name="m", robot="Alice", steps=(block(Dock()),))
    with pytest.raises(InputError, match="no dock"):
        compile_mission(mission, knowledge=bare, registry=registry)


def test_path_ids_are_unique_through_all_blocks(compiled_steps):
    steps = (
        block(Choose(condition=LOOK, then=(to("hall"),), otherwise=(to("kitchen"),))),
        block(Repeat(loop=Loop(until=LOOK), steps=(to("hall"), to("hall")))),
        block(Try(steps=(to("hall"),), otherwise=(to("hall"),))),
        block(Together(steps=(to("hall"), block(Wait(awaited=Awaited(seconds=1.0)))))),
        block(
            Group(
                steps=(to("hall"),),
                always=(to("hall"),),
                while_=While(holds=HOLDING),
                when=(Handler(condition=PRESSED, steps=(to("hall"),)),),
            )
        ),
        block(Ask(ask="q", choices={"a": (to("hall"),), "b": (to("hall"),)})),
        block(Wait(awaited=Awaited(condition=LOOK))),
        block(Check(condition=LOOK)),
        block(Dock()),
        block(Speak(speak="hello")),
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
    question = block(Ask(ask="how many?", match="number", gives={"answer": "n"}))
    loop = block(Repeat(loop=Loop(while_=ValueIs(text="n < 5")), steps=(block(Speak(speak="{n}")), put(n="n + 1"))))
    tree = compiled_steps(question, loop, block(Speak(speak="{n}")))
    assert len(keys_of_reads(tree, "n")) >= 3
    assert len(set(keys_of_reads(tree, "n"))) == 1


def test_a_count_that_a_round_lowers_may_fall_below_zero(compiled_steps):
    count = Do.from_command(replace(LOOK.command, object_count=0)).model_copy(update={"gives": {"count": "n"}})
    assert compiled_steps(count, block(Repeat(loop=Loop(until=ValueIs(text="n < 0")), steps=(put(n="n - 1"),))))
    assert compiled_steps(count, block(Repeat(loop=Loop(while_=ValueIs(text="n > -3")), steps=(put(n="n - 1"),))))
