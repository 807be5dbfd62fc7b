"""How blocks are compiled: which names and types are known where, what is in the gripper, what cannot go together."""

import pytest
import yaml

from executive.tree.compiler import compile_mission
from executive.words.mission import Mission
from skills.inputs.errors import InputError
from tests.tables import yaml_beside

TABLE = yaml_beside(__file__, "assembly.yaml")
GO, READS_X = {"to": "hall"}, {"check": "x > 0"}
TAKE, BEER = ({"to": "kitchen", "do": "grasp", "object": name} for name in ("coke", "beer"))
QUESTION = {"ask": "how many?", "match": "number", "gives": {"answer": "n"}}


@pytest.fixture
def compiled_steps(knowledge, registry):
    def compile_steps(*steps, **more):
        mission = Mission.model_validate({"name": "m", "robot": "Alice", "steps": steps, **more})
        return compile_mission(mission, knowledge=knowledge, registry=registry)

    return compile_steps


@pytest.fixture
def refusal(compiled_steps):
    def message(*steps, **more):
        with pytest.raises(InputError) as error:
            compiled_steps(*steps, **more)
        assert error.value.hint
        return error.value.message

    return message


# Names: known after it where all ways through it give them.


@pytest.mark.parametrize("steps", TABLE["given"].values(), ids=TABLE["given"])
def test_names_that_are_surely_given_are_known_afterwards(compiled_steps, steps):
    assert compiled_steps(*steps, READS_X)


@pytest.mark.parametrize("steps", TABLE["not_surely_given"].values(), ids=TABLE["not_surely_given"])
def test_names_that_may_lack_a_value_are_refused_afterwards(compiled_steps, refusal, steps):
    assert "unknown name 'x'" in refusal(*steps, READS_X)
    assert compiled_steps(*steps, READS_X, variables={"x": 0})


@pytest.mark.parametrize("steps", TABLE["read_too_early"], ids=str)
def test_a_name_is_not_known_before_it_is_given(refusal, steps):
    assert "unknown name 'x'" in refusal(*steps)


def test_until_reads_what_the_round_has_given(compiled_steps):
    assert compiled_steps({"repeat": {"until": "x > 0"}, "steps": [{"set": {"x": 1}}]})


# Types: a name keeps its type, since steps may be repeated and interrupted.


@pytest.mark.parametrize("steps", TABLE["of_two_types"], ids=str)
def test_a_name_with_two_types_is_refused(refusal, steps):
    assert "'x' is elsewhere number, and gets" in refusal(*steps)


def test_a_declared_name_keeps_its_type(refusal):
    assert "'x' is declared as text, and gets number" in refusal({"set": {"x": 1}}, variables={"x": "a"})


@pytest.mark.parametrize("name", ["battery", "clock", "true", "a b", "1a"])
def test_names_that_cannot_be_given(refusal, name):
    assert "cannot be the name of a value" in refusal({"set": {name: 1}})


def test_the_answer_of_a_question_has_the_type_of_what_is_asked_for(compiled_steps, refusal):
    assert compiled_steps(QUESTION, {"check": "n + 1 > 2"})
    assert "compares number with text" in refusal(QUESTION, {"check": "n == 'two'"})


def test_names_in_texts_are_checked(compiled_steps, refusal):
    assert compiled_steps({"set": {"x": 1}}, {"speak": "{x}"})
    assert "unknown name 'y'" in refusal({"set": {"x": 1}}, {"speak": "{y}"})
    assert "unknown name 'y'" in refusal({"ask": "{y}?"})


# The gripper, as the steps after it are told.


def held(part):
    """What the gripper holds before a step and whether that is sure, and whether it is open at first."""
    return None if part.held is None else (part.held.sure, str(part.held.kind)), part.opening


@pytest.mark.parametrize("steps", TABLE["held"], ids=str)
def test_the_gripper_after_a_block_that_surely_takes_something(compiled_steps, steps):
    assert held(compiled_steps(*steps, {"to": "bathroom"}).parts[-1]) == ((True, "coke"), False)


@pytest.mark.parametrize("steps", TABLE["perhaps_held"], ids=str)
def test_the_gripper_after_a_block_that_may_take_something_is_unsure(compiled_steps, steps):
    part = compiled_steps(*steps, {"to": "bathroom"}).parts[-1]
    assert (part.held.sure, part.opening) == (False, False)


@pytest.mark.parametrize(("rounds", "unsure"), [("times: 1", False), ("times: 2", True), ("until: holding", True)])
def test_a_round_may_begin_with_what_the_one_before_has_taken(compiled_steps, rounds, unsure):
    tree = compiled_steps({"repeat": yaml.safe_load(rounds), "steps": [TAKE]})
    (part,) = tree.parts
    assert (part.held is not None and not part.held.sure) is unsure
    assert any(node.name == "the coke is in the gripper" for node in tree.root.walk()) is unsure


@pytest.mark.parametrize(("then", "counts"), [(TAKE, True), (BEER, False)])
def test_an_object_that_a_branch_may_have_grasped_is_not_certain(compiled_steps, then, counts):
    """A coke that may be in the gripper is no beer."""
    tree = compiled_steps({"if": "holding", "then": [TAKE]}, then)
    assert any(node.kind == "only if holding" and "in-gripper" in node.path_id for node in tree.root.walk()) is counts


def test_an_object_taken_before_a_block_is_held_in_its_branches(compiled_steps):
    branches = {"then": [{"take": "coke", "to": "kitchen"}], "else": [{"to": "bathroom"}]}
    tree = compiled_steps(TAKE, {"if": "holding", **branches})
    assert [held(part)[0] for part in tree.parts[-2:]] == [(True, "coke")] * 2


# Together, and what is watched.


@pytest.mark.parametrize("steps", TABLE["in_conflict"], ids=str)
def test_steps_that_use_the_same_part_of_the_robot_cannot_go_together(refusal, steps):
    assert "steps 1 and 2 both use the" in refusal({"together": steps})


@pytest.mark.parametrize("step", TABLE["beside_a_drive"], ids=str)
def test_steps_that_use_nothing_in_common_can_go_together(compiled_steps, step):
    tree = compiled_steps({"together": [GO, step]})
    assert any(node.kind == "together" for node in tree.root.walk())


@pytest.mark.parametrize("watched", TABLE["watched_looks"], ids=str)
def test_a_monitored_condition_cannot_take_a_look(refusal, watched):
    assert "takes a look, and cannot be watched" in refusal({"group": [GO], **watched})
    assert "takes a look, and cannot be watched" in refusal(GO, **watched)


@pytest.mark.parametrize("step", TABLE["endless"], ids=str)
def test_rounds_that_never_end_are_refused(compiled_steps, refusal, step):
    assert "nothing in a round changes whether" in refusal(step, variables={"x": 0})
    assert compiled_steps({**step, "timeout": 9}, variables={"x": 0})


@pytest.mark.parametrize("step", TABLE["with_an_end"], ids=str)
def test_rounds_that_may_end_are_taken(compiled_steps, step):
    assert compiled_steps(step, variables={"x": 0})


def test_a_world_without_a_dock(knowledge, registry):
    bare, mission = (
        knowledge.model_copy(update={"dock": None}),
        Mission.model_validate({"name": "m", "steps": ["dock"]}),
    )
    with pytest.raises(InputError, match="no dock"):
        compile_mission(mission, knowledge=bare, registry=registry)


def test_path_ids_are_unique_through_all_blocks(compiled_steps):
    tree = compiled_steps(*TABLE["every_block"] * 2)
    assert len(set(tree.path_ids)) == len(tree.path_ids) > 200


def keys_of_reads(tree, name):
    """The blackboard keys under which the nodes of a tree read a value."""
    options = [node.options for node in tree.root.walk()]
    read = [each.get("keys") or getattr(each.get("decision"), "keys", {}) for each in options]
    return [keys[name] for keys in read if name in keys]


def test_a_loop_reads_the_answer_that_its_own_steps_change(compiled_steps):
    say = {"speak": "{n}"}
    tree = compiled_steps(QUESTION, {"repeat": {"while": "n < 5"}, "steps": [say, {"set": {"n": "n + 1"}}]}, say)
    assert len(keys_of_reads(tree, "n")) >= 3
    assert len(set(keys_of_reads(tree, "n"))) == 1


@pytest.mark.parametrize("ends", [{"until": "n < 0"}, {"while": "n > -3"}])
def test_a_count_that_a_round_lowers_may_fall_below_zero(compiled_steps, ends):
    count = {"do": "find", "object": "some beer", "to": "kitchen", "gives": {"count": "n"}}
    assert compiled_steps(count, {"repeat": ends, "steps": [{"set": {"n": "n - 1"}}]})
