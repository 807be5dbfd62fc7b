"""The live tree with its progress line, for as long as a mission runs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from py_trees.common import Status
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from executive.compiler import CompiledTree
from executive.runner import Observer, Progress
from executive.snapshot import NodeState, Snapshot
from executive.view.model import node_view
from executive.view.text import to_rich

REFRESH_S = 0.2
BAR_CELLS = 20


@contextmanager
def live_view(tree: CompiledTree, console: Console) -> Iterator[Observer]:
    """Show the tree while the mission runs; without a terminal, one line for each skill that ends."""
    if not console.is_terminal:
        yield _Lines(tree, console)
        return
    with Live(console=console, auto_refresh=False, transient=True, vertical_overflow="crop") as live:
        yield _Picture(tree, live)


class _Picture:
    """Redraws the tree a few times a second."""

    def __init__(self, tree: CompiledTree, live: Live) -> None:
        self._tree, self._live, self._drawn_s = tree, live, 0.0

    def __call__(self, progress: Progress) -> None:
        """Draw when it is time again."""
        now = time.perf_counter()
        if now - self._drawn_s < REFRESH_S:
            return
        self._drawn_s = now
        states = progress.states[self._tree.robot_name]
        line = progress_line(states, progress.now_s)
        self._live.update(Group(to_rich(node_view(self._tree.root, states)), line), refresh=True)


class _Lines:
    """Writes a line whenever a skill has ended."""

    def __init__(self, tree: CompiledTree, console: Console) -> None:
        self._tree, self._console = tree, console
        self._leaves = [node.path_id for node in tree.root.walk() if not node.children]
        self._shown: dict[str, NodeState] = {}

    def __call__(self, progress: Progress) -> None:
        """Write what ended since the last tick."""
        states = progress.states[self._tree.robot_name]
        for leaf in self._leaves:
            state = states[leaf]
            ended = state.status in (Status.SUCCESS, Status.FAILURE)
            if ended and self._shown.get(leaf) != state:
                cause = f" {state.cause.value}:" if state.cause else ""
                self._console.print(
                    f"{progress.now_s:7.2f} s  {leaf}  {state.status.value}{cause} {state.message}", markup=False
                )
            self._shown[leaf] = state


def progress_line(states: Snapshot, now_s: float) -> Text:
    """Time, how far the present skill has come where it says so, and what it does."""
    running = [state for state in states.values() if state.status is Status.RUNNING]
    state = running[-1] if running else NodeState()
    done = round((state.progress or 0.0) * BAR_CELLS)
    bar = f" [{'█' * done}{'·' * (BAR_CELLS - done)}]" if state.progress is not None else ""
    return Text(f"\n{now_s:7.1f} s{bar} {state.message}", style="bold", no_wrap=True, overflow="ellipsis")
