"""What the store knows of a mission that was broken off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.common import Status

from skills.api import Cause
from skills.robot import Pose2D


@dataclass(frozen=True)
class StepRecord:
    """What a node last said: its status, when that began, and for a skill under way its checkpoint."""

    status: Status
    cause: Cause | None
    message: str
    clock_s: float
    checkpoint: Mapping[str, Any]

    @property
    def ended(self) -> bool:
        """True when the node came to an end."""
        return self.status in (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class Memory:
    """All that is known of a mission that was broken off: its nodes by path id, its blackboard, the last pose."""

    steps: Mapping[str, StepRecord]
    board: Mapping[str, Any]
    pose: Pose2D | None


@dataclass(frozen=True)
class Order:
    """What was asked for, complete enough to compile the same tree again.

    Either `sentence`, or `file` with its `text`, or neither, where only the commands are known;
    `world` as it was said, if it was. `out` is the folder for logs;
    `fingerprint` that of the tree.
    """

    name: str
    world_name: str
    robot: str
    seed: int
    out: str
    commands: tuple[str, ...]
    fingerprint: str
    sentence: str | None = None
    file: str | None = None
    text: str | None = None
    world: str | None = None
    require_wake: bool = False
    record: bool = True
