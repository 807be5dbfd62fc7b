"""Names of commands that a world does not have, by the kinds of the parts of their tasks."""

import pytest

from executive.mission.world_names import in_world_names, unknown_names
from executive.words.command import Command, parse_command
from executive.words.task import Part
from skills.api import ObjectKind
from tests.executive.house_tasks import Call, Vacuum, tasks_installed


#   kind of a task's object, the object that a command names, what is wrong with it
@pytest.mark.parametrize(
    ("kind", "said", "wrong"),
    [
        (Part.TIME, "90 second", ""),
        (Part.TIME, "hammer", "'hammer' is no time"),
        (Part.NUMBER, "three", ""),
        (Part.NUMBER, "hammer", "'hammer' is no number"),
        (Part.TEXT, "lunch is ready", ""),
        (Part.PLACE, "kitchen", ""),
        (Part.PLACE, "kitchn", "unknown place 'kitchn'"),
        (Part.THING, "kitchen", "unknown object 'kitchen'"),
    ],
)
def test_the_object_of_a_task_is_compared_with_what_its_kind_may_be(house_tasks, knowledge, kind, said, wrong):
    house_tasks["cry"] = type("Cry", (Call,), {"word": "cry", "object_is": kind})()
    found = [
        what
        for _, what, _ in unknown_names(
            parse_command(f"Take [Nothing] to [Nothing] and do [cry] to [{said}]"), knowledge
        )
    ]
    assert found == [wrong] * bool(wrong)


def own(goal_is=Part.NOTHING, object_is=Part.NOTHING):
    """A task with such parts."""
    return type("Own", (Vacuum,), {"word": "own", "goal_is": goal_is, "object_is": object_is, "needs_goal": False})()


#   kinds of the goal and the object, what is written for them, and what is said of it
@pytest.mark.parametrize(
    ("goal_is", "goal", "object_is", "named", "message"),
    [
        (Part.ROOM, "hall", Part.NOTHING, None, None),
        (Part.ROOM, "start", Part.NOTHING, None, None),
        (Part.ROOM, "desk", Part.NOTHING, None, "unknown room 'desk'"),
        (Part.PERSON, "Robin", Part.NOTHING, None, None),
        (Part.PERSON, "start", Part.NOTHING, None, None),
        (Part.PERSON, "hall", Part.NOTHING, None, "unknown person 'hall'"),
        (Part.NOTHING, None, Part.PLACE, "desk", None),
        (Part.NOTHING, None, Part.PLACE, "Robin", "unknown place 'Robin'"),
        (Part.NOTHING, None, Part.ROOM, "desk", "unknown room 'desk'"),
        (Part.NOTHING, None, Part.PERSON, "Robin", None),
        (Part.NOTHING, None, Part.PERSON, "Zoe", "unknown person 'Zoe'"),
    ],
)
def test_a_name_of_another_kind_than_the_part_is_refused(flat, goal_is, goal, object_is, named, message):
    task = own(goal_is, object_is)
    with tasks_installed(task):
        command = Command(goal=goal, task=task, object=None if named is None else ObjectKind(named))
        assert next((said for _, said, _ in unknown_names(command, flat)), None) == message


@pytest.mark.parametrize(("kind", "meant"), [(Part.TEXT, "lounge"), (Part.PLACE, "living room")])
def test_a_place_has_the_worlds_name_and_a_text_its_own(flat, kind, meant):
    task = own(object_is=kind)
    with tasks_installed(task):
        found = in_world_names(Command(task=task, object=ObjectKind("lounge")), flat)
    assert found.object.name == meant
