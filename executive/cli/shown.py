"""A run as people see it: the commands before, a line for each skill that ended, the verdicts after."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

from rich.console import Console
from rich.text import Text

from executive.app.durable import STORE
from executive.app.mission_run import Finished
from executive.app.page_view import PageView
from executive.app.prepared import Prepared
from executive.app.talk import Talk, load_ahead
from executive.cli.live import live_view
from executive.language.parser import load_parser
from executive.record.profile import Profile
from executive.record.schemas import SPEECH
from executive.run.control import Control
from executive.run.visitor import RunVisitor
from executive.speech.voice import Silence, Voice, queued_voice
from executive.view.text import printable, to_rich

SILENCE: Final = Silence()


class Start(Protocol):
    """Runs a mission to its end."""

    def __call__(self, *, control: Control, visitors: Sequence[RunVisitor] = ()) -> Finished:
        """Run it."""


@contextmanager
def voice_for(aloud: bool) -> Iterator[Voice]:
    """The voice of a run, which has said all in the end; silence unless `aloud`. Raises InputError: there is none."""
    if not aloud:
        yield SILENCE
        return
    voice = queued_voice()
    try:
        yield voice
    finally:
        voice.close()


@dataclass(frozen=True)
class HeardSpeech(RunVisitor):
    """Writes what a robot says on the console, unless `quiet`, and says it with a voice, which must not block."""

    console: Console
    voice: Voice
    quiet: bool

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Let speech be heard."""
        if topic == SPEECH:
            robot, text = (str(message.get(name, "")) for name in ("robot", "text"))
            if not self.quiet:
                self.console.print(Text(printable(f"{robot}: {text}"), style="bold"))
            self.voice.say(text)
        return message


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
    talk: Talk | None = None,
    voice: Voice = SILENCE,
) -> Finished:
    """Run it, shown on the console and controlled from there; `talk` is one that goes on elsewhere, too.

    What the robot says is written there, and said by the `voice`.
    With `whole_tree` all its nodes are shown in the end.
    """
    for told in dict.fromkeys(note for each in prepared.all for note in each.mission.notes):
        console.print(f"{told}.", markup=False)
    for line in (*prepared.request.scenario.lines(), *prepared.request.variation.lines()):
        console.print(f"Scenario: {line}", markup=False)
    for each in prepared.all:
        to = f"{each.mission.robot_name}: " if prepared.request.robots else ""
        for command in each.mission.commands:
            console.print(f"{to}{command}", markup=False)
    elsewhere, talk = talk is not None, talk or Talk(prepared, control)
    talk.begun()
    speech = HeardSpeech(console, voice, quiet)
    if quiet:
        if not elsewhere:
            load_parser().release()  # nobody speaks to the run
        finished = start(control=control, visitors=(speech, talk) if elsewhere else (speech,))
    else:
        with live_view(console, control, say=lambda text: talk.hear(text).text) as view:
            if control.attended and not elsewhere:
                load_ahead()
            finished = start(control=control, visitors=(speech, view, talk))
    if whole_tree:
        console.print(to_rich(finished.tree, collapsed=False))
    for line in finished.report.lines():
        console.print(line)
    return finished


class ConsoleScreen:
    """Shows runs on the console, and has them controlled from there (`executive.app.runs.Screen`).

    `page` makes the live page of a run, where one is wanted; `shown_page` is the last one. With `whole_tree` all nodes
    of a tree are shown in the end, and `profile` times the subsystems.
    """

    def __init__(
        self,
        console: Console,
        *,
        quiet: bool,
        whole_tree: bool = False,
        voice: Voice = SILENCE,
        page: Callable[[Prepared], PageView] | None = None,
        profile: Profile | None = None,
    ) -> None:
        self._console, self._quiet, self._whole_tree, self._voice = console, quiet, whole_tree, voice
        self._page, self._profile = page, profile
        self.shown_page: PageView | None = None

    def tell(self, line: str, *, title: bool = False) -> None:
        """Show a line."""
        self._console.print(line, markup=False, style="bold" if title else None)

    def control(self, prepared: Prepared) -> Control:
        """The control of a run: its page's, else the console's."""
        if self._page is None:
            return control_for(self._console, quiet=self._quiet)
        self.shown_page = self._page(prepared)
        return self.shown_page.control

    def show(self, prepared: Prepared, control: Control, start: Callable[..., Finished]) -> Finished:
        """Show a run from its beginning to its end."""
        page = self.shown_page
        return show_run(
            partial(start, page=page, profile=self._profile),
            prepared,
            self._console,
            control=control,
            quiet=self._quiet,
            whole_tree=self._whole_tree,
            talk=None if page is None else page.talk,
            voice=self._voice,
        )

    def name_files(self, out: Path) -> None:
        """Name what was left in a folder, but for what the store keeps there."""
        names = sorted(path.name for path in out.iterdir() if not path.name.startswith(Path(STORE).stem))
        self.tell(f"Written to {out}: {', '.join(names)}")
