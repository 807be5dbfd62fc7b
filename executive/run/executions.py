"""When each part of a mission ran, and whether what it did counts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.run.outcome import Execution
from executive.tree.behaviour import Explained
from executive.tree.board import Board
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeSpec
from executive.words.slug import slug
from skills.api import Part
from skills.robot import Clock

__all__ = ["Executions", "execution_keys", "is_speech"]

_ENDED: Final = (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class ExecutionKeys:
    """The blackboard keys of one mission: when its robot last drove, and the nodes that end once more after a restart
    because they had ended before."""

    moved: str
    again: str

    @staticmethod
    def of_node(path_id: str) -> str:
        """The key of a node's executions."""
        return f"{path_id}/executions"


def execution_keys(robot_name: str, mission_name: str) -> ExecutionKeys:
    """The keys for a mission."""
    base = f"{slug(robot_name)}/{slug(mission_name)}"
    return ExecutionKeys(f"{base}/moved", f"{base}/executed-before")


def is_speech(node: NodeSpec) -> bool:
    """Whether a node is a skill that says a text."""
    says = "text" in node.options.get("inputs", {})
    return node.kind == "skill" and says and node.options["skill"].uses == {Part.VOICE}


class Executions:
    """Notes the executions of a mission's parts and of what it says, on the blackboard, which outlives a restart.

    A node that had ended before a restart, and whose result is only given again, keeps its first times.
    """

    def __init__(self, tree: CompiledTree, nodes: Iterable[Behaviour], board: Board, clock: Clock) -> None:
        self._board, self._clock = board, clock
        self._keys = execution_keys(tree.robot_name, tree.mission_name)
        parts = {part.node or part.path_id for part in tree.parts}
        self._parts = frozenset(n.path_id for n in tree.root.walk() if n.path_id in parts or is_speech(n))
        self._below: Mapping[str, frozenset[str]] = dict(_below(tree.root, self._parts))
        self._base = frozenset(
            n.path_id for n in tree.root.walk() if n.kind == "skill" and Part.BASE in n.options["skill"].uses
        )
        named = {node.path_id: node for node in nodes if isinstance(node, Explained) and isinstance(node, Behaviour)}
        self._nodes = {path: named[path] for path in self._below if path in named}
        self._drivers = {path: named[path] for path in self._base if path in named}
        self._driving = {path for path, node in self._drivers.items() if node.status is Status.RUNNING}
        self._open = {path for path in self._nodes if self._last_is_open(path)}
        self._taken_up = set(self._open)
        self._moved_s = board.get(self._keys.moved) if self._keys.moved in board else None
        for path, node in self._nodes.items():
            _Watch(node, begun=lambda path=path: self._begin(path), ended=lambda ok, path=path: self._end(path, ok))  # type: ignore[misc]

    @property
    def all(self) -> tuple[Execution, ...]:
        """The executions so far, in the order of their ends; those that are not over come last."""
        found = [one for path in self._parts for one in self._of(path)]
        last = float("inf")
        return tuple(sorted(found, key=lambda one: (last if one.ended_s is None else one.ended_s, one.began_s)))

    @property
    def moved_s(self) -> float | None:
        """When a skill that may drive last ran; None: never."""
        return self._moved_s

    def after_tick(self, changed: Iterable[str]) -> None:
        """Note what was stopped in this tick, and whether the robot may drive; `changed` are nodes that changed."""
        for path in [path for path in self._open if self._nodes[path].status is not Status.RUNNING]:
            if path not in self._taken_up:
                self._end(path, done=False)
        moving = self._drivers.keys() & set(changed)
        ended = [path for path in moving if self._drivers[path].status in _ENDED]
        self._driving -= moving
        self._driving |= {path for path in moving if self._drivers[path].status is Status.RUNNING}
        if self._driving or ended:
            self._moved_s = self._clock.now()
            if moving or self._keys.moved not in self._board:
                self._board.put(self._keys.moved, self._moved_s)

    def _begin(self, path: str) -> None:
        if path in self._taken_up:
            self._taken_up.discard(path)
            return
        if path in self._open:
            self._end(path, done=False)
        self._open.add(path)
        kept = self._of(path) if path in self._parts else ()
        self._put(path, (*kept, Execution(path, self._clock.now())))

    def _end(self, path: str, done: bool) -> None:
        """An execution is over: what ran in it, below the node, does not count unless it is done."""
        self._open.discard(path)
        executions = self._of(path)
        *before, one = executions
        again = self._again
        if path in again:
            self._board.put(self._keys.again, again - {path})
            if done:
                self._put(path, before)
                return
        if not done:
            for below in self._below[path] - {path}:
                spoiled = (replace(each, done=each.done and each.began_s < one.began_s) for each in self._of(below))
                self._put(below, spoiled)
        over = replace(one, ended_s=self._clock.now(), done=done)
        self._put(path, (*before, over) if path in self._parts else ())

    @property
    def _again(self) -> frozenset[str]:
        again: frozenset[str] = self._board.get(self._keys.again) if self._keys.again in self._board else frozenset()
        return again

    def _last_is_open(self, path: str) -> bool:
        found = self._of(path)
        return bool(found) and found[-1].ended_s is None

    def _of(self, path: str) -> tuple[Execution, ...]:
        key = self._keys.of_node(path)
        kept: tuple[tuple[float, float | None, bool], ...] = self._board.get(key) if key in self._board else ()
        return tuple(Execution(path, *one) for one in kept)

    def _put(self, path: str, executions: Iterable[Execution]) -> None:
        kept = tuple((one.began_s, one.ended_s, one.done) for one in executions)
        key = self._keys.of_node(path)
        if kept or key in self._board:
            self._board.put(key, kept)


def _below(node: NodeSpec, parts: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    """The parts at and below each node that has any."""
    found = frozenset(below.path_id for below in node.walk()) & parts
    if found:
        yield node.path_id, found
        for child in node.children:
            yield from _below(child, parts)


class _Watch:
    """Stands before one node, and tells when it begins and when it ends by itself."""

    def __init__(self, node: Behaviour, begun: Callable[[], None], ended: Callable[[bool], None]) -> None:
        self._node, self._begun, self._ended = node, begun, ended
        self._pass_on: Callable[[], Iterator[Behaviour]] = node.tick
        vars(node)["tick"] = self._tick

    def _tick(self) -> Iterator[Behaviour]:
        if self._node.status is not Status.RUNNING:
            self._begun()
        yield from self._pass_on()
        if self._node.status in _ENDED:
            self._ended(self._node.status is Status.SUCCESS)
