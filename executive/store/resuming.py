"""Resumes an interrupted mission: the same tree, in which finished skills repeat their results.

Ticks lead the tree back to the node where it was interrupted: a finished skill returns its result in its first tick, so
that the composites see the same results as before. Guards read the robot's present state. The interrupted skill gets
`resume` instead of `begin`, so that it checks the world before it changes it. Counts of attempts begin at one.
"""

import dataclasses
from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.run.mission_history import BEFORE, history_keys
from executive.store.recollection import Memory, Recollection, StepRecord
from executive.tree.behaviour import Conditional, ExplainedDecorator, ExplainedNode, MemoryComposite
from executive.tree.compiler import CompiledTree, build, writes
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.skill_leaf import SkillLeaf
from skills.api import Cause, Failed, Running, Skill, SkillContext, Step, Succeeded

_MARK: Final = f" ({BEFORE})"
_DECLARED: Final = tuple(name for name, hint in Skill.__annotations__.items() if str(hint).startswith("ClassVar"))


@dataclass(frozen=True)
class ResumedTree(CompiledTree):
    """Tree that starts with the stored blackboard; `restore` restores each node after the nodes are built."""

    board: Mapping[str, Any] = field(default_factory=dict)
    restore: Callable[[ExplainedNode], object] = field(default=lambda node: None)
    repeated: set[str] = field(default_factory=set)

    def build(self, context: RunContext) -> Behaviour:
        """Builds the py_trees tree, and fills its blackboard."""
        for key, value in self.board.items():
            context.board.put(key, value)
        context.hook.repeated = self.repeated
        root = build(self.root, context)
        for node in root.iterate():
            if isinstance(node, ExplainedNode):
                self.restore(node)
        return root


def resumed_tree(tree: CompiledTree, memory: Memory) -> tuple[ResumedTree, Recollection]:
    """Returns the tree that continues a mission, and the recollection for it; path ids stay the same.

    Interrupts are not restored; their conditions call them again. A decision keeps its result without its looks.
    """
    nodes = {node.path_id: node for node in tree.mission.walk()}
    afresh = {path for node in nodes.values() if node.behaviour.afresh for path in _paths(node)}
    settled = (node for node in nodes.values() if _is_settled(node, memory))
    over = afresh.union(path for node in settled for path in _paths(node) if path != node.path_id)
    specs = {path: node for path, node in nodes.items() if path not in afresh}
    by_status = {status: {p for p, step in memory.steps.items() if step.status is status} for status in Status}
    usable = [
        path
        for path, leaf in nodes.items()
        if leaf.skill is not None and path not in over
        if path in by_status[Status.FAILURE] or all(key in memory.board for key in leaf.options["outputs"].values())
    ]
    recollection = Recollection(tree.path_ids, memory.steps).restrict(usable)
    root = _with_resumed_skills(tree.root, specs.keys(), memory, recollection)
    keys = history_keys(tree.robot_name, tree.mission_name)
    asked_again = {path for path, node in specs.items() if node.children}
    again = {
        keys.answered_before: frozenset(by_status[Status.SUCCESS] & asked_again - over),
        keys.ended_before: frozenset((by_status[Status.SUCCESS] | by_status[Status.FAILURE]) - over),
    }
    restore, board = _Past(memory, specs).restore, {**memory.board, **again}
    return _as_resumed(tree, restore, board, root=root, repeated=recollection.repeated), recollection


def ended_tree(tree: CompiledTree, memory: Memory) -> tuple[ResumedTree, Recollection] | None:
    """Returns the tree of a mission that had ended while other robots still worked; None if it had not ended.

    The nodes have their last states, the root from its first tick on, and no skill runs, because another robot may have
    changed the result since. A mission that ended with an internal error counts as not ended.
    """
    ended = memory.steps.get(tree.root.path_id)
    if ended is None or not ended.ended or ended.cause is Cause.ERROR:
        return None

    def restore(node: ExplainedNode) -> None:
        """Restores a node's last state; the root restores its state in its first tick."""
        step = memory.steps.get(node.path_id)
        if node.path_id == tree.root.path_id:
            _repeat(node, ended)
        elif step is not None and step.ended:
            node.restore(step.status, step.cause, step.message)

    recollection = Recollection(tree.path_ids, {})
    recollection.log.append(f"{tree.root.path_id}: {ended.status.value.lower()} {BEFORE}: {ended.message}")
    return _as_resumed(tree, restore, memory.board), recollection


def _as_resumed(
    tree: CompiledTree, restore: Callable[[ExplainedNode], object], board: Mapping[str, Any], **changed: Any
) -> ResumedTree:
    own = {each.name: getattr(tree, each.name) for each in dataclasses.fields(CompiledTree)}
    return ResumedTree(**{**own, **changed}, board=board, restore=restore)


def _paths(node: NodeSpec) -> Iterator[str]:
    return (below.path_id for below in node.walk())


def _is_settled(node: NodeSpec, memory: Memory) -> bool:
    step = memory.steps.get(node.path_id)
    return node.behaviour.settled and step is not None and step.status is Status.SUCCESS


def _with_resumed_skills(
    spec: NodeSpec, restored: Container[str], memory: Memory, recollection: Recollection
) -> NodeSpec:
    """Replaces the skills to restore by skills that repeat their results from before the restart, or else work."""
    if spec.skill is None or spec.path_id not in restored:
        children = (_with_resumed_skills(child, restored, memory, recollection) for child in spec.children)
        return dataclasses.replace(spec, children=tuple(children))
    skill, outputs = spec.options["skill"], spec.options["outputs"]
    ports = {port: memory.board[key] for port, key in outputs.items() if key in memory.board}
    resumed = resumed_skill(skill, spec.path_id, ports, recollection)
    resumed.outputs = {port: kind for port, kind in skill.outputs.items() if port in outputs}
    return spec.with_options(skill=resumed)


@dataclass(frozen=True)
class _Past:
    """Stored states of a mission's nodes; `specs` are the nodes to be restored."""

    memory: Memory
    specs: Mapping[str, NodeSpec]

    def restore(self, node: ExplainedNode) -> None:
        """Restores any node but a skill, because skills restore themselves.

        A branch that was skipped before is skipped again. A running composite keeps its blackboard keys. A decorator
        ticks its child again even if its condition would prevent this, because the condition may have changed after the
        child's result. A leaf repeats its state, and so does a decorator that failed although its child did not.
        """
        spec, step = self.specs.get(node.path_id), self.memory.steps.get(node.path_id)
        if spec is None or isinstance(node, SkillLeaf):
            return
        if isinstance(node, Conditional) and self._was_reached(node):
            node.hook.applied[node.path_id] = self._status(node) is not Status.INVALID
        elif step is None or step.status is Status.INVALID:
            return
        elif isinstance(node, MemoryComposite) and not _is_settled(spec, self.memory):
            node.resumed = step.status is not Status.FAILURE
        elif step.ended and isinstance(node, ExplainedDecorator):
            if step.status is Status.SUCCESS or self._status(node.decorated) is Status.FAILURE:
                node.before = step.status
                node.hook.unheld.add(node.path_id)
            else:
                _repeat(node, step)
        elif step.ended and all(key in self.memory.board for key in writes(spec)):
            _repeat(node, step)

    def _status(self, node: Any) -> Status:
        step = self.memory.steps.get(node.path_id) if isinstance(node, ExplainedNode) else None
        return Status.INVALID if step is None else step.status

    def _was_reached(self, node: Any) -> bool:
        """Returns whether a branch was begun or passed over: its parent ended, or a later branch was begun."""
        parent = node.parent
        if parent is None:
            return False
        later = parent.children[parent.children.index(node) :]
        ended = self._status(parent) in (Status.SUCCESS, Status.FAILURE)
        return ended or any(self._status(each) is not Status.INVALID for each in later)


def _repeat(node: ExplainedNode, step: StepRecord) -> None:
    """Makes a node repeat its stored state in its first tick instead of working."""
    node.hook.restored[node.path_id] = (step.status, step.cause, _before(step.message))


def _before(message: str) -> str:
    return f"{message.removesuffix(_MARK)}{_MARK}"


def resumed_skill(
    skill: type[Skill[Any]], path: str, ports: Mapping[str, Any], recollection: Recollection
) -> type[Skill[Any]]:
    """Returns a stand-in for a skill at one node of a resumed tree, which repeats the stored result or works."""

    class Resumed(_Resumed):
        def __init__(self, context: SkillContext) -> None:
            super().__init__(context, skill(context), path, ports, recollection)

    for name in _DECLARED:
        if hasattr(skill, name):
            setattr(Resumed, name, getattr(skill, name))
    return Resumed


class _Resumed(Skill[Any]):
    """Skill of a resumed tree that wraps another."""

    def __init__(
        self, context: SkillContext, inner: Skill[Any], path: str, ports: Mapping[str, Any], recollection: Recollection
    ) -> None:
        super().__init__(context)
        self._inner, self._path, self._ports, self._recollection = inner, path, ports, recollection
        self._inputs: Any = None
        self._working = False

    def begin(self, inputs: Any) -> None:
        """Stores the inputs; the first step decides whether a stored result can be repeated."""
        self._inputs, self._working = inputs, False
        self.checkpoint = self._recollection.checkpoint(self._path)

    def step(self) -> Step:
        """Returns the result from before the restart, or a step of the skill."""
        if not self._working:
            known = self._result()
            if known is not None:
                return known
        step = self._inner.step()
        self.checkpoint = self._inner.checkpoint
        return step

    def suspend(self) -> None:
        """Suspends the skill if it works."""
        if self._working:
            self._inner.suspend()

    def resume(self, inputs: Any) -> None:
        """Resumes the skill if it works."""
        if self._working:
            self._inner.resume(inputs)

    def end(self) -> None:
        """Ends the skill if it works."""
        if self._working:
            self._inner.end()

    def _result(self) -> Step | None:
        """Returns the result from before the restart, or begins the skill and returns None."""
        result, context = self._recollection.result(self._path), self.context
        trusted = result is not None and not self._recollection.is_last(self._path)
        if not trusted and not self._recollection.is_awake(context.clock.now(), context.localiser.estimate().localised):
            return Running("looks at the state of the world after the restart")
        if result is None:
            self._work()
            return None
        undone = None if trusted else self._inner.undone(self._inputs)
        if undone is not None:
            self._work(f"does it again, since {undone}")
            return None
        self._recollection.note_use(self._path, f"{result.status.value.lower()} {BEFORE}: {result.message}")
        message = _before(result.message)
        if result.status is Status.SUCCESS:
            return Succeeded(message, self._ports)
        return Failed(result.cause or Cause.EXECUTION, message)

    def _work(self, sentence: str = "") -> None:
        self._working, self._inner.checkpoint = True, self.checkpoint
        self._recollection.note_work(self._path, sentence)
        if self._recollection.must_check_first(self._inner.changes_world):
            self._inner.resume(self._inputs)
        else:
            self._inner.begin(self._inputs)
