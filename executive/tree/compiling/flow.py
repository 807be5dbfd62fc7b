"""What is known at each point of a mission while its tree is planned, and what the plans of blocks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final, Protocol

from executive.mission.gripper import InGripper, either
from executive.tree.compiling.decisions import (
    Decided,
    Named,
    decide_plan,
    decision_of,
    keys_of,
    kind_in,
)
from executive.tree.compiling.part import Assembled, StepPart
from executive.tree.goals import command_goal, door_goal
from executive.tree.node import NodeSpec
from executive.tree.plan import PlanBuilder
from executive.words.condition import READINGS, Condition, Look
from executive.words.expression import Expression, Kind, Template, kind_of
from executive.words.slug import slug
from executive.words.step import Step
from executive.words.steps import Group
from skills.files.errors import InputError

PYTHON_TYPES: Final[Mapping[Kind, type]] = {Kind.NUMBER: float, Kind.TEXT: str, Kind.TRUTH: bool}


@dataclass
class Flow:
    """What is known at one point of a mission, when all goes well up to there.

    `names` are the values that surely have been given by then, `kinds` the types of all that any step may have given,
    by their blackboard keys; `declared` are those that always have one. `held` is what the gripper holds; `opening` as
    long as it is what it held at first.
    """

    names: dict[str, Named] = field(default_factory=dict)
    kinds: dict[str, Kind] = field(default_factory=dict)
    declared: frozenset[str] = frozenset()
    held: InGripper | None = None
    opening: bool = True

    def copy(self) -> Flow:
        """The same, for a branch."""
        return Flow(dict(self.names), self.kinds, self.declared, self.held, self.opening)

    def join(self, branches: Sequence[Flow]) -> None:
        """Go on after one of several branches, nobody knows which."""
        first, *others = branches
        shared = {n: named for n, named in first.names.items() if all(_same(b.names.get(n), named) for b in others)}
        for name, named in shared.items():
            if any(branch.names[name].quantity != named.quantity for branch in others):
                shared[name] = replace(named, quantity=None)
        self.names.clear()
        self.names.update(shared)
        self.held = (
            first.held
            if all(branch.held == first.held for branch in others)
            else either(*(each.held for each in branches))
        )
        self.opening = all(branch.opening for branch in branches)

    def may_lack(self, before: Flow) -> None:
        """Go on although the last step may have been skipped: what it gave may be missing."""
        after = {name: named for name, named in self.names.items() if _same(before.names.get(name), named)}
        changed = {name for name, named in after.items() if before.names[name] != named}
        self.names = after | {name: replace(after[name], quantity=None) for name in changed}


def _same(one: Named | None, other: Named) -> bool:
    """Whether two values stand under one blackboard key and are of one type."""
    return one is not None and one.key == other.key and alike(one.type, other.type)


def alike(one: type, other: type) -> bool:
    """Whether values of two types are of one kind for expressions, or of the same type."""
    return one is other or (kind_of(one) is kind_of(other) and kind_of(one) is not Kind.OTHER)


class Assembler(Protocol):
    """What makes the subtrees of the steps in a block."""

    flow: Flow
    values_base: str

    def level(self, steps: Sequence[Step], base: str) -> Assembled:
        """The subtrees of steps in a row; the flow goes on after them."""

    def builder(self, path_id: str, source: Any) -> PlanBuilder:
        """The builder of nodes that belong to no one command."""


def row(assembler: Assembler, steps: Sequence[Step], builder: PlanBuilder, name: str) -> Assembled:
    """Steps in a row as one node at the builder's path id."""
    made = assembler.level(steps, builder.path_id)
    return replace(made, nodes=(builder.node("sequence", name, *made.nodes, part="steps"),))


def branch_of(
    assembler: Assembler, steps: Sequence[Step], builder: PlanBuilder, name: str, before: Flow
) -> tuple[Assembled, Flow]:
    """A branch that begins with the flow `before`; the assembler's own flow stays as it is."""
    here, assembler.flow = assembler.flow, before.copy()
    made = row(assembler, steps, builder, name) if steps else Assembled()
    assembler.flow, after = here, assembler.flow
    return made, after


def decision_node(
    assembler: Assembler, condition: Condition, builder: PlanBuilder
) -> tuple[NodeSpec, str, tuple[StepPart, ...]]:
    """The node that decides, the key of its answer, and the checks that it makes."""
    decided = decision_of(condition, builder, assembler.flow.names)
    key = builder.key("decided")
    return decide_plan(condition, decided, builder, key), key, checks_of(decided, builder)


def checks_of(decided: Decided, builder: PlanBuilder) -> tuple[StepPart, ...]:
    """The checks that a decision makes, as parts of the mission."""
    return tuple(
        StepPart(path, look.command, goal=command_goal(look.command, builder.knowledge))
        if isinstance(look, Look)
        else StepPart(path, goal=door_goal(builder.knowledge, look.between))
        for path, look in decided.checks
    )


def give(assembler: Assembler, name: str, key: str, kind: type, builder: PlanBuilder, quantity: Any = None) -> str:
    """Let later steps read a value under `name`; the key that it goes to.

    That is the key under which the name has been given before, so that a loop's steps read what its later ones give.

    Raises InputError: the name is no word, is that of a reading, or has another type elsewhere: steps may be repeated.
    """
    flow = assembler.flow
    if not name.isidentifier() or name in READINGS or name in ("true", "false"):
        hint = "use letters, digits and underscores, and no name of a reading"
        raise InputError.at(builder.source, f"'{name[:60]}' cannot be the name of a value", hint=hint)
    known = flow.names.get(name)
    if known is not None and (name in flow.declared or alike(known.type, kind)):
        key = known.key
    if flow.kinds.setdefault(key, kind_of(kind)) is not kind_of(kind):
        told = "is declared as" if name in flow.declared else "is elsewhere"
        what = f"'{name}' {told} {flow.kinds[key]}, and gets {kind_of(kind)}"
        raise InputError.at(builder.source, what, hint="use another name")
    flow.names[name] = Named(key, kind, None if name in flow.declared else quantity)
    return key


def give_key(assembler: Assembler, name: str | None, key: str, kind: type, builder: PlanBuilder) -> str:
    """Where a value of this type goes that is given the name `name` (None: none); without a `key`, to the name's own.

    Raises InputError: the name is no word, or is declared with another type.
    """
    if name is None:
        return key
    return give(assembler, name, key or f"{assembler.values_base}/{name}", kind, builder)


def check_template(text: Template, builder: PlanBuilder, assembler: Assembler) -> None:
    """Raises InputError: an expression of the text does not fit the values that are known."""
    for expression in text.expressions:
        kind_in(expression, builder, assembler.flow.names)


def answering(node: NodeSpec, keys: Mapping[str, str]) -> NodeSpec:
    """A status check whose answer goes elsewhere: options of its answer node by name."""
    if node.kind == "answer":
        return replace(node, options=MappingProxyType({**node.options, **keys}))
    return replace(node, children=tuple(answering(child, keys) for child in node.children))


def set_plan(
    builder: PlanBuilder, values: Mapping[str, Expression | Template], names: Mapping[str, Named], part: str, name: str
) -> NodeSpec:
    """A leaf that works values out; `values` are by the keys of `names`' entries that they go to."""
    keys = {key for each in values.values() for key in keys_of(each, names).items()}
    kinds = {named.key: named.type for named in names.values() if named.key in values}
    options = {"values": MappingProxyType(dict(values)), "keys": MappingProxyType(dict(sorted(keys)))}
    return builder.node("set", name, part=part, **options, kinds=MappingProxyType(kinds))


def block_name(block: Step) -> str:
    """A block as a part of a path id."""
    return slug(block.name) if isinstance(block, Group) and block.name else block.key


BlockPlan = Callable[[Assembler, Any, PlanBuilder], Assembled]
BlockPlans = Mapping[type[Step], BlockPlan]
"""The plan of each kind of block."""
