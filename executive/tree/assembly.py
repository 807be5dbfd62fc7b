"""Assembles a mission's steps to nodes, and tracks which values and objects each step can use."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from executive.mission.certainty import refuse_certain_comparisons
from executive.mission.gripper import InGripper, held_after_either
from executive.tree.board import LastKnown
from executive.tree.nodes.policies import under_policy
from executive.tree.plan import PICK_UPS, Assembled, PlanBuilder, Registry
from executive.words.command import START, Command
from executive.words.condition import RANGES, READINGS
from executive.words.expression import Expression, ExpressionError, Kind, Template, kind_of
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import CallSkill, UseMission
from executive.words.slug import slug
from executive.words.step import OnFailure, Policy, Step
from executive.words.steps import Group
from skills.inputs.errors import InputError, Problems, SourceLine

PYTHON_TYPES: Final[Mapping[Kind, type]] = {Kind.NUMBER: float, Kind.TEXT: str, Kind.TRUTH: bool}


@dataclass(frozen=True)
class Named:
    """Named value that steps may read: its blackboard key, its type, and its quantity if it has one."""

    key: str
    type: type
    quantity: Any = None

    def is_alike(self, kind: Any) -> bool:
        """Returns whether an expression may compare this value with a value of type `kind`."""
        return self.type is kind or (kind_of(self.type) is kind_of(kind) and kind_of(kind) is not Kind.OTHER)

    def is_same(self, other: Named | None) -> bool:
        """Returns whether two values have the same blackboard key and the same type."""
        return other is not None and other.key == self.key and other.is_alike(self.type)


@dataclass
class Flow:
    """Data flow at one point of a mission, if no step fails before it.

    `names` has the values that certainly exist. `kinds` has the type of each value that a step may give, by blackboard
    key; `declared` are the names that always have a value. `held` is the object in the gripper; `opening` is True while
    the gripper holds what it held when the mission began. An earlier step has met the people in `met`.
    """

    names: dict[str, Named] = field(default_factory=dict)
    kinds: dict[str, Kind] = field(default_factory=dict)
    declared: frozenset[str] = frozenset()
    held: InGripper | None = None
    opening: bool = True
    met: frozenset[str] = frozenset()

    def copy(self) -> Flow:
        """Returns a copy, in which a branch can be assembled."""
        return replace(self, names=dict(self.names))

    def join(self, branches: Sequence[Flow]) -> None:
        """Keeps what holds after each of several branches, only one of which runs."""
        first, *others = branches
        shared = {n: named for n, named in first.names.items() if all(named.is_same(b.names.get(n)) for b in others)}
        for name, named in shared.items():
            if any(branch.names[name].quantity != named.quantity for branch in others):
                shared[name] = replace(named, quantity=None)
        self.names.clear()
        self.names.update(shared)
        same = all(branch.held == first.held for branch in others)
        self.held = first.held if same else held_after_either(*(each.held for each in branches))
        self.opening = all(branch.opening for branch in branches)
        self.met = frozenset.intersection(*(branch.met for branch in branches))

    def may_lack(self, before: Flow) -> None:
        """Keeps what held before the last step as well, because the step may be skipped and give no values."""
        after = {name: named for name, named in self.names.items() if named.is_same(before.names.get(name))}
        changed = {name for name, named in after.items() if before.names[name] != named}
        self.met &= before.met
        self.names = after | {name: replace(after[name], quantity=None) for name in changed}

    def keys_of(self, *each: Expression | Template) -> Mapping[str, str]:
        """Returns the blackboard keys of the values that expressions or texts read."""
        read = {name for one in each for name in one.names}
        return {name: self.names[name].key for name in sorted(read) if name in self.names}

    def kind_of(self, expression: Expression, source: SourceLine | None) -> Kind:
        """Returns the type of an expression. Raises InputError when the known names do not fit it."""
        try:
            kind = expression.kind({**READINGS, **{name: kind_of(named.type) for name, named in self.names.items()}})
        except ExpressionError as error:
            raise InputError.at(source, f"'{expression}': {error.message}", hint=error.hint) from error
        try:
            refuse_certain_comparisons(expression, self.ranges)
        except ExpressionError as error:
            raise InputError.at(source, error.message, hint=error.hint) from error
        return kind

    @property
    def ranges(self) -> Mapping[str, Any]:
        """Quantities of the names that have a quantity."""
        return {**RANGES, **{name: each.quantity for name, each in self.names.items() if each.quantity is not None}}


@dataclass(frozen=True)
class _Item:
    """Command or other step: its number on its level, and its step with the step's place, both counted from 1."""

    number: int
    place: int
    step: Step
    command: Command | None = None


@dataclass
class Assembler:
    """Assembler of one mission's subtrees by the `plans` of its steps.

    `pick_ups` and `move_aside` are defaults for steps; `flow` is the present data flow. Values that steps give have
    blackboard keys below `values_base`. `last_known` is where another robot last knew the mission's object.
    `reported` are the classes of an own detector.
    """

    knowledge: Knowledge
    registry: Registry
    plans: StepPlans
    start_key: str
    pick_ups: int = PICK_UPS
    move_aside: int = 0
    values_base: str = ""
    last_known: LastKnown | None = None
    reported: frozenset[str] = frozenset()
    flow: Flow = field(default_factory=Flow)

    def builder(self, path_id: str, source: SourceLine | None) -> PlanBuilder:
        """Returns a builder for nodes that belong to no single command."""
        here = Command(goal=START)
        return PlanBuilder(
            *(self.knowledge, self.registry, path_id, self.start_key, here, source),
            last_known=self.last_known,
            reported=self.reported,
        )

    def level(self, steps: Sequence[Step], base: str) -> Assembled:
        """Assembles steps in sequence; a step with a policy becomes one subtree, other steps stay separate nodes."""
        made, problems = Assembled(), Problems()
        for items, policy in _groups(steps):
            with problems:
                before = self.flow.copy()
                group = self._group(items, base)
                if policy is not None and policy.on_failure in (OnFailure.SKIP, OnFailure.ASK):
                    self.flow.may_lack(before)
                if policy is not None:
                    builder = self.builder(f"{base}/step-{items[0].place}", items[0].step.source)
                    words = f"step {items[0].place}: {_words(items)}"
                    body = group.node if len(group.nodes) == 1 else builder.sequence(words, *group.nodes)
                    group = replace(group, nodes=(under_policy(body, policy, builder, words),))
                made += group
        problems.raise_any()
        return made

    def _group(self, items: Sequence[_Item], base: str) -> Assembled:
        """Assembles items in sequence; some plans combine two items."""
        made, problems, done = Assembled(), Problems(), 0
        for item, after in zip(items, (*items[1:], None), strict=True):
            if item.number <= done:
                continue
            with problems:
                step = item.step
                builder = self.builder(f"{base}/{item.number}-{_part(item)}", step.source)
                if item.command is not None:
                    following = None if after is None else after.command
                    builder = replace(builder, command=item.command, following=following)
                planned = self.plans[type(step)](self, step, builder)
                done = item.number + planned.used - 1
                made += replace(planned, nodes=tuple(replace(node, step=True) for node in planned.nodes))
        problems.raise_any()
        return made

    def row(self, steps: Sequence[Step], builder: PlanBuilder, name: str) -> Assembled:
        """Assembles steps in sequence as one node at the builder's path id; the flow is then that after the steps."""
        made = self.level(steps, builder.path_id)
        return replace(made, nodes=(builder.sequence(name, *made.nodes, part="steps"),))

    def branch(self, steps: Sequence[Step], builder: PlanBuilder, name: str, before: Flow) -> tuple[Assembled, Flow]:
        """Assembles a branch that begins with the flow `before`; returns the node and the flow after it."""
        here, self.flow = self.flow, before.copy()
        made = self.row(steps, builder, name) if steps else Assembled()
        self.flow, after = here, self.flow
        return made, after

    def give(self, name: str | None, key: str, kind: type, builder: PlanBuilder, quantity: Any = None) -> str:
        """Lets later steps read a value under `name` (None: not at all); returns the value's blackboard key.

        The key is the earlier key of the name, so that in a loop earlier steps read the values that later steps gave;
        else it is `key`, or the name's own key if `key` is empty.

        Raises InputError when the name is no identifier, names a reading, or has another type elsewhere, because steps
        may be repeated.
        """
        if name is None:
            return key
        flow, key = self.flow, key or f"{self.values_base}/{name}"
        if not name.isidentifier() or name in READINGS or name in ("true", "false"):
            hint = "use letters, digits and underscores, and no name of a reading"
            raise InputError.at(builder.source, f"'{name[:60]}' cannot be the name of a value", hint=hint)
        known = flow.names.get(name)
        if known is not None and (name in flow.declared or known.is_alike(kind)):
            key = known.key
        if flow.kinds.setdefault(key, kind_of(kind)) is not kind_of(kind):
            before = "is declared as" if name in flow.declared else "is elsewhere"
            what = f"'{name}' {before} {flow.kinds[key]}, and gets {kind_of(kind)}"
            raise InputError.at(builder.source, what, hint="use another name")
        flow.names[name] = Named(key, kind, None if name in flow.declared else quantity)
        return key

    def check_template(self, text: Template, builder: PlanBuilder) -> None:
        """Raises InputError when an expression in the text reads an unknown value or a value of a wrong type."""
        for expression in text.expressions:
            self.flow.kind_of(expression, builder.source)


StepPlan = Callable[[Assembler, Any, PlanBuilder], Assembled]
StepPlans = Mapping[type[Step], StepPlan]
"""Plans by the class of the step."""


def step_name(command: Command) -> str:
    """Name of a command's step as used in path ids: the goal, or else the object."""
    return slug(command.goal or str(command.object or command.item or "anywhere"))


def _part(item: _Item) -> str:
    """Name of an item as used in path ids."""
    match item.step:
        case UseMission():
            return slug(item.step.words)
        case CallSkill(skill=skill):
            return slug(skill)
        case Group(name=name) if name:
            return slug(name)
    return item.step.key if item.command is None else step_name(item.command)


def _groups(steps: Sequence[Step]) -> Iterator[tuple[tuple[_Item, ...], Policy | None]]:
    """Yields groups of items: one step that has a policy, or adjacent steps that have none."""
    number, free = 1, []
    for place, step in enumerate(steps, start=1):
        commands: Sequence[Command | None] = step.commands or (None,)
        items = [_Item(number + offset, place, step, command) for offset, command in enumerate(commands)]
        number += len(items)
        if step.is_empty:
            free += items
            continue
        if free:
            yield tuple(free), None
        free = []
        yield tuple(items), step
    if free:
        yield tuple(free), None


def _words(items: Sequence[_Item]) -> str:
    """Text that stands for a step in messages."""
    commands = [item.command for item in items if item.command is not None]
    return ", then ".join(map(_command_words, commands)) or items[0].step.words


def words_of(steps: Sequence[Step]) -> str:
    """Text that stands for steps in the name of a node."""
    return ", then ".join(_words((item,)) for items, _ in _groups(steps) for item in items)


def _command_words(command: Command) -> str:
    """Short text of a command: "grasp coke at kitchen table"."""
    item = command.object or command.item
    action = command.task.word if command.task is not None else "take" if command.item is not None else "go"
    goal = "" if command.goal is None else f"{'at' if command.task is not None else 'to'} {command.goal}"
    return " ".join(filter(None, (action, str(item or ""), goal)))
