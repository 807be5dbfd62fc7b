"""The subtrees of blocks: what a mission decides, repeats, tries, does side by side, waits for, says and asks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final, Protocol

from executive.mission.gripper import InGripper, either
from executive.tree.behaviours.board import FromBoard
from executive.tree.behaviours.decisions import AnswerIs, MustHold, MustNotBegin
from executive.tree.compiling.builder import PlanBuilder, pose_2d
from executive.tree.compiling.decisions import (
    Decided,
    Named,
    decide_plan,
    decision_of,
    instant_decision,
    keys_of,
    kind_in,
)
from executive.tree.compiling.doors import door_plan
from executive.tree.compiling.part import Assembled, StepPart
from executive.tree.goals import command_goal, door_goal, held_goal
from executive.tree.node import NodeSpec
from executive.tree.nodes.interrupts import HANDLING, dock_plan
from executive.words.command import Command, Task
from executive.words.condition import READINGS, AllOf, Condition, DoorOpen, Look, ValueIs, parts_of
from executive.words.expression import Expression, Kind, Template, Value, kind_of
from executive.words.mission import Mission
from executive.words.slug import slug
from executive.words.steps import (
    Ask,
    CallSkill,
    Check,
    Choose,
    Do,
    Dock,
    Group,
    Repeat,
    Say,
    Set,
    Speak,
    Step,
    Together,
    Try,
    Wait,
)
from skills.api import Part
from skills.files.errors import InputError, suggestion

__all__ = [
    "PYTHON_TYPES",
    "Assembler",
    "Flow",
    "answering",
    "block_name",
    "block_plan",
    "framed",
    "give",
    "set_plan",
]

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
    return one is not None and one.key == other.key and _alike(one.type, other.type)


def _alike(one: type, other: type) -> bool:
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


def block_plan(assembler: Assembler, block: Step, builder: PlanBuilder) -> Assembled:
    """The one subtree of a block, and what its parts are to bring about. Raises InputError."""
    return _PLANS[type(block)](assembler, block, builder)


def framed(
    assembler: Assembler, body: Assembled, group: Group | Mission, builder: PlanBuilder, before: Flow
) -> Assembled:
    """Steps under what is watched meanwhile, and with what is always done in the end; `before` is their flow."""
    (node,), parts = body.nodes, body.parts
    if group.when:
        after, calls = assembler.flow, []
        for number, handler in enumerate(group.when, start=1):
            below = builder.at(f"when-{number}")
            decision = instant_decision(handler.condition, below, before.names)
            assembler.flow = before.copy()
            work = _row(assembler, handler.steps, below, f"when {handler.condition}")
            parts += work.parts
            calls.append(
                below.node(
                    "interrupt",
                    f"when {handler.condition}",
                    *work.nodes,
                    condition=MustNotBegin(decision, str(handler.condition)),
                    spares=HANDLING,
                    uses=handler.times,
                )
            )
        assembler.flow = after
        node = builder.node("interrupts", f"{node.name}, watched", *calls, node, part="watched")
    if group.while_ is not None:
        holds = group.while_.holds
        decision = instant_decision(holds, builder.at("while"), before.names)
        condition = MustHold(decision, str(holds))
        node = builder.node("guard", f"while {holds}", node, part="while", condition=condition)
        if _is_holding(holds):
            parts = (StepPart(node.path_id, goal=held_goal()), *parts)
    if group.always:
        assembler.flow.join([before.copy(), assembler.flow.copy()])
        last = _row(assembler, group.always, builder.at("always"), "in the end")
        parts += last.parts
        node = builder.node("always", "in the end, whatever happens", node, *last.nodes, part="whatever-happens")
    return Assembled((node,), parts)


def _is_holding(condition: Condition) -> bool:
    """Whether a condition says that the gripper holds something, alone or together with others."""
    match condition:
        case ValueIs(text=text):
            return text.strip() == "holding"
        case AllOf(parts=parts):
            return any(map(_is_holding, parts))
    return False


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


def _row(assembler: Assembler, steps: Sequence[Step], builder: PlanBuilder, name: str) -> Assembled:
    """Steps in a row as one node at the builder's path id."""
    made = assembler.level(steps, builder.path_id)
    return replace(made, nodes=(builder.node("sequence", name, *made.nodes, part="steps"),))


def _branch(
    assembler: Assembler, steps: Sequence[Step], builder: PlanBuilder, name: str, before: Flow
) -> tuple[Assembled, Flow]:
    """A branch that begins with the flow `before`; the assembler's own flow stays as it is."""
    here, assembler.flow = assembler.flow, before.copy()
    made = _row(assembler, steps, builder, name) if steps else Assembled()
    assembler.flow, after = here, assembler.flow
    return made, after


def _decided(
    assembler: Assembler, condition: Condition, builder: PlanBuilder
) -> tuple[NodeSpec, str, tuple[StepPart, ...]]:
    """The node that decides, the key of its answer, and the checks that it makes."""
    decided = decision_of(condition, builder, assembler.flow.names)
    key = builder.key("decided")
    return decide_plan(condition, decided, builder, key), key, _checks(decided, builder)


def _checks(decided: Decided, builder: PlanBuilder) -> tuple[StepPart, ...]:
    return tuple(
        StepPart(path, look.command, goal=command_goal(look.command, builder.knowledge))
        if isinstance(look, Look)
        else StepPart(path, goal=door_goal(builder.knowledge, look.between))
        for path, look in decided.checks
    )


def _choose(assembler: Assembler, block: Choose, builder: PlanBuilder) -> Assembled:
    decide, key, parts = _decided(assembler, block.condition, builder.at("if"))
    flow = assembler.flow
    then, after_then = _branch(assembler, block.then, builder.at("then"), "then", flow)
    other, after_other = _branch(assembler, block.otherwise, builder.at("else"), "else", flow)
    flow.join([after_then, after_other])
    branches = {True: 1, False: 2} if block.otherwise else {True: 1}
    nodes = (decide, *then.nodes, *other.nodes)
    node = builder.node("choose", f"{block.condition}?", *nodes, branches=MappingProxyType(branches), key=key)
    return Assembled((node,), (*parts, *then.parts, *other.parts))


def _repeat(assembler: Assembler, block: Repeat, builder: PlanBuilder) -> Assembled:
    rounds = block.loop
    condition = rounds.until or rounds.while_
    mode = "times" if condition is None else "until" if rounds.until is not None else "while"
    _refuse_endless(block, condition, builder)
    changing = _given(block.steps)
    for name in changing & set(assembler.flow.names):
        assembler.flow.names[name] = replace(assembler.flow.names[name], quantity=None)
    before, nodes, key = assembler.flow.copy(), [], ""
    parts: tuple[StepPart, ...] = ()
    if mode == "while" and condition is not None:
        decide, key, parts = _decided(assembler, condition, builder.at("while"))
        nodes = [decide]
    body = _row(assembler, block.steps, builder.at("round"), "round")
    flow = assembler.flow
    if flow.held != before.held and rounds.times != 1:
        flow.names = dict(before.names)
        flow.held, flow.opening = either(before.held, flow.held), False
        body = _row(assembler, block.steps, builder.at("round"), "round")
    if mode == "until" and condition is not None:
        decide, key, parts = _decided(assembler, condition, builder.at("until"))
        nodes = [decide]
    if mode == "while":
        assembler.flow.join([before, assembler.flow.copy()])
    elif assembler.flow.held != before.held:
        assembler.flow.held = either(before.held, assembler.flow.held)
    words = "" if condition is None else str(condition)
    often = f"{mode} {words}" if condition is not None else f"{rounds.times} times" if rounds.times else "for ever"
    every = f", every {rounds.every_s:g} s" if rounds.every_s else ""
    node = builder.node(
        "repeat",
        f"{often}{every}",
        *nodes,
        *body.nodes,
        mode=mode,
        words=words,
        count=builder.key("rounds"),
        key=key,
        times=rounds.times,
        every_s=rounds.every_s or 0.0,
    )
    return Assembled((node,), (*parts, *body.parts))


def _refuse_endless(block: Repeat, condition: Condition | None, builder: PlanBuilder) -> None:
    """Refuse rounds that go on for ever: nothing that the condition reads can change. Raises InputError."""
    if condition is None or block.loop.times is not None or block.timeout_s is not None:
        return
    read: set[str] = set()
    for part in parts_of(condition):
        if not isinstance(part, ValueIs):
            return
        read |= part.expression.names
    if not read & (set(READINGS) | _given(block.steps)):
        hint = "give 'times' or 'timeout', or 'set' in a round what it reads"
        raise InputError.at(builder.source, f"nothing in a round changes whether {condition}", hint=hint)


def _given(steps: Iterable[Step]) -> set[str]:
    """The names that steps may give a value."""
    found: set[str] = set()
    for step in (below for each in steps for below in each.walk()):
        match step:
            case Set(set=values):
                found |= set(values)
            case Do() | Say() | CallSkill() | Check() | Ask():
                found |= set((step.gives or {}).values())
    return found


def _try(assembler: Assembler, block: Try, builder: PlanBuilder) -> Assembled:
    flow = assembler.flow
    tried, after_tried = _branch(assembler, block.steps, builder.at("try"), "try", flow)
    midway = flow.copy()
    if after_tried.held != flow.held:
        midway.held, midway.opening = either(flow.held, after_tried.held), False
    other, after_other = _branch(assembler, block.otherwise, builder.at("else"), "else", midway)
    flow.join([after_tried, after_other])
    return Assembled((builder.node("try", "else the other", *tried.nodes, *other.nodes),), (*tried.parts, *other.parts))


def _together(assembler: Assembler, block: Together, builder: PlanBuilder) -> Assembled:
    flow, made, afters = assembler.flow, [], []
    for number, step in enumerate(block.steps, start=1):
        branch, after = _branch(assembler, (step,), builder.at(f"branch-{number}"), f"branch {number}", flow)
        made.append(branch)
        afters.append(after)
    _refuse_collisions([each.nodes[0] for each in made], builder)
    everything = block.needed == len(block.steps)
    if everything:
        before = dict(flow.names)
        for after in afters:
            flow.names.update({name: named for name, named in after.names.items() if before.get(name) != named})
    moved = [after.held for after in afters if after.held != flow.held]
    if moved:
        flow.held, flow.opening = (moved[0] if everything else either(flow.held, *moved)), False
    name = "side by side" if everything else f"side by side, until {block.needed} of {len(block.steps)} are done"
    node = builder.node("together", name, *(each.nodes[0] for each in made), needed=block.needed)
    return Assembled((node,), tuple(part for each in made for part in each.parts))


def _refuse_collisions(branches: Sequence[NodeSpec], builder: PlanBuilder) -> None:
    """Refuse branches that use the same part of the robot. Raises InputError."""
    users: dict[Part, int] = {}
    for number, branch in enumerate(branches, start=1):
        for part in sorted(_used_parts(branch), key=lambda each: each.value):
            if users.setdefault(part, number) != number:
                what = f"steps {users[part]} and {number} both use the {part.value}"
                hint = "do them one after the other"
                raise InputError.at(branch.source or builder.source, f"{what}, and cannot go together", hint=hint)


def _used_parts(branch: NodeSpec) -> frozenset[Part]:
    """The parts of the robot that skills below a node use."""
    skills = (node.options["skill"] for node in branch.walk() if node.kind == "skill")
    return frozenset(part for skill in skills for part in skill.uses)


def _group(assembler: Assembler, block: Group, builder: PlanBuilder) -> Assembled:
    before = assembler.flow.copy()
    body = _row(assembler, block.steps, builder, block.name or "group")
    return framed(assembler, body, block, builder, before)


def _wait(assembler: Assembler, block: Wait, builder: PlanBuilder) -> Assembled:
    awaited = block.awaited
    if awaited.seconds is not None:
        return Assembled((builder.pause("wait", f"wait {awaited.seconds:g} s", awaited.seconds),))
    if awaited.until_clock is not None:
        time_s, words = awaited.until_clock_s, awaited.until_clock
        return Assembled((builder.node("wait until", f"wait until {words}", time_s=time_s, words=words),))
    assert awaited.condition is not None
    decide, key, parts = _decided(assembler, awaited.condition, builder.at("for"))
    words, every_s = str(awaited.condition), awaited.every_s if decide.children else 0.0
    name = f"wait until {words}"
    return Assembled((builder.node("wait for", name, decide, key=key, words=words, every_s=every_s),), parts)


def _check(assembler: Assembler, block: Check, builder: PlanBuilder) -> Assembled:
    below = builder.at("check")
    decided = decision_of(block.condition, below, assembler.flow.names)
    if isinstance(block.condition, Look) and isinstance(decided.decision, AnswerIs) and not decided.decision.max_age_s:
        key = _give_key(assembler, block.answer_name, decided.decision.key, bool, builder)
        return Assembled((answering(decided.looks[0], {"key": key}),), _checks(decided, builder))
    if isinstance(block.condition, DoorOpen) and not block.condition.max_age_s:
        key = _give_key(assembler, block.answer_name, below.key("answer"), bool, builder)
        look = door_plan(below, block.condition.between, key)
        goal = door_goal(builder.knowledge, block.condition.between)
        return Assembled((look,), (StepPart(look.path_id, goal=goal),))
    key = _give_key(assembler, block.answer_name, below.key("decided"), bool, builder)
    decide = decide_plan(block.condition, decided, below, key)
    question = str(block.condition)
    node = builder.node("check", f"{question}?", decide, question=question, key=key)
    return Assembled((node,), _checks(decided, builder))


def _dock(assembler: Assembler, block: Dock, builder: PlanBuilder) -> Assembled:
    facts = builder.knowledge
    if facts.dock is None:
        hint = "add 'dock' to its knowledge"
        raise InputError.at(builder.source, "this world has no dock to charge at", hint=hint)
    level = facts.battery.charged if block.level is None else block.level
    node = dock_plan(builder, pose_2d(facts.dock), level)
    command = Command(task=Task.CHARGE)
    return Assembled((node,), (StepPart(node.path_id, command, goal=command_goal(command, facts)),))


def _speak(assembler: Assembler, block: Speak, builder: PlanBuilder) -> Assembled:
    if not block.text.names:
        return Assembled((builder.skill("speak", {"text": block.text.filled({})}),))
    _check_template(block.text, builder, assembler)
    key = builder.key("text")
    names = {**assembler.flow.names, "": Named(key, str)}
    fill = set_plan(builder, {key: block.text}, names, "fill", "put the values in")
    return Assembled((builder.sequence("speak", fill, builder.skill("speak", {"text": FromBoard(key)})),))


def _ask(assembler: Assembler, block: Ask, builder: PlanBuilder) -> Assembled:
    _check_template(block.text, builder, assembler)
    kind = float if block.match == "number" else str
    key = _give_key(assembler, block.answer_name, builder.key("answer"), kind, builder)
    choices = block.choices or {}
    names = {choice.lower(): choice for choice in choices} or _spoken(block.match, builder)
    default = _default(block, names, builder)
    leaf = builder.node(
        "question",
        f"ask: {block.text.text}",
        part="question",
        text=block.text,
        keys=MappingProxyType(dict(keys_of(block.text, assembler.flow.names))),
        options=tuple(choices),
        names=MappingProxyType(names),
        gives=kind,
        limit_s=block.limit_s,
        default=default,
        key=key,
    )
    if not any(choices.values()):
        return Assembled((leaf,))
    flow, afters, branches, nodes = assembler.flow, [], {}, [leaf]
    parts: tuple[StepPart, ...] = ()
    for choice, steps in choices.items():
        branch, after = _branch(assembler, steps, builder.at(f"answer-{slug(choice)}"), f"if {choice}", flow)
        afters.append(after)
        parts += branch.parts
        if branch.nodes:
            branches[choice] = len(nodes)
            nodes += branch.nodes
    flow.join(afters)
    node = builder.node("choose", "by the answer", *nodes, branches=MappingProxyType(branches), key=key)
    return Assembled((node,), parts)


def _spoken(match: str | None, builder: PlanBuilder) -> dict[str, str]:
    """What people may say for the names of the world, in lower case, and what it means."""
    knowledge = builder.knowledge
    groups: Mapping[str, tuple[Sequence[str], Callable[[str], str | None]]] = {
        "place": (knowledge.place_names(), knowledge.place),
        "person": (tuple(knowledge.people), knowledge.person),
        "object": (knowledge.thing_names(), knowledge.thing),
    }
    if match is None or match not in groups:
        return {}
    known, meaning = groups[match]
    spoken = {word.lower(): meaning(word) for word in knowledge.spellings(known)}
    return {word: name for word, name in spoken.items() if name is not None}


def _default(block: Ask, names: Mapping[str, str], builder: PlanBuilder) -> Value | None:
    """The default as the answer's own type. Raises InputError: it is no answer."""
    default = block.default
    if default is None or block.choices:
        return default
    if block.match == "number":
        if kind_of(default) is not Kind.NUMBER:
            raise InputError.at(builder.source, f"the default {default!r} is no number", hint="give a number")
        return float(default)
    if names and str(default).lower() not in names:
        known = sorted(set(names.values()))
        raise InputError.at(builder.source, f"the default '{default}' is unknown", hint=suggestion(str(default), known))
    return names.get(str(default).lower(), str(default))


def _set(assembler: Assembler, block: Set, builder: PlanBuilder) -> Assembled:
    values: dict[str, Expression | Template] = {}
    for name, expression in block.values.items():
        kind = kind_in(expression, builder, assembler.flow.names)
        key = _give_key(assembler, name, "", PYTHON_TYPES[kind], builder)
        values[key] = expression
    words = ", ".join(f"{name} = {expression}" for name, expression in block.values.items())
    return Assembled((set_plan(builder, values, assembler.flow.names, "set", f"set {words}"),))


def _check_template(text: Template, builder: PlanBuilder, assembler: Assembler) -> None:
    for expression in text.expressions:
        kind_in(expression, builder, assembler.flow.names)


def _give_key(assembler: Assembler, name: str | None, key: str, kind: type, builder: PlanBuilder) -> str:
    """Where a value of this type goes that is given the name `name` (None: none); without a `key`, to the name's own.

    Raises InputError: the name is no word, or is declared with another type.
    """
    if name is None:
        return key
    return give(assembler, name, key or f"{assembler.values_base}/{name}", kind, builder)


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
    if known is not None and (name in flow.declared or _alike(known.type, kind)):
        key = known.key
    if flow.kinds.setdefault(key, kind_of(kind)) is not kind_of(kind):
        told = "is declared as" if name in flow.declared else "is elsewhere"
        what = f"'{name}' {told} {flow.kinds[key]}, and gets {kind_of(kind)}"
        raise InputError.at(builder.source, what, hint="use another name")
    flow.names[name] = Named(key, kind, None if name in flow.declared else quantity)
    return key


def answering(node: NodeSpec, keys: Mapping[str, str]) -> NodeSpec:
    """A status check whose answer goes elsewhere: options of its answer node by name."""
    if node.kind == "answer":
        return replace(node, options=MappingProxyType({**node.options, **keys}))
    return replace(node, children=tuple(answering(child, keys) for child in node.children))


_Plan = Callable[[Assembler, Any, PlanBuilder], Assembled]
_PLANS: Final[Mapping[type, _Plan]] = MappingProxyType(
    {
        Choose: _choose,
        Repeat: _repeat,
        Try: _try,
        Together: _together,
        Group: _group,
        Wait: _wait,
        Check: _check,
        Dock: _dock,
        Speak: _speak,
        Ask: _ask,
        Set: _set,
    }
)
