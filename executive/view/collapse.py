"""Folds large trees: nodes that succeeded or have not begun are hidden, running and failed ones are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from py_trees.common import Status

from executive.tree.node_view import NodeView
from executive.view.text import is_closed

MANY_NODES = 80
DRAWN_NODES = 40
_PLUMBING = frozenset({"monitor", "remember"})


def fold_below(root: NodeView, depth: int) -> NodeView:
    """The tree down to `depth` levels below the root; `hidden` counts the deeper nodes.

    Raises ValueError: a negative depth.
    """
    if depth < 0:
        raise ValueError(f"a depth is at least 0, not {depth}")
    if depth == 0:
        return replace(root, children=(), hidden=root.below)
    return replace(root, children=tuple(fold_below(child, depth - 1) for child in root.children))


def fold_to(root: NodeView, most: int = MANY_NODES) -> NodeView:
    """The tree with about `most` visible nodes at most.

    Subtrees that have not begun are folded first, then those that succeeded, the deepest first. The root, its
    children, and the path to each running, failed or cancelled node stay visible.
    """
    deepest = max(depth for depth, _ in root.walk())
    shown = root
    for foldable in (_idle, is_closed):
        for level in range(deepest, 0, -1):
            if sum(1 for _ in shown.walk()) <= most:
                return shown
            shown = _folded(shown, foldable, level, 0)
    return shown


def executed_tree(root: NodeView) -> NodeView:
    """The nodes that ran, with their actions in their names, without those that only pass on their one child's result.

    Conditions that held and stored poses are left out, too. Nodes that failed or were cancelled never are.
    """
    return _ran(root, None)


def _ran(node: NodeView, above: NodeView | None) -> NodeView:
    below = tuple(_ran(child, node) for child in node.children if not _unseen(child))
    if len(below) == 1 and (node.state.cause is None or node.state.message == below[0].state.message):
        return below[0]
    return replace(node, name=node.title(above), children=below)


def _unseen(node: NodeView) -> bool:
    return node.state.cause is None and (node.state.status is Status.INVALID or node.kind in _PLUMBING)


def _folded(node: NodeView, foldable: Callable[[NodeView], bool], level: int, depth: int) -> NodeView:
    """Folds every subtree at `level` or deeper whose nodes are all foldable."""
    if depth >= level and all(foldable(below) for _, below in node.walk()):
        return replace(node, children=(), hidden=node.below)
    return replace(node, children=tuple(_folded(child, foldable, level, depth + 1) for child in node.children))


def _idle(node: NodeView) -> bool:
    return is_closed(node) and node.state.status is Status.INVALID
