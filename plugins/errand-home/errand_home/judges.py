"""Judges of household tasks, by a simulation's truth."""

import re
from typing import Final

from errand_home.orders import ORDERS, order_of
from executive.words.command import parse_object
from executive.words.goal import GoalCondition
from plant.referee.findings import region_at, where
from plant.referee.object_history import Truth
from skills.api import ObjectKind
from skills.inputs.errors import listing

_SAID: Final = re.compile(r".*? (?:is|are) (the .*)")


def judge_compared(condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
    """Judges whether the robot named the objects that come first, one for each asked for; equal ones may be swapped."""
    superlative = order_of(parse_object(condition.wanted).attributes)
    order, kinds = ORDERS[superlative], {one.class_name for one in truth.histories}
    keys = {
        one.class_name: order.key(one.sides_m, one.mass_kg)
        for one in truth.histories
        if (not condition.classes or one.class_name in condition.classes)
        and (p_W := one.place_at(condition.from_s)) is not None
        and region_at(condition.source, p_W) is not None
    }
    ranked = sorted(keys, key=keys.__getitem__)
    due, rest = ranked[: condition.needed], where(condition.source)
    right = f"{superlative} on {rest}: {listing(str(ObjectKind(name)) for name in due) or 'nothing'}"
    last = condition.said[-1] if condition.said else ""
    heard = _SAID.fullmatch(last)
    named = {kind for kind in kinds if heard and re.search(rf"\bthe {re.escape(str(ObjectKind(kind)))}\b", heard[1])}
    if not due:
        return bool(last) and not named, f"it said {last!r}; {right}."
    limit = keys[due[-1]] + order.equal
    holds = len(named) == len(due) and all(keys.get(kind, float("inf")) <= limit for kind in named)
    return holds, f"it said {last!r}; {right}."
