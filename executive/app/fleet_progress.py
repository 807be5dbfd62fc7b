"""How far a mission of a fleet is, so that another robot can go on with it without doing anything twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from py_trees.common import Status

from executive.run.visitor import TickNote
from executive.tree.behaviours.conditions import KnowsPlace
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeSpec

__all__ = ["Progress", "ProgressJournal", "is_lost", "is_plain", "progress_of"]

_TOUCHED: Final = (Status.RUNNING, Status.SUCCESS)


@dataclass(frozen=True)
class Progress:
    """What of a tree is done: the first `done` commands for good, and whether what comes after has been `begun`: a
    skill that changes the world has done its work, or does it; with `put`, one that gives away what was taken."""

    done: int
    begun: bool = False
    put: bool = False


def is_plain(tree: CompiledTree) -> bool:
    """Whether a mission is nothing but commands, one after the other."""
    plain = len(tree.parts) == len(tree.commands) and all(step.block is None for step in tree.steps)
    return plain and len(tree.steps) == 1


def progress_of(tree: CompiledTree, statuses: Callable[[str], Status | None]) -> Progress:
    """What of a tree is done by what its nodes said, by path id.

    Another robot can go on before a command that needs nothing in the gripper. A mission that has more than plain
    commands is done as a whole.
    """
    done = 0
    for number, part in enumerate(tree.parts if is_plain(tree) else ()):
        if statuses(part.node or part.path_id) is not Status.SUCCESS:
            break
        after = number + 1
        if after == len(tree.parts) or tree.commands[after].item is None:
            done = after
    over = {part.path_id for part in tree.parts[:done]}
    begun = [leaf for leaf in _changing(tree.mission, over) if statuses(leaf.path_id) in _TOUCHED]
    return Progress(done, bool(begun), any(not leaf.options["skill"].gripper_after for leaf in begun))


def is_lost(tree: CompiledTree, statuses: Callable[[str], Status | None]) -> bool:
    """Whether a mission ended because its robot did not find out where it is."""
    watches = (node for node in tree.root.walk() if node.kind == "interrupt")
    lost = (node.path_id for node in watches if isinstance(node.options["condition"], KnowsPlace))
    return any(statuses(path_id) is Status.FAILURE for path_id in lost)


def _changing(node: NodeSpec, over: set[str]) -> list[NodeSpec]:
    """The skills below a node that change the world, without those of commands that are done."""
    if any(node.path_id == path or node.path_id.startswith(f"{path}/") for path in over):
        return []
    own = [node] if node.kind == "skill" and node.options["skill"].changes_world else []
    return own + [leaf for child in node.children for leaf in _changing(child, over)]


class ProgressJournal:
    """Tells how far a mission is whenever that changes."""

    def __init__(self, tree: CompiledTree, tell: Callable[[Progress], None]) -> None:
        self._tree, self._tell = tree, tell
        self._statuses: dict[str, Status] = {}
        self.progress = Progress(0)

    def note(self, note: TickNote) -> None:
        """Keep what a tick brought."""
        if not note.changes:
            return
        for change in note.changes:
            if change.after.status is not Status.INVALID:  # a node that is reset was done all the same
                self._statuses[change.path_id] = change.after.status
        progress = progress_of(self._tree, self._statuses.get)
        if progress != self.progress:
            self.progress = progress
            self._tell(progress)
