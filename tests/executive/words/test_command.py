import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.words.command import SPEAKER, Command, Task, parse_command, parse_object
from skills.api import ObjectKind

TEXT_FORMS = [
    (Command(), "Take [Nothing] to [Nothing] and do [Nothing] to [Nothing]"),
    (
        Command(goal="kitchen", task=Task.GRASP, object=ObjectKind("drink"), verb="fetch"),
        "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
    ),
    (Command(item=ObjectKind("drink"), goal="start"), "Take [drink] to [start] and do [Nothing] to [Nothing]"),
    (
        Command(goal="workshop", task=Task.GRASP, object=ObjectKind("wrench", ("red",)), object_count=2),
        "Take [Nothing] to [workshop] and do [grasp] to [2 red wrench]",
    ),
    (
        Command(item=ObjectKind("wrench", ("red",)), item_count=2, goal="Robin", goal_at="entrance"),
        "Take [2 red wrench] to [Robin at entrance] and do [Nothing] to [Nothing]",
    ),
    (
        Command(goal="kitchen counter", task=Task.FIND, object=ObjectKind("cokes"), object_count=0),
        "Take [Nothing] to [kitchen counter] and do [find] to [some cokes]",
    ),
    (
        Command(item=ObjectKind("apple juice"), goal="desk"),
        "Take [apple juice] to [desk] and do [Nothing] to [Nothing]",
    ),
    (Command(task=Task.FOLLOW, object=ObjectKind(SPEAKER)), "Take [Nothing] to [Nothing] and do [follow] to [speaker]"),
    (
        Command(goal="living room", task=Task.GREET, object=ObjectKind("person"), object_count=0),
        "Take [Nothing] to [living room] and do [greet] to [some person]",
    ),
    (Command(item=ObjectKind("red wine"), goal="desk"), 'Take ["red wine"] to [desk] and do [Nothing] to [Nothing]'),
    (
        Command(item=ObjectKind("cup", ("ceramic",)), goal="desk"),
        'Take [ceramic "cup"] to [desk] and do [Nothing] to [Nothing]',
    ),
]


@pytest.mark.parametrize(("command", "text"), TEXT_FORMS)
def test_text_form(command, text):
    assert str(command) == text


@pytest.mark.parametrize(("command", "text"), TEXT_FORMS)
def test_text_form_parses_back(command, text):
    assert parse_command(text) == Command(**{**command.__dict__, "verb": ""})


WORDS = st.lists(
    st.sampled_from(["red", "cup", "some", "2", "Nothing", "at", "juice", "biggest", "of", "Zoë"]), min_size=1
)
NAMES = st.one_of(WORDS.map(" ".join), st.from_regex(r"[^\[\]\"\s]+( [^\[\]\"\s]+){0,3}", fullmatch=True))
ATTRIBUTES = st.from_regex(r"[^\[\]\"\s\d]+", fullmatch=True).filter(lambda word: word != "some")
THINGS = st.builds(ObjectKind, NAMES, st.lists(ATTRIBUTES, max_size=2).map(tuple))


@st.composite
def commands(draw):
    item, target, goal = (draw(st.none() | kind) for kind in (THINGS, THINGS, NAMES))
    return Command(
        item=item,
        goal=goal,
        goal_at=None if goal is None else draw(st.none() | NAMES),
        task=draw(st.none() | st.sampled_from(Task)),
        object=target,
        item_count=1 if item is None else draw(st.integers(0, 99)),
        object_count=1 if target is None else draw(st.integers(0, 99)),
    )


@given(commands())
def test_every_command_parses_back_from_its_text(command):
    assert parse_command(str(command)) == command


@given(commands())
def test_json_keeps_the_text_form_of_plain_names(command):
    values = command.to_json()
    assert values["goal"] == command.goal
    assert (values["item"] is None) == (command.item is None)
    assert Command.from_json(values).goal_at == command.goal_at


def test_json_has_null_for_nothing_and_zero_for_its_count():
    values = Command(
        goal="kitchen", task=Task.GRASP, object=ObjectKind("wrench", ("red",)), object_count=2, verb="get"
    ).to_json()
    assert values == {
        "item": None,
        "goal": "kitchen",
        "goal_at": None,
        "task": "grasp",
        "object": "red wrench",
        "item_count": 0,
        "object_count": 2,
        "verb": "get",
    }


def test_json_reads_back():
    command = Command(item=ObjectKind("wrench", ("red",)), item_count=2, goal="Robin", goal_at="hall", verb="bring")
    assert Command.from_json(command.to_json()) == command


@pytest.mark.parametrize(
    "text",
    [
        "",
        "fetch me a drink",
        "Take [] to [kitchen] and do [grasp] to [drink]",
        "Take [Nothing] to [kitchen] and do [juggle] to [drink]",
        "Take [Nothing] to [kitchen] and do [grasp] to [drink] or so",
    ],
)
def test_text_that_is_no_command_is_refused(text):
    with pytest.raises(ValueError):
        parse_command(text)


def test_an_unknown_task_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="known are grasp, find, place"):
        parse_command("Take [Nothing] to [kitchen] and do [juggle] to [drink]")


@pytest.mark.parametrize(
    "wrong",
    [
        {"goal": "kit[chen"},
        {"goal": ""},
        {"item": ObjectKind('a "b"')},
        {"item": ObjectKind("cup", ("very  red",))},
        {"item": ObjectKind("cup", ("2",))},
        {"item": ObjectKind("cup"), "item_count": -1},
        {"item_count": 2},
        {"goal_at": "hall"},
    ],
)
def test_a_command_that_has_no_text_form_cannot_be_made(wrong):
    with pytest.raises(ValueError):
        Command(**wrong)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("red wrench", ObjectKind("wrench", ("red",))),
        ("big red wrench", ObjectKind("wrench", ("big", "red"))),
        ("coffee cup", ObjectKind("coffee cup")),
        ("biggest snack", ObjectKind("snack", ("biggest",))),
        ("orange", ObjectKind("orange")),
    ],
)
def test_leading_attributes_are_split_off_an_object(words, expected):
    assert parse_object(words) == expected
