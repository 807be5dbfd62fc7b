"""What stands behind a run, simulated or real: nothing else knows which it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from executive.app.artifacts import Artifacts
from executive.app.report import RefereeReport
from executive.record.work import Profile
from executive.run.outcome import RobotResult
from executive.run.visitor import RunEntry
from executive.store.journal import StoreJournal
from executive.tree.compiler import CompiledTree
from skills.robot import Clock, Pose2D

if TYPE_CHECKING:
    from executive.app.goal_conditions import Share


@dataclass(frozen=True)
class Durable:
    """What a run needs to be taken up later, or to take up an earlier one.

    `plant` is the name of the file in which the plant keeps its state for the mission `label`. With `take_up` it
    begins from what was kept for `take_up_label` (None: for any). `journals` are those of the robots by their names,
    `poses` where each last believed to be.
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
        """What could not be kept."""
        return tuple(dict.fromkeys(trouble for each in self.journals.values() for trouble in each.troubles))


class Scene(Protocol):
    """A live picture of the world, for the page."""

    @property
    def url(self) -> str:
        """Where it is served."""

    def go_easy(self) -> None:
        """Refresh it less often."""

    def follow(self, wanted: bool) -> None:
        """Lets the camera go along with the robot, or shows the whole world."""


class Backend(Protocol):
    """A robot and its clock, and what there is besides: a referee, a recording, a live picture."""

    @property
    def clock(self) -> Clock:
        """The robot's clock."""

    def entry(self, tree: CompiledTree, durable: Durable | None) -> RunEntry:
        """The robot of a tree's name with its estimators, its state kept or taken up where `durable` says so.

        Raises:
            InputError: there is no such robot, or something that it needs cannot be read.
        """

    def happened(self) -> Sequence[tuple[float, str]]:
        """What has happened in the world by the run's scenario: times (s) and sentences; none of a real one."""

    def work(self) -> Mapping[str, int]:
        """What the backend itself computed, as counters by name; empty for a real robot."""

    def attach(self, profile: Profile) -> None:
        """Time the backend's own subsystems."""

    def show_live(self) -> Scene | None:
        """Begins to show the world, where that can be done."""

    def judge(
        self, tree: CompiledTree, result: RobotResult, *, before: Sequence[Share] = (), since_s: float = 0.0
    ) -> RefereeReport | None:
        """What a referee saw of a mission since it began, of which others did some `before`; None: there is none."""

    def leave(self, artifacts: Artifacts, out: Path) -> Path | None:
        """Writes what was recorded into a folder; the recording's path, None where there is none."""
