"""The live tree with its progress line, for as long as a mission runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext

from py_trees.common import Status
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from executive.cli.keys import HELP, Keys, keys_pressed, prompt_lines
from executive.run.control import Control
from executive.run.runner import Observer, Progress
from executive.tree.compiler import CompiledTree
from executive.tree.node_view import node_view
from executive.tree.snapshot import NodeState, Snapshot
from executive.view.styles import Styles
from executive.view.text import to_rich

REFRESH_S = 0.2
BAR_CELLS = 20
FEWEST_ROWS = 5
PROMPT_STYLE, HELP_STYLE = "bold yellow", "dim"


@contextmanager
def live_view(
    tree: CompiledTree, console: Console, control: Control | None = None, *, say: Callable[[str], str] | None = None
) -> Iterator[Observer]:
    """Show the tree while the mission runs; without a terminal, one line for each skill that ends.

    Where somebody sits at a terminal, keys control the run, and `say` answers the sentences that are typed.
    """
    hands = control or Control(pace=None)
    keys = Keys(hands, say)
    with keys_pressed(keys) if control is not None else nullcontext(False) as heard:
        if not console.is_terminal:
            yield _Lines(tree, console)
            return
        with Live(console=console, auto_refresh=False, transient=True, vertical_overflow="crop") as live:
            yield _Picture(live, lambda now_s: prompt_lines(hands.state, now_s, keys.typing) if heard else [])


class _Picture:
    """Redraws the tree of the mission under way a few times a second, with `prompt(now_s)` below."""

    def __init__(self, live: Live, prompt: Callable[[float], Sequence[str]]) -> None:
        self._live, self._prompt, self._drawn_s = live, prompt, 0.0

    def __call__(self, progress: Progress) -> None:
        """Draw when it is time again."""
        now = time.perf_counter()
        if now - self._drawn_s < REFRESH_S:
            return
        self._drawn_s = now
        trees = [(tree, progress.states[name]) for name, tree in progress.trees.items()]
        pictures = [to_rich(node_view(tree.root, states)) for tree, states in trees]
        lines = [progress_line(_of_tree(tree, states), progress.now_s) for tree, states in trees]
        prompt = [
            Text(line, style=HELP_STYLE if line.startswith(HELP) else PROMPT_STYLE, overflow="fold")
            for line in self._prompt(progress.now_s)
        ]
        below = sum(len(text.split("\n")) for text in (*lines, *prompt))
        rows = max(FEWEST_ROWS, (self._live.console.height - below) // max(1, len(pictures)))
        shown = [fitted(picture, rows) for picture in pictures]
        self._live.update(Group(*shown, *lines, *prompt), refresh=True)


def fitted(picture: Text, rows: int) -> Text:
    """At most so many lines of a tree, with what runs among them."""
    lines = picture.split("\n")
    if len(lines) <= rows:
        return picture
    running = [number for number, line in enumerate(lines) if Styles.RUNNING.value.symbol in line.plain]
    middle = running[-1] if running else 0
    first = max(0, min(middle - 2 * rows // 3, len(lines) - rows))
    return Text("\n", no_wrap=True, overflow="ellipsis").join(lines[first : first + rows])


def _of_tree(tree: CompiledTree, states: Snapshot) -> Snapshot:
    """The states of one mission's nodes, without those that wait below it."""
    return {path_id: states[path_id] for path_id in tree.path_ids}


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
