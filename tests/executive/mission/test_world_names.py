"""Names of commands that a world does not have, by the kinds of the parts of their tasks."""

import pytest

from executive.mission.world_names import unknown_names
from executive.words.command import parse_command
from executive.words.task import Part
from tests.executive.house_tasks import Call


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
