"""What a run reports about itself, so that another process can go on from there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from executive.tree.compiler import CompiledTree
from executive.tree.snapshot import Change
from skills.robot import Pose2D


@dataclass(frozen=True)
class TickNote:
    """One tick: what changed in the tree, all values on the blackboard, where the robot believes to be.

    `pose` is X_WB, given with changes and once a second while the robot is localised, else None; `checkpoints` are
    those of the running skills by path id. `charge` is the battery's (0 to 1), given as often as the pose.
    """

    now_s: float
    changes: Sequence[Change]
    board: Mapping[str, Any]
    pose: Pose2D | None
    checkpoints: Mapping[str, Mapping[str, Any]]
    charge: float | None = None


class Journal(Protocol):
    """Keeps notes of one robot's mission. It hears of every tick, but not of the halt at the end of the run."""

    def note(self, note: TickNote) -> None:
        """Keep what a tick brought."""

    def replaced(self, tree: CompiledTree) -> Journal:
        """Another mission has taken the place of this one, which is forgotten; the journal of the other."""
