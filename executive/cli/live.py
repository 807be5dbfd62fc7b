"""The live tree with its progress line, for as long as a mission runs, and a line for each skill that has ended."""

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
from executive.run.visitor import Progress, RunVisitor
from executive.tree.compiler import CompiledTree
from executive.tree.node_view import NodeView, node_view
from executive.tree.snapshot import NodeState, Snapshot
from executive.view.styles import Styles, style_of
from executive.view.text import printable, to_rich

REFRESH_S = 0.2
BAR_CELLS = 20
FEWEST_ROWS = 5
_TOLD = frozenset({"skill", "fallen"})
_UNDER_WAY = (Styles.IDLE.value, Styles.RUNNING.value)
PROMPT_STYLE, HELP_STYLE = "bold yellow", "dim"


@contextmanager
def live_view(
    console: Console, control: Control | None = None, *, say: Callable[[str], str] | None = None
) -> Iterator[RunVisitor]:
    """Show the tree while the mission runs, and write a line for each skill that ends.

    Where somebody sits at a terminal, keys control the run, and `say` answers the sentences that are typed.
    """
    hands = control or Control(pace=None)
    keys = Keys(hands, say)
    with keys_pressed(keys) if control is not None else nullcontext(False) as heard:
        lines = _Lines(console)
        if not console.is_terminal:
            yield lines
            return
        with Live(console=console, auto_refresh=False, transient=True, vertical_overflow="crop") as live:
            yield _Picture(lines, live, lambda now_s: prompt_lines(hands.state, now_s, keys.typing) if heard else [])


class _Lines(RunVisitor):
    """Writes a line whenever a skill has ended."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._leaves: dict[str, dict[str, str]] = {}
        self._last: dict[str, NodeState] = {}
        self._begun_s: dict[str, float] = {}

    def tick(self, progress: Progress) -> None:
        """Write what ended since the last tick."""
        for robot, tree in progress.trees.items():
            if tree.root.path_id not in self._leaves:
                self._leaves[tree.root.path_id] = _skill_titles(node_view(tree.root))
            for path_id, title in self._leaves[tree.root.path_id].items():
                self._tell(path_id, title, progress.states[robot][path_id], progress.now_s)

    def _tell(self, path_id: str, title: str, state: NodeState, now_s: float) -> None:
        before = self._last.get(path_id, NodeState())
        if state is before:
            return
        self._last[path_id] = state
        if before.status is not Status.RUNNING:
            self._begun_s[path_id] = now_s
        if style_of(state) not in _UNDER_WAY and before != state:
            self._console.print(skill_line(title, state, now_s - self._begun_s[path_id]))


class _Picture(RunVisitor):
    """Writes those `lines`, and redraws the tree under way a few times a second, with `prompt(now_s)` below."""

    def __init__(self, lines: _Lines, live: Live, prompt: Callable[[float], Sequence[str]]) -> None:
        self._lines, self._live, self._prompt, self._drawn_s = lines, live, prompt, 0.0

    def tick(self, progress: Progress) -> None:
        """Write; draw when it is time again."""
        self._lines.tick(progress)
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


def _skill_titles(node: NodeView, above: NodeView | None = None) -> dict[str, str]:
    """What the skills below do, by path id."""
    if node.kind in _TOLD:
        return {node.path_id: node.title(above)}
    return {path_id: title for child in node.children for path_id, title in _skill_titles(child, node).items()}


def skill_line(title: str, state: NodeState, took_s: float) -> Text:
    """A skill that has ended: its mark, how long it took, what it did, and what came of it."""
    style = style_of(state)
    cause = state.cause.value if state.cause else ""
    what = printable(": ".join(filter(None, (title, cause, state.message))))
    return Text.assemble((style.symbol, style.rich), f" {took_s:6.1f} s  {what}")


def progress_line(states: Snapshot, now_s: float) -> Text:
    """Time, how far the present skill has come where it says so, and what it does."""
    running = [state for state in states.values() if state.status is Status.RUNNING]
    state = running[-1] if running else NodeState()
    done = round((state.progress or 0.0) * BAR_CELLS)
    bar = f" [{'█' * done}{'·' * (BAR_CELLS - done)}]" if state.progress is not None else ""
    return Text(f"\n{now_s:7.1f} s{bar} {state.message}", style="bold", no_wrap=True, overflow="ellipsis")
