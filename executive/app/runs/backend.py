"""Interface of a backend: a simulated or real robot behind a run."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from executive.app.report.artifacts import Artifacts
from executive.run.control import Control
from executive.run.outcome import RobotResult
from executive.run.visitor import RunEntry, RunVisitor
from executive.store.journal import StoreJournal
from executive.tree.compiler import CompiledTree
from executive.words.goal import RefereeReport
from skills.api import Publish
from skills.inputs.errors import InputError, suggestion
from skills.inputs.plugins import OBSERVERS, PluginDefect, installed_plugins, run_plugin
from skills.robot import Clock, Pose2D

if TYPE_CHECKING:
    from executive.app.prepare.prepared import Prepared
    from executive.app.report.run_report import Verdict
    from executive.app.runs.goal_conditions import Share
    from executive.record.event_log import EventLog
    from executive.view.foxglove import LiveServer  # imports asyncio
    from executive.view.server import Scene

_LOG: Final = logging.getLogger(__name__)
Observe = Callable[["Prepared", Control], RunVisitor]
"""Function that returns the visitor for one run, which may use the run's control."""


def observer(text: str) -> Observe:
    """Loads an observer by NAME[=VALUE]. Raises InputError unless one distribution registers it and takes the value."""
    name, _, value = text.partition("=")
    installed = installed_plugins(OBSERVERS)
    if name not in installed.names:
        raise InputError(f"there is no observer '{name[:60]}'", hint=suggestion(name, installed.names))
    try:
        (entry,) = installed.select(name=name)
        made: Callable[[str], Observe] = run_plugin(entry, entry.load)
    except (ValueError, PluginDefect) as error:
        raise InputError(f"cannot observe by '{name[:60]}'", hint="errand plugins says why") from error
    return made(value)


@dataclass(frozen=True)
class OpenRun:
    """Run before its beginning: its open log and its backend."""

    log: EventLog
    backend: Backend


class Display(RunVisitor):
    """Visitor that also sees the run before its beginning and after its report. By default each method does nothing."""

    def opened(self, run: OpenRun) -> None:
        """Handles the open log, before its first message. Raises InputError if the run cannot be displayed."""

    def reported(self, recording: Path | None, report: Path, verdicts: Sequence[Verdict]) -> None:
        """Handles the recording, the written report, and the verdicts on the ended run."""


@dataclass
class LiveLog(Display):
    """Sends the messages of each run's log to a server."""

    server: LiveServer

    def opened(self, run: OpenRun) -> None:
        """Sends the log's messages from now on."""
        self.server.follow(run.log)


class FoxgloveObserver(AbstractContextManager["FoxgloveObserver"]):
    """Observer that serves what runs log, live for Foxglove."""

    def __init__(self, address: str) -> None:
        """Serves at HOST:PORT, by default at the usual one, and names the address. Raises InputError."""
        from executive.view.foxglove import USUAL_ADDRESS, LiveServer

        self._server = LiveServer(address or USUAL_ADDRESS)
        _LOG.warning("Foxglove: %s", self._server.url)

    def __call__(self, prepared: Prepared, control: Control) -> RunVisitor:
        """Returns the visitor for a run."""
        return LiveLog(self._server)

    def __exit__(self, *error: object) -> None:
        self._server.close()


@contextmanager
def observers(texts: Sequence[str] | None) -> Iterator[Sequence[Observe]]:
    """Loads observers by NAME[=VALUE], and closes them after the block. Raises InputError like `observer`."""
    with ExitStack() as stack:
        made = list[Observe]()
        for text in texts or ():
            made.append(observer(text))
            if isinstance(made[-1], AbstractContextManager):
                stack.enter_context(made[-1])
        yield made


@dataclass(frozen=True)
class Durable:
    """Stored state of a run, from which a later run can resume.

    `plant` is the file in which the plant stores its state for the mission `label`. With `take_up` the run begins from
    the state stored for `take_up_label` (None: for any mission). `journals` are the robots' journals by name, `poses`
    are the last estimated poses of the robots.
    """

    plant: Path
    journals: Mapping[str, StoreJournal]
    label: str
    take_up: bool = False
    take_up_label: str | None = None
    poses: Mapping[str, Pose2D] = field(default_factory=dict)
    log: str = "log.mcap"

    @property
    def troubles(self) -> tuple[str, ...]:
        """Messages on state that could not be stored."""
        return tuple(dict.fromkeys(trouble for each in self.journals.values() for trouble in each.troubles))


class Backend(Protocol):
    """Interface of a backend: robots and their clock. The defaults are those without referee, recording and scene."""

    @property
    def clock(self) -> Clock:
        """The robots' clock."""

    def entry(self, tree: CompiledTree, durable: Durable | None) -> RunEntry:
        """Returns the robot of a tree with its estimators; with `durable` the robot's state is stored or resumed.

        Raises:
            InputError: there is no such robot, or a file that the robot needs cannot be read.
        """

    def happened(self) -> Sequence[tuple[float, str]]:
        """Returns the scenario's events so far, as times (s) and sentences; empty for a real robot."""
        return ()

    def visitors(self, control: Control, log: Publish) -> Sequence[RunVisitor]:
        """Returns the visitors that the backend adds to a run with this control and log; empty for a real robot."""
        return ()

    @property
    def notes(self) -> Sequence[str]:
        """Sentences for the report on how the robots sense; empty in a simulation."""
        return ()

    def work(self) -> Mapping[str, int]:
        """Returns the backend's work counters by name; empty for a real robot."""
        return {}

    def show_live(self) -> Scene | None:
        """Starts the live picture; None if there is none."""
        return None

    def judge(
        self, tree: CompiledTree, result: RobotResult, *, before: Sequence[Share] = (), since_s: float = 0.0
    ) -> RefereeReport | None:
        """Returns the referee's report on a mission since `since_s`; `before` are the parts that other robots did.

        None if there is no referee.
        """
        return None

    def hurry(self) -> None:
        """Shortens what is written at the end, since the process is about to be killed."""
        return None

    def leave(self, artifacts: Artifacts, out: Path) -> Path | None:
        """Writes recording and pictures into the folder `out`; returns the recording's path, None if there is none."""
        return None
