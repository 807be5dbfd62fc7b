"""From the conditions of a mission to decisions, and the looks that they take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from executive.mission.certainty import refuse_certain, refuse_certain_comparisons
from executive.tree.compiling.trips import refuse_several
from executive.tree.node import NodeSpec
from executive.tree.nodes.commands import find_plan
from executive.tree.nodes.decisions import AllHold, AnswerIs, AnyHolds, Decision, DoesNotHold, Pressed, ValueHolds
from executive.tree.nodes.doors import door_plan
from executive.tree.plan import PlanBuilder
from executive.words.condition import (
    RANGES,
    READINGS,
    AllOf,
    AnyOf,
    ButtonPressed,
    Condition,
    DoorOpen,
    Look,
    LookFor,
    Not,
    Question,
    ValueIs,
    parts_of,
)
from executive.words.expression import Expression, ExpressionError, Kind, Template, kind_of
from skills.files.errors import InputError

__all__ = ["Decided", "Named", "decide_plan", "decision_of", "instant_decision", "keys_of", "kind_in"]


@dataclass(frozen=True)
class Named:
    """A value that steps may read: its blackboard key, its type, and its quantity where it has one."""

    key: str
    type: type
    quantity: Any = None


@dataclass(frozen=True)
class Decided:
    """A decision, the looks that it takes in the order of its answers, and the questions behind them by path id."""

    decision: Decision
    looks: tuple[NodeSpec, ...] = ()
    checks: tuple[tuple[str, Look | DoorOpen], ...] = ()


def decision_of(condition: Condition, builder: PlanBuilder, names: Mapping[str, Named]) -> Decided:
    """The decision of a condition; `builder` is where its looks stand.

    Raises InputError: an expression that is not true or false, an unknown name, or something that cannot be looked for.
    """
    looks: list[NodeSpec] = []
    checks: list[tuple[str, Look | DoorOpen]] = []

    def made(part: Condition) -> Decision:
        """The decision of a part; its looks are gathered on the way."""
        match part:
            case ValueIs(expression=expression):
                if kind_in(expression, builder, names) is not Kind.TRUTH:
                    hint = "compare it with something, as in 'count > 2'"
                    raise InputError.at(builder.source, f"'{expression}' is not true or false", hint=hint)
                return ValueHolds(expression, keys_of(expression, names))
            case Look(command=command, max_age_s=max_age_s):
                below = replace(builder.at(f"look-{len(looks) + 1}"), command=command)
                refuse_several(below)
                answer = AnswerIs(below.key("answer"), max_age_s)
                looks.append(find_plan(below, answer.key))
                checks.append((below.path_id, part))
                return answer
            case DoorOpen(between=between, max_age_s=max_age_s):
                below = builder.at(f"look-{len(looks) + 1}")
                answer = AnswerIs(below.key("answer"), max_age_s)
                looks.append(door_plan(below, between, answer.key))
                checks.append((below.path_id, part))
                return answer
            case ButtonPressed(button=name):
                return Pressed(name)
            case AllOf(parts=parts):
                return AllHold(tuple(map(made, parts)))
            case AnyOf(parts=parts):
                return AnyHolds(tuple(map(made, parts)))
            case Not(part=inner):
                return DoesNotHold(made(inner))
            case Question() | LookFor():
                raise TypeError(f"{condition!r} was not resolved")

    decided = Decided(made(condition), tuple(looks), tuple(checks))
    try:
        refuse_certain(condition, _ranges(names))
    except ExpressionError as error:
        raise InputError.at(builder.source, error.message, hint=error.hint) from error
    return decided


def instant_decision(condition: Condition, builder: PlanBuilder, names: Mapping[str, Named]) -> Decision:
    """The decision of a condition that is watched. Raises InputError: it takes a look, or as `decision_of`."""
    look = next((part for part in parts_of(condition) if isinstance(part, Look | DoorOpen)), None)
    if look is not None:
        hint = "look once with 'if', or again and again with 'repeat: {until: ..}'"
        raise InputError.at(builder.source, f"'{look}' takes a look, and cannot be watched meanwhile", hint=hint)
    return decision_of(condition, builder, names).decision


def decide_plan(condition: Condition, decided: Decided, builder: PlanBuilder, key: str) -> NodeSpec:
    """The node that decides, and leaves its answer under `key`."""
    return builder.node(
        "decide",
        f"{condition}?",
        *decided.looks,
        decision=decided.decision,
        words=str(condition),
        key=key,
    )


def keys_of(each: Expression | Template, names: Mapping[str, Named]) -> Mapping[str, str]:
    """The blackboard keys of the values that an expression or text reads."""
    return {name: names[name].key for name in sorted(each.names) if name in names}


def kind_in(expression: Expression, builder: PlanBuilder, names: Mapping[str, Named]) -> Kind:
    """The type of an expression where these names are known. Raises InputError: they do not fit it."""
    try:
        kind = expression.kind({**READINGS, **{name: kind_of(named.type) for name, named in names.items()}})
    except ExpressionError as error:
        raise InputError.at(builder.source, f"'{expression}': {error.message}", hint=error.hint) from error
    try:
        refuse_certain_comparisons(expression, _ranges(names))
    except ExpressionError as error:
        raise InputError.at(builder.source, error.message, hint=error.hint) from error
    return kind


def _ranges(names: Mapping[str, Named]) -> Mapping[str, Any]:
    """The quantities of all names that have one."""
    return {**RANGES, **{name: named.quantity for name, named in names.items() if named.quantity is not None}}
