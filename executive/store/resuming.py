"""Takes up a mission that was broken off: the same tree, in which finished skills give their results once more.

The tree finds its way by itself: its composites see the same results as before and come to the same node. Nothing is
done to reach that but ticking; a skill that had finished gives its result in its first tick. Guards look at the robot
as it is now. The skill that was under way is told to `resume`, not to `begin`, so that it looks before it repeats
what changed the world. Counts of attempts begin again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.run.mission_history import history_keys
from executive.store.memory import Memory, Recollection, StepRecord
from executive.tree.behaviour import Explained
from executive.tree.compiler import CompiledTree
from executive.tree.context import RunContext
from executive.tree.kinds import Changes, build, writes
from executive.tree.node import NodeSpec
from executive.tree.nodes.guard import Guard
from executive.tree.nodes.search import Answer
from executive.tree.nodes.skill import Remembered
from skills.api import Cause, Failed, Running, Skill, SkillContext, Step

BEFORE: Final = "before the restart"
_CONDITIONAL: Final = frozenset({"only if known", "only if holding"})
_FORGETTING: Final = frozenset({"recover", "for each found"})
_DECLARED: Final = tuple(name for name, hint in Skill.__annotations__.items() if str(hint).startswith("ClassVar"))


@dataclass(frozen=True)
class ResumedTree(CompiledTree):
    """A tree that begins with a blackboard as it was left, and some of whose nodes are changed once they are built."""

    board: Mapping[str, Any] = field(default_factory=dict)
    changes: Changes = field(default_factory=dict)

    def build(self, context: RunContext) -> Behaviour:
        """The py_trees tree, its blackboard filled."""
        for key, value in self.board.items():
            context.board.put(key, value)
        return build(self.root, context, self.changes)


def resumed_tree(tree: CompiledTree, memory: Memory) -> tuple[ResumedTree, Recollection]:
    """The tree of a mission that goes on, and what it remembers; path ids stay the same.

    What the mission is interrupted for is not taken up, but called for again where need be. A decision stays as it
    was made, without the looks that it took.
    """
    over = frozenset(below for node in tree.mission.walk() if _is_over(node, memory) for below in _paths_below(node))
    skills = {node.path_id: node for node in tree.mission.walk() if node.kind == "skill" and node.path_id not in over}
    failed = {path for path, step in memory.steps.items() if step.status is Status.FAILURE}
    kept = [
        path
        for path, leaf in skills.items()
        if path in failed or all(key in memory.board for key in leaf.options["outputs"].values())
    ]
    recollection = Recollection(tree.path_ids, memory.steps).only(kept)
    parents = {child.path_id: node for node in tree.root.walk() for child in node.children}
    change = _Change(memory, recollection, parents)
    root = change.all_of(tree.mission)
    if tree.root is not tree.mission:
        root = dataclasses.replace(tree.root, children=(*tree.root.children[:-1], root))
    own = {each.name: getattr(tree, each.name) for each in dataclasses.fields(CompiledTree)}
    keys = history_keys(tree.robot_name, tree.mission_name)
    again = {
        keys.answered_before: _answered(tree, memory) - over,
        keys.ended_before: _ended(tree, memory) - over,
    }
    board = {**memory.board, **again}
    return ResumedTree(**{**own, "root": root}, board=board, changes=change.made), recollection


def ended_tree(tree: CompiledTree, memory: Memory) -> tuple[ResumedTree, Recollection] | None:
    """The tree of a mission that had come to its end, while other robots went on; None where it had not.

    Its nodes say what they said, its root does so in its first tick, and nothing more is done: what it brought about
    may be gone by now, since another robot took it. One that ended with a defect had not come to its end.
    """
    ended = memory.steps.get(tree.root.path_id)
    if ended is None or not ended.ended or ended.cause is Cause.ERROR:
        return None
    changes: dict[str, Callable[[Any], object]] = {
        path: partial(_say_as_before, step=step, board=memory.board)
        for path, step in memory.steps.items()
        if step.ended
    }
    changes[tree.root.path_id] = lambda node: _AsBefore(node, ended)
    recollection = Recollection(tree.path_ids, {})
    recollection.told.append(f"{tree.root.path_id}: {ended.status.value.lower()} {BEFORE}: {ended.message}")
    own = {each.name: getattr(tree, each.name) for each in dataclasses.fields(CompiledTree)}
    return ResumedTree(**own, board=memory.board, changes=changes), recollection


def _say_as_before(node: Behaviour, *, step: StepRecord, board: Mapping[str, Any]) -> None:
    """Let a node say what it said before the restart."""
    node.status = step.status
    if isinstance(node, Explained):
        node.cause, node.message = step.cause, step.message
    if isinstance(node, Answer):
        node.answer = board.get(node.key)


def _answered(tree: CompiledTree, memory: Memory) -> frozenset[str]:
    """The nodes that have given their answer and, since what they rest on is told once more, give it again."""
    answers = {node.path_id for node in tree.mission.walk() if node.kind in ("answer", "check")}
    return frozenset(path for path in answers if path in memory.steps and memory.steps[path].status is Status.SUCCESS)


def _ended(tree: CompiledTree, memory: Memory) -> frozenset[str]:
    """The nodes that have ended and, since what they rest on is told once more, end again."""
    interrupts = [node for node in tree.mission.walk() if node.kind == "interrupt"]
    called = {below.path_id for node in interrupts for below in node.walk()}
    return frozenset(path for path, step in memory.steps.items() if step.ended) - called


@dataclass(frozen=True)
class _Change:
    """Turns the specs of a tree into those of one that goes on; `made` is what is to be done to the built nodes."""

    memory: Memory
    recollection: Recollection
    parents: Mapping[str, NodeSpec]
    made: dict[str, Callable[[Any], object]] = field(default_factory=dict)

    def all_of(self, spec: NodeSpec) -> NodeSpec:
        """The spec and all below, children first."""
        if spec.kind == "interrupt":
            return spec
        return self._one(dataclasses.replace(spec, children=tuple(map(self.all_of, spec.children))))

    def _one(self, spec: NodeSpec) -> NodeSpec:
        path, step = spec.path_id, self.memory.steps.get(spec.path_id)
        if spec.kind == "skill":
            return self._skill(spec)
        if spec.kind in _CONDITIONAL and self._was_reached(path):
            self.made[path] = lambda node: _applies_as_before(node, self._begun(path))
        elif spec.kind == "repeat" and step is not None and step.status is not Status.INVALID:
            self.made[path] = _in_its_round
        elif spec.kind in _FORGETTING and step is not None and step.status in (Status.RUNNING, Status.SUCCESS):
            return _with_options(spec, forgets=())
        elif step is None or not step.ended:
            return spec
        elif spec.kind == "guard":
            over = step.status is Status.SUCCESS or self._failed(spec.children[0].path_id)
            self.made[path] = _Unguarded if over else lambda node: _AsBefore(node, step)
        elif spec.kind == "ask" and step.status is Status.SUCCESS and self._failed(spec.children[0].path_id):
            return dataclasses.replace(spec, kind="skip", options={"step": spec.options["step"]})
        elif (not spec.children or _is_over(spec, self.memory)) and all(k in self.memory.board for k in writes(spec)):
            self.made[path] = lambda node: _AsBefore(node, step)
        return spec

    def _skill(self, spec: NodeSpec) -> NodeSpec:
        """A leaf whose skill gives its result from before, or does its work."""
        skill, outputs = spec.options["skill"], spec.options["outputs"]
        ports = {port: self.memory.board[key] for port, key in outputs.items() if key in self.memory.board}
        resumed = resumed_skill(skill, spec.path_id, ports, self.recollection)
        resumed.outputs = {port: kind for port, kind in skill.outputs.items() if port in outputs}
        return _with_options(spec, skill=resumed)

    def _failed(self, path_id: str) -> bool:
        step = self.memory.steps.get(path_id)
        return step is not None and step.status is Status.FAILURE

    def _was_reached(self, path_id: str) -> bool:
        """Whether a branch of a selector was taken or passed over, as a later one shows that was begun."""
        parent = self.parents[path_id]
        if parent.kind != "selector":
            return False
        ways = [child.path_id for child in parent.children]
        step = self.memory.steps.get(parent.path_id)
        return (step is not None and step.ended) or any(map(self._begun, ways[ways.index(path_id) :]))

    def _begun(self, path_id: str) -> bool:
        step = self.memory.steps.get(path_id)
        return step is not None and step.status is not Status.INVALID


def _is_over(node: NodeSpec, memory: Memory) -> bool:
    """Whether what is below a node is not taken up: an interrupt, or a decision that was made."""
    step = memory.steps.get(node.path_id)
    return node.kind == "interrupt" or (node.kind == "decide" and step is not None and step.status is Status.SUCCESS)


def _paths_below(node: NodeSpec) -> Iterator[str]:
    return (below.path_id for child in node.children for below in child.walk())


def _in_its_round(node: Any) -> None:
    """Let rounds go on with the one that was under way."""
    node.taken_up = True


def _with_options(spec: NodeSpec, **options: Any) -> NodeSpec:
    return dataclasses.replace(spec, options={**spec.options, **options})


class _AsBefore:
    """Stands before a node: at its first tick it has the status that it had before the restart, and does nothing."""

    def __init__(self, node: Behaviour, step: StepRecord) -> None:
        self._node = node
        self._step: StepRecord | None = step
        self._pass_on: Callable[[], Iterator[Behaviour]] = node.tick
        vars(node)["tick"] = self._tick

    def _tick(self) -> Iterator[Behaviour]:
        node, step, self._step = self._node, self._step, None
        if step is None:
            yield from self._pass_on()
            return
        node.status = step.status
        if isinstance(node, Explained):
            node.cause, node.message = step.cause, _before(step.message)
        yield node


class _Unguarded:
    """Stands before a guard that came to its end before the restart: what it guarded need not be so any more.

    The first time the nodes below are ticked without it, so that they give their results once more.
    """

    def __init__(self, node: Guard) -> None:
        self._node, self._begun = node, False
        vars(node)["_held_back"] = self._held_back

    def _held_back(self) -> Status | None:
        if self._begun and self._node.status is not Status.RUNNING:
            del vars(self._node)["_held_back"]
            return self._node._held_back()
        self._begun = True
        return None


def _applies_as_before(node: Any, applied: bool) -> None:
    """Let a branch of a selector say at first what it said before the restart: the blackboard knows more by now."""
    answers = [applied]
    asked: Callable[[], bool] = node.applies
    vars(node)["applies"] = lambda: answers.pop() if answers else asked()


def told_before(message: str) -> bool:
    """Whether a node's sentence is that of a result from before a restart."""
    return message.endswith(f"({BEFORE})")


def _before(message: str) -> str:
    return message if told_before(message) else f"{message} ({BEFORE})"


def resumed_skill(
    skill: type[Skill[Any]], path: str, ports: Mapping[str, Any], recollection: Recollection
) -> type[Skill[Any]]:
    """A stand-in for a skill at one place of a tree that goes on: gives its result from before, or does its work."""
    skill.loaded()

    class Resumed(_Resumed):
        def __init__(self, context: SkillContext) -> None:
            super().__init__(context, skill(context), path, ports, recollection)

    for name in _DECLARED:
        if hasattr(skill, name):
            setattr(Resumed, name, getattr(skill, name))
    return Resumed


class _Resumed(Skill[Any]):
    """Wraps a skill of a tree that goes on."""

    def __init__(
        self, context: SkillContext, inner: Skill[Any], path: str, ports: Mapping[str, Any], recollection: Recollection
    ) -> None:
        super().__init__(context)
        self._inner, self._path, self._ports, self._recollection = inner, path, ports, recollection
        self._inputs: Any = None
        self._working = False

    def begin(self, inputs: Any) -> None:
        """Nothing yet: the first step says whether there is a result already."""
        self._inputs, self._working = inputs, False
        self.checkpoint = self._recollection.checkpoint(self._path)

    def step(self) -> Step:
        """The result from before, or a step of the skill."""
        if not self._working:
            known = self._known()
            if known is not None:
                return known
        step = self._inner.step()
        self.checkpoint = self._inner.checkpoint
        return step

    def suspend(self) -> None:
        """As the skill, if it works."""
        if self._working:
            self._inner.suspend()

    def resume(self, inputs: Any) -> None:
        """As the skill, if it works."""
        if self._working:
            self._inner.resume(inputs)

    def end(self) -> None:
        """As the skill, if it works."""
        if self._working:
            self._inner.end()

    def _known(self) -> Step | None:
        """The result from before the restart; None when the skill has begun to work."""
        result, context = self._recollection.result(self._path), self.context
        trusted = result is not None and not self._recollection.is_last(self._path)
        if not trusted and not self._recollection.awake(context.clock.now(), context.localiser.estimate().localised):
            return Running("looks at the state of the world after the restart")
        if result is None:
            self._work("goes on here")
            return None
        undone = None if trusted else self._inner.undone(self._inputs)
        if undone is not None:
            self._work(f"does it again, since {undone}")
            return None
        return self._told(result)

    def _work(self, sentence: str) -> None:
        self._working, self._inner.checkpoint = True, self.checkpoint
        self._recollection.goes_on(self._path, sentence)
        if self._recollection.looks_first(self._inner.changes_world):
            self._inner.resume(self._inputs)
        else:
            self._inner.begin(self._inputs)

    def _told(self, result: StepRecord) -> Step:
        self._recollection.used(self._path, f"{result.status.value.lower()} {BEFORE}: {result.message}")
        message = _before(result.message)
        if result.status is Status.SUCCESS:
            return Remembered(message, self._ports)
        return Failed(result.cause or Cause.EXECUTION, message)
