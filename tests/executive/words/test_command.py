import dataclasses

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.words.command import SPEAKER, Command, parse_command, parse_object
from executive.words.task import installed_tasks, task_named
from skills.api import ObjectKind
from skills.relations import ORDERS, PARTS, ROWS, Landmark, Relation, RelationKind
from tests.tables import table

KINDS = {"item", "object"}


def command_of(values):
    """Command of plain values: an object as its name and attributes, a task as its value."""
    objects = {key: ObjectKind(values[key][0], *map(tuple, values[key][1:])) for key in KINDS & values.keys()}
    task = {"task": task_named(values["task"])} if "task" in values else {}
    return Command(**values | objects | task)


FOLLOW = {"task": "follow", "object": [SPEAKER]}, "Take [Nothing] to [Nothing] and do [follow] to [speaker]"


@pytest.mark.parametrize(*table(__file__, "text_forms", FOLLOW))
def test_text_form_parses_back(command, text):
    command = command_of(command)
    assert (str(command), parse_command(text)) == (text, dataclasses.replace(command, verb=""))


@pytest.mark.parametrize(*table(__file__, "related"))
def test_relations_parse_back(text):
    assert str(parse_command(text)) == text


@pytest.mark.parametrize(*table(__file__, "wrong_relations"))
def test_wrong_relations_are_refused(text, says):
    with pytest.raises(ValueError, match=says):
        parse_command(text)


def test_a_spot_belongs_to_a_goal_that_is_no_person_at_a_place():
    edge = (Relation(RelationKind.EDGE),)
    with pytest.raises(ValueError, match="a goal is missing at at the edge"):
        Command(goal_relations=edge)
    with pytest.raises(ValueError, match="goes with a surface"):
        Command(goal="Robin", goal_at="hall", goal_relations=edge)


WORDS = st.lists(
    st.sampled_from(["red", "cup", "some", "2", "Nothing", "at", "juice", "biggest", "of", "Zoë"]), min_size=1
)
NAMES = st.one_of(WORDS.map(" ".join), st.from_regex(r"[^\[\]\"\s]+( [^\[\]\"\s]+){0,3}", fullmatch=True))
ATTRIBUTES = st.from_regex(r"[^\[\]\"\s\d]+", fullmatch=True).filter(lambda word: word != "some")
LANDMARKS = st.builds(Landmark, NAMES, st.lists(ATTRIBUTES, max_size=1).map(tuple))


def related(kind, landmarks, nth):
    count = 0 if kind in PARTS | ROWS else 2 if kind is RelationKind.BETWEEN else 1
    return Relation(kind, tuple(landmarks[:count]), nth if kind in ROWS else 1)


RELATIONS = st.builds(
    related, st.sampled_from(RelationKind), st.lists(LANDMARKS, min_size=2, max_size=2), st.integers(1, 30)
)


def group(relation):
    """Relations of which a command has one at most."""
    return "part" if relation.kind in PARTS else "order" if relation.kind in ORDERS else relation.kind


RELATED = st.lists(RELATIONS, max_size=2, unique_by=group).map(tuple)
THINGS = st.builds(ObjectKind, NAMES, st.lists(ATTRIBUTES, max_size=2).map(tuple), st.just(()) | RELATED)


@st.composite
def commands(draw):
    item, target, goal = (draw(st.none() | kind) for kind in (THINGS, THINGS, NAMES))
    spot = () if goal in (None, "Nothing") else draw(st.just(()) | RELATED)
    return Command(
        item=item,
        goal=goal,
        goal_at=None if goal is None or spot else draw(st.none() | NAMES),
        goal_relations=spot,
        task=draw(st.none() | st.sampled_from([*installed_tasks().values()])),
        object=target,
        item_count=1 if item is None else draw(st.integers(0, 99)),
        object_count=1 if target is None else draw(st.integers(0, 99)),
    )


def test_a_name_that_ends_in_a_comma_is_no_beginning_of_a_relation():
    beside = (Relation(RelationKind.NEXT_TO, (Landmark("cup"),)),)
    command = Command(object=ObjectKind(",", (), beside), goal="here,", goal_relations=(Relation(RelationKind.EDGE),))
    assert parse_command(str(command)) == command


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(commands())
def test_every_command_parses_back_from_its_text(command):
    assert parse_command(str(command)) == command


@given(commands())
def test_json_keeps_the_text_form_of_plain_names(command):
    values = command.to_json()
    goal = None if command.goal is None else " ".join((command.goal, *map(str, command.goal_relations)))
    assert (values["goal"], values["goal_at"]) == (goal, command.goal_at)
    assert (values["item"] is None) == (command.item is None)


def test_json_has_null_for_nothing_and_zero_for_its_count():
    command = Command(
        goal="kitchen", task=task_named("grasp"), object=ObjectKind("wrench", ("red",)), object_count=2, verb="get"
    )
    there = {"goal": "kitchen", "task": "grasp", "object": "red wrench", "object_count": 2, "verb": "get"}
    assert command.to_json() == there | {"item": None, "goal_at": None, "item_count": 0}


@pytest.mark.parametrize(*table(__file__, "no_commands"))
def test_text_that_is_no_command_is_refused(text, says):
    with pytest.raises(ValueError, match=says):
        parse_command(text)


@pytest.mark.parametrize(*table(__file__, "no_text_form"))
def test_a_command_that_has_no_text_form_cannot_be_made(wrong):
    with pytest.raises(ValueError):
        command_of(wrong)


@pytest.mark.parametrize(*table(__file__, "attributes"))
def test_leading_attributes_are_split_off_an_object(words, name, attributes):
    assert parse_object(words) == ObjectKind(name, tuple(attributes))
