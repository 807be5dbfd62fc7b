"""A run as people see it: the commands before, a line for each skill that ended, the verdicts after."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Protocol

from rich.console import Console

from executive.cli.durable import STORE
from executive.cli.live import live_view
from executive.cli.mission_run import Finished, both
from executive.cli.requests import Prepared
from executive.cli.talk import conversation_of, load_ahead
from executive.conversation import Conversation
from executive.language import load_parser
from executive.run.control import Control
from executive.run.runner import Observer
from executive.view.text import to_rich


class Start(Protocol):
    """Runs a mission to its end."""

    def __call__(self, *, control: Control, observer: Observer | None = None) -> Finished:
        """Run it."""


def control_for(console: Console, *, quiet: bool) -> Control:
    """The control of a run without a page: attended where somebody sits at a terminal."""
    attended = console.is_terminal and sys.stdin.isatty() and not quiet
    return Control(attended=attended, pace=1.0 if attended else None)


def show_run(
    start: Start,
    prepared: Prepared,
    console: Console,
    *,
    control: Control,
    quiet: bool,
    whole_tree: bool = False,
    conversation: Conversation | None = None,
) -> Finished:
    """Run it, shown on the console and controlled from there; `conversation` is one that goes on elsewhere, too.

    With `whole_tree` all its nodes are shown in the end.
    """
    for told in prepared.mission.notes:
        console.print(f"{told}.", markup=False)
    for line in prepared.request.scenario.lines():
        console.print(f"Scenario: {line}", markup=False)
    for command in prepared.mission.commands:
        console.print(str(command), markup=False)
    talk = conversation or conversation_of(prepared, control)
    talk.begun(prepared.tree, memory=None if prepared.meant is None else prepared.meant.memory)
    if quiet:
        if conversation is None:
            load_parser().release()  # nobody speaks to the run
        finished = start(control=control, observer=None if conversation is None else talk.observe)
    else:
        with live_view(console, control, say=lambda text: talk.hear(text).text) as observer:
            if control.attended and conversation is None:
                load_ahead()
            finished = start(control=control, observer=both(observer, talk.observe))
    if whole_tree:
        console.print(to_rich(finished.tree, collapsed=False))
    for line in finished.report.lines():
        console.print(line)
    return finished


def show_files(out: Path, console: Console) -> None:
    """Name what was left in a folder, but for what the store keeps there."""
    names = sorted(path.name for path in out.iterdir() if not path.name.startswith(Path(STORE).stem))
    console.print(f"Written to {out}: {', '.join(names)}", markup=False)
