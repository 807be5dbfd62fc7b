"""Interface of a backend: a simulated or real robot behind a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from executive.app.report.artifacts import Artifacts
from executive.record.work import Profile
from executive.run.control import Control
from executive.run.outcome import RobotResult
from executive.run.visitor import RunEntry, RunVisitor
from executive.store.journal import StoreJournal
from executive.tree.compiler import CompiledTree
from executive.words.goal import RefereeReport
from skills.api import Publish
from skills.inputs.errors import InputError
from skills.inputs.plugins import PluginDefect, installed_plugins, run_plugin
from skills.robot import Clock, Pose2D

if TYPE_CHECKING:
    from executive.app.prepare.prepared import Prepared
    from executive.app.runs.goal_conditions import Share
    from executive.view.server import Scene

OBSERVERS: Final = "errand.observers"  # of `--observe NAME[=VALUE]`: functions from VALUE to an `Observe`
Observe = Callable[["Prepared", Control], RunVisitor]
"""Function that returns the visitor for one run, which may use the run's control."""


def observer(text: str) -> Observe:
    """Loads an observer by NAME[=VALUE]. Raises InputError unless one plug-in registers it and takes the value."""
    name, _, value = text.partition("=")
    try:
        (entry,) = (each for each in installed_plugins(OBSERVERS) if each.name == name)
        made: Callable[[str], Observe] = run_plugin(entry, entry.load)
    except (ValueError, PluginDefect) as error:
        raise InputError(f"cannot observe by '{name[:60]}'", hint="errand plugins says why") from error
    return made(value)


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

    def attach(self, profile: Profile) -> None:
        """Lets the profile time the backend's subsystems."""
        return None

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

    def leave(self, artifacts: Artifacts, out: Path) -> Path | None:
        """Writes recording and pictures into the folder `out`; returns the recording's path, None if there is none."""
        return None
