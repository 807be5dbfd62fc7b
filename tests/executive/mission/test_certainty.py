"""Conditions that always or never hold."""

from __future__ import annotations

import pytest

from executive.mission.certainty import refuse_certain, refuse_certain_comparisons
from executive.words.command import Command, Task
from executive.words.condition import RANGES, AllOf, AnyOf, ButtonPressed, Condition, Look, Not, ValueIs
from executive.words.expression import Expression, ExpressionError
from skills.api import ObjectKind
from skills.quantities import Tries

NAMES = {**RANGES, "count": Tries}


def value(text: str) -> ValueIs:
    return ValueIs(text=text)


LOOK = Look.from_command(Command(item=None, goal=None, task=Task.FIND, object=ObjectKind("beer")))


@pytest.mark.parametrize(
    ("text", "says", "hint"),
    [
        ("battery < 20", "'battery < 20' always holds: battery is from 0 to 1", "write 0.2 for 20 %"),
        ("battery > 30", "'battery > 30' cannot hold: battery is from 0 to 1", "write 0.3 for 30 %"),
        ("20 > battery", "'20 > battery' always holds", "write 0.2 for 20 %"),
        ("battery == 50", "cannot hold", "write 0.5 for 50 %"),
        ("battery != 50", "always holds", "write 0.5 for 50 %"),
        ("battery < -1", "cannot hold", "within this range"),
        ("battery > -1", "always holds", "within this range"),
        ("battery <= 1", "always holds", ""),
        ("battery < 0", "cannot hold", ""),
        ("battery * 100 < -1", "cannot hold", ""),
        ("battery + 1 < 20", "always holds", ""),
        ("-battery > 1", "cannot hold", ""),
        ("holding or battery < 20", "'battery < 20' always holds", ""),
        ("not (battery > 30)", "'battery > 30' cannot hold", ""),
        ("0.2 < battery < 20", "'battery < 20' always holds", ""),
        ("1 if battery > 30 else 2", "'battery > 30' cannot hold", ""),
        ("elapsed < -5", "cannot hold: elapsed is from 0 to 604800 s", ""),
        ("elapsed >= 0", "always holds", ""),
        ("count < 0", "cannot hold: count is from 0 to 1000", ""),
        ("count >= 0", "always holds", ""),
        ("length(drink) < 0", "cannot hold: length(drink) is 0 or more", ""),
        ("abs(n) >= 0", "always holds", ""),
        ('clock >= "00:00"', "always holds: clock is from 00:00 to 23:59", ""),
        ('clock < "00:00"', "cannot hold", ""),
    ],
)
def test_a_comparison_that_the_range_decides_is_refused(text: str, says: str, hint: str) -> None:
    with pytest.raises(ExpressionError) as error:
        refuse_certain_comparisons(Expression(text), NAMES)
    assert says in error.value.message
    assert hint in error.value.hint


@pytest.mark.parametrize(
    "text",
    [
        "battery < 0.2",
        "battery >= 1",
        "battery > 0",
        "battery * 100 < 20",
        "1 - battery > 0.8",
        "elapsed > 604799",
        "count > 0",
        "n < -1",
        "n > 1000000",
        "battery < limit",
        "min(battery, 1) < 2",
        'clock >= "18:00"',
        'clock < "00:01"',
        'drink == "08:30"',
        "5 > 3",
        "true",
    ],
)
def test_a_comparison_that_may_go_either_way_is_taken(text: str) -> None:
    refuse_certain_comparisons(Expression(text), NAMES)
    refuse_certain(value(text), NAMES)


@pytest.mark.parametrize(
    ("condition", "says"),
    [
        (value("battery > 0.5 and battery < 0.3"), "cannot hold"),
        (value("battery > 0.3 or battery < 0.5"), "always holds"),
        (value("n > 3 and n < 2"), "cannot hold"),
        (value("n > 3 or n <= 3"), "always holds"),
        (value("not (n > 3 or n <= 3)"), "cannot hold"),
        (value("2 * n > 6 and n + 1 < 4"), "cannot hold"),
        (value("3 < n < 2"), "cannot hold"),
        (value("holding and not holding"), "cannot hold"),
        (value("holding or not holding"), "always holds"),
        (value('drink == "tea" and drink == "coffee"'), "cannot hold"),
        (value('drink != "tea" or drink != "coffee"'), "always holds"),
        (value('clock >= "18:00" and clock < "08:00"'), "cannot hold"),
        (AllOf(parts=(value("battery > 0.5"), value("battery < 0.3"))), "cannot hold"),
        (AnyOf(parts=(value("holding"), Not(part=value("holding")))), "always holds"),
        (AllOf(parts=(LOOK, value("n > 3 and n < 2"))), "cannot hold"),
        (AllOf(parts=(ButtonPressed(button="go"), value("n > 3 and n < 2"))), "cannot hold"),
    ],
    ids=str,
)
def test_a_condition_whose_parts_contradict_each_other_is_refused(condition: Condition, says: str) -> None:
    with pytest.raises(ExpressionError, match=says):
        refuse_certain(condition, NAMES)


@pytest.mark.parametrize(
    "condition",
    [
        value("battery > 0.3 and battery < 0.5"),
        value("battery >= 0.5 and battery <= 0.5"),
        value("n > 3 or n < 2"),
        value("holding and localised"),
        value('clock >= "18:00" or clock < "08:00"'),
        value('drink == "tea" or drink == "coffee"'),
        value("n > 3 and m < 2"),
        value("true"),
        value("5 > 3 and battery < 0.3"),
        value("false and battery < 0.3"),
        AllOf(parts=(LOOK, Not(part=LOOK))),
        AllOf(parts=(value("battery > 0.5"), LOOK, value("battery < 0.5"))),
        AnyOf(parts=(ButtonPressed(button="go"), value("battery < 0.2"))),
        ButtonPressed(button="go"),
        LOOK,
    ],
    ids=str,
)
def test_a_condition_that_may_go_either_way_is_taken(condition: Condition) -> None:
    refuse_certain(condition, NAMES)
