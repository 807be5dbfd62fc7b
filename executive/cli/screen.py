"""Display of a run at the terminal: commands, live tree, a line for each ended skill, and verdicts."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from py_trees.common import Status
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from executive.app.prepare.prepared import Prepared
from executive.app.runs.backend import Observe
from executive.app.runs.one_run import FinishedRun
from executive.app.runs.profile import Profile
from executive.app.runs.queue import RunOptions
from executive.cli.options import stay_s
from executive.cli.output import plain_lines
from executive.cli.run_keys import HELP, Keys, prompt_lines, read_keys
from executive.language.parser import load_parser
from executive.record.history import RECORDING
from executive.run.control import Control
from executive.run.outcome import RunResult
from executive.run.visitor import Progress, RunVisitor
from executive.speech.voice import Silence, Voice, queued_voice
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeState, Snapshot
from executive.tree.node_view import NodeView, node_view
from executive.view.text import Styles, printable, style_of, to_rich
from executive.words.schemas import SPEECH

if TYPE_CHECKING:
    from executive.app.runs.page_view import PageView

SILENCE: Final = Silence()


def voice_for(aloud: bool) -> AbstractContextManager[Voice]:
    """Opens a voice, silent unless `aloud`; its end waits for the last sentence. Raises InputError without a voice."""
    return closing(queued_voice()) if aloud else nullcontext(SILENCE)


@dataclass(frozen=True)
class SpeechOutput(RunVisitor):
    """Visitor that outputs a robot's speech: by a voice that does not block, and on the console unless `quiet`.

    Speech in a silent zone appears only on the console.

    The console shows speech at the end of the tick, after the skills that have ended.
    """

    console: Console
    voice: Voice
    quiet: bool
    _said: list[str] = field(default_factory=list, init=False)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Says the text of a speech message."""
        if topic == SPEECH:
            robot, text = (str(message.get(name, "")) for name in ("robot", "text"))
            if not self.quiet:
                self._said.append(printable(f"{robot}: {text}"))
            if not message.get("silent"):
                self.voice.say(text)
        return message

    def tick(self, progress: Progress) -> None:
        """Prints the speech since the last tick."""
        self._print()

    def end(self, result: RunResult) -> None:
        """Prints the speech after the last tick."""
        self._print()

    def _print(self) -> None:
        for line in self._said:
            self.console.print(Text(line, style="bold"))
        self._said.clear()


def page_of(console: Console, address: tuple[str, int], store: Path, out: Path) -> Callable[[Prepared], PageView]:
    """Returns the function that builds the live page of a run, on which more missions are queued in the store."""

    def build(prepared: Prepared) -> PageView:
        from executive.app.runs.page_view import PageView, add_to, queue_function

        later = queue_function(replace(prepared.request, out=out), partial(add_to, store))
        return PageView(prepared, plain_lines(console), address=address, later=later)

    return build


@dataclass
class ConsoleScreen:
    """Display and control of runs on the console.

    `page` builds the live page of a run, and `shown_page` is the last page. With `whole_tree` the console shows all
    nodes of the tree at the end. `profile` times the subsystems. `observing` adds visitors to each run.
    """

    console: Console
    quiet: bool
    whole_tree: bool = False
    voice: Voice = SILENCE
    page: Callable[[Prepared], PageView] | None = None
    profile: Profile | None = None
    observing: Sequence[Observe] = ()
    shown_page: PageView | None = field(default=None, init=False)

    def tell(self, line: str, *, title: bool = False) -> None:
        """Shows a line."""
        self.console.print(line, markup=False, style="bold" if title else None)

    @contextmanager
    def watch(self, prepared: Prepared) -> Iterator[RunOptions]:
        """Shows the commands, then the tree and the robot's speech during the run; console or page control the run."""
        for note in dict.fromkeys(note for each in prepared.all for note in each.mission.notes):
            self.tell(f"{note}.")
        for line in (*prepared.request.scenario.lines(), *prepared.request.variation.lines()):
            self.tell(f"Scenario: {line}")
        for each in prepared.all:
            to = f"{each.mission.robot_name}: " if prepared.request.robots else ""
            for command in each.mission.commands:
                self.tell(f"{to}{command}")
        if self.shown_page is not None:
            self.shown_page.close()
        page = self.shown_page = None if self.page is None else self.page(prepared)
        attended = self.console.is_terminal and sys.stdin.isatty() and not self.quiet
        control = Control(attended=attended, pace=1.0 if attended else None) if page is None else page.control
        speech = SpeechOutput(self.console, self.voice, self.quiet)
        joining = [observe(prepared, control) for observe in self.observing]
        if page is None and (self.quiet or sys.stdin is None or not sys.stdin.isatty()):  # no user can speak to the run
            load_parser().release()
            with nullcontext() if self.quiet else live_view(self.console) as view:
                shown = (speech, *joining) if view is None else (view, speech, *joining)
                yield RunOptions(control, (*shown, *self._displays()))
            return
        from executive.app.runs.conversations import Conversations, load_ahead  # the grammar of sentences

        own = None if page is None else page.conversations
        conversations = own or Conversations(prepared, control)
        conversations.set_missions()
        answered = live_view(self.console, control, say=lambda text: conversations.hear(text).text)
        with nullcontext() if self.quiet else answered as view:
            if control.attended and page is None:
                load_ahead()
            visitors = (speech, conversations) if view is None else (view, speech, conversations)
            yield RunOptions(control, (*visitors, *joining, *self._displays()))

    def _displays(self) -> tuple[RunVisitor, ...]:
        """Returns the page and the profile, of those that there are."""
        made = (self.shown_page, self.profile)
        return tuple(each for each in made if isinstance(each, RunVisitor))

    def conclude(self, finished: FinishedRun) -> None:
        """Shows verdicts and figures, after the whole tree if `whole_tree`."""
        if self.whole_tree:
            self.console.print(to_rich(finished.tree, collapsed=False))
        for line in finished.report.lines():
            self.console.print(line)

    def stay(self, view: float | None, *, hung_up: bool = False) -> None:
        """Shows the last page for as long as the option `--view` says; not at all once the terminal was closed."""
        if self.shown_page is not None and view is not None:
            self.shown_page.stay(0.0 if hung_up else stay_s(view))

    def name_files(self, out: Path) -> None:
        """Names the files in a folder with their content, the most important first; omits hidden files."""
        names = {path.name for path in out.iterdir() if not path.name.startswith((".", "missions."))}
        known = [name for name in WRITTEN if name in names]
        width = max(map(len, names), default=0)
        self.tell(f"Written to {out}:")
        for name in (*known, *sorted(names.difference(known))):
            self.tell(f"  {name:<{width}}  {WRITTEN.get(name) or WRITTEN.get(_OWN.sub('', name), '')}".rstrip())


WRITTEN: Final[Mapping[str, str]] = {
    "report.html": "verdicts, answers with pictures, speech, steps, map; begin here",
    RECORDING: "the whole run in 3D",
    "map.png": "the world from above, with the path",
    "tree.svg": "executed nodes, with the cause of each failure",
    "pictures": "the pictures that the mission asked for, and `pictures.json` with their poses and times",
    "what_is_this": "views of an object that nothing recognised, for `errand object import`",
    "answer.png": "what the robot saw for its last answer",
    "detection.png": "the first detection",
    "grasp.png": "the grasp",
    "place.png": "putting it down",
    "hand_over.png": "the hand-over",
    "log.mcap": "the event log, for `errand log`, `errand replay` and Foxglove",
    "run.json": "what was asked, when, and the report's values, for scripts and `errand runs`",
}
"""Files of a run, with their content, in the order in which to look at them."""
_OWN: Final = re.compile(r"-\d+(?=\.mcap$)|_[^_]+(?=\.(svg|png)$)|_\d+$")
"""Number of a restart in the name of its log, of an object, or name of a robot in the name of its picture."""
REFRESH_S = 0.2
BAR_CELLS = 20
FEWEST_ROWS = 5
BAR_ROWS: Final = 1
"""Rows that a queue's progress bar takes above the tree."""
_UNDER_WAY = (Styles.IDLE.value, Styles.RUNNING.value)
PROMPT_STYLE: Final = "bold yellow"
HELP_STYLE: Final = "dim"


@contextmanager
def live_view(
    console: Console, control: Control | None = None, *, say: Callable[[str], str] | None = None
) -> Iterator[RunVisitor]:
    """Shows the tree while the mission runs, and prints a line for each ended skill.

    With a control and a terminal, keys control the run, and `say` answers typed sentences.
    """
    hands = control or Control(pace=None)
    keys = Keys(hands, say)
    with read_keys(keys.press) if control is not None else nullcontext(False) as heard:
        lines = _Lines(console)
        if not console.is_terminal:
            yield lines
            return
        with Live(console=console, auto_refresh=False, transient=True, vertical_overflow="crop") as live:
            yield _Picture(lines, live, lambda now_s: prompt_lines(hands.state, now_s, keys.typing) if heard else [])


class _Lines(RunVisitor):
    """Visitor that prints a line for each ended skill."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._titles: dict[str, dict[str, str]] = {}
        self._last: dict[str, NodeState] = {}
        self._begun_s: dict[str, float] = {}

    def tick(self, progress: Progress) -> None:
        """Prints the skills that have ended since the last tick."""
        for robot, tree in progress.trees.items():
            if tree.root.path_id not in self._titles:
                self._titles[tree.root.path_id] = _shown_skills(node_view(tree.root))
            for path_id, title in self._titles[tree.root.path_id].items():
                self._tell(tree, path_id, title, progress.states[robot], progress.now_s)

    def _tell(self, tree: CompiledTree, path_id: str, title: str, states: Snapshot, now_s: float) -> None:
        before, state = self._last.get(path_id, NodeState()), states[path_id]
        if state is before:
            return
        self._last[path_id] = state
        if before.status is not Status.RUNNING:
            self._begun_s[path_id] = now_s
        if style_of(state) not in _UNDER_WAY and before != state:
            if state.status is Status.FAILURE:
                nodes = (node for _, node in node_view(tree.root, states).walk())
                state = next(node.state for node in nodes if node.path_id == path_id)
            self._console.print(skill_line(title, state, now_s - self._begun_s[path_id]))


class _Picture(RunVisitor):
    """Live tree, redrawn a few times a second, with `lines` above and `prompt(now_s)` below."""

    def __init__(self, lines: _Lines, live: Live, prompt: Callable[[float], Sequence[str]]) -> None:
        self._lines, self._live, self._prompt, self._drawn_s = lines, live, prompt, 0.0

    def tick(self, progress: Progress) -> None:
        """Prints lines, and redraws the tree if enough time has passed."""
        self._lines.tick(progress)
        now = time.perf_counter()
        if now - self._drawn_s < REFRESH_S:
            return
        self._drawn_s = now
        trees = [(tree, progress.states[name]) for name, tree in progress.trees.items()]
        pictures = [to_rich(node_view(tree.root, states)) for tree, states in trees]
        own_states = ([states[path_id] for path_id in tree.path_ids] for tree, states in trees)
        lines = [progress_line(own, progress.now_s) for own in own_states]
        prompt = [
            Text(line, style=HELP_STYLE if line.startswith(HELP) else PROMPT_STYLE, overflow="fold")
            for line in self._prompt(progress.now_s)
        ]
        below = BAR_ROWS + sum(len(text.split("\n")) for text in (*lines, *prompt))
        rows = max(FEWEST_ROWS, (self._live.console.height - below) // max(1, len(pictures)))
        shown = [visible_rows(picture, rows) for picture in pictures]
        self._live.update(Group(*shown, *lines, *prompt), refresh=True)


def visible_rows(picture: Text, rows: int) -> Text:
    """Returns at most `rows` lines of a tree, with a running node among them."""
    lines = picture.split("\n")
    if len(lines) <= rows:
        return picture
    running = [number for number, line in enumerate(lines) if Styles.RUNNING.value.symbol in line.plain]
    middle = running[-1] if running else 0
    first = max(0, min(middle - 2 * rows // 3, len(lines) - rows))
    return Text("\n", no_wrap=True, overflow="ellipsis").join(lines[first : first + rows])


def _shown_skills(node: NodeView, above: NodeView | None = None) -> dict[str, str]:
    """Returns the titles of the skills below a node, by path id."""
    if node.behaviour.logged:
        return {node.path_id: node.title(above)}
    return {path_id: title for child in node.children for path_id, title in _shown_skills(child, node).items()}


def skill_line(title: str, state: NodeState, took_s: float) -> Text:
    """Returns the line for an ended skill: mark, duration, title, cause and message."""
    style, what = style_of(state), printable(": ".join(filter(None, (title, state.cause_text, state.message))))
    return Text.assemble((style.symbol, style.rich), f" {took_s:6.1f} s  {what}")


def progress_line(states: Iterable[NodeState], now_s: float) -> Text:
    """Returns the line for the running skill: time, progress if the skill reports it, and message."""
    running = [state for state in states if state.status is Status.RUNNING]
    state = running[-1] if running else NodeState()
    done = round((state.progress or 0.0) * BAR_CELLS)
    bar = f" [{'█' * done}{'·' * (BAR_CELLS - done)}]" if state.progress is not None else ""
    return Text(f"\n{now_s:7.1f} s{bar} {state.message}", style="bold", no_wrap=True, overflow="ellipsis")
