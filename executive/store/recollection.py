"""The memory of an interrupted run, and how a resumed run uses it up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from py_trees.common import Status

from skills.api import Cause
from skills.robot import Pose2D

AWAKE_AFTER_S = 0.5
PATIENCE_S = 10.0


@dataclass(frozen=True)
class StepRecord:
    """The last state of a node: its status, when that began (s), and the checkpoint of a skill under way."""

    status: Status
    cause: Cause | None
    message: str
    clock_s: float
    checkpoint: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ended(self) -> bool:
        """True when the node came to an end."""
        return self.status in (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class Memory:
    """The state of a robot's interrupted mission: its nodes by path id, its blackboard, its last pose."""

    steps: Mapping[str, StepRecord]
    board: Mapping[str, Any]
    pose: Pose2D | None


class Recollection:
    """The results of skills before the restart, each to be used once.

    A skill with a result gives it in place of doing its work again. Once a skill does work of its own, results of
    skills that stand after it in the tree count no more: they belong to a past that has been left.
    """

    def __init__(self, order: Sequence[str], steps: Mapping[str, StepRecord]) -> None:
        """`order` are the path ids of all nodes, parents first; `steps` what was kept."""
        self._place = {path_id: number for number, path_id in enumerate(order)}
        self._ended = {path: step for path, step in steps.items() if step.ended and path in self._place}
        self._checkpoints = {path: step.checkpoint for path, step in steps.items() if step.checkpoint}
        self._last: str | None = None
        self._begun_s: float | None = None
        self._world_untouched = True
        self.dropped: set[str] = set()
        self.told: list[str] = []

    def only(self, path_ids: Sequence[str]) -> Recollection:
        """The same, of these nodes only."""
        self._ended = {path: step for path, step in self._ended.items() if path in path_ids}
        successes = [path for path, step in self._ended.items() if step.status is Status.SUCCESS]
        self._last = max(successes, key=lambda path: (self._ended[path].clock_s, self._place[path]), default=None)
        return self

    def pending(self, path_id: str) -> bool:
        """Returns whether a result is still to be used: until then it must not be overwritten."""
        return path_id in self._ended

    def result(self, path_id: str) -> StepRecord | None:
        """The result from before the restart, if there is one that counts still."""
        return self._ended.get(path_id)

    def is_last(self, path_id: str) -> bool:
        """Returns whether this was the last success before the restart; what it brought about may not hold any more."""
        return path_id == self._last

    def used(self, path_id: str, sentence: str) -> None:
        """A result was given in place of work."""
        self._ended.pop(path_id, None)
        self.told.append(f"{path_id}: {sentence}")

    def checkpoint(self, path_id: str) -> Mapping[str, Any]:
        """The checkpoint of the attempt that the restart broke off, empty for another."""
        return self._checkpoints.get(path_id, {})

    def goes_on(self, path_id: str, sentence: str) -> None:
        """A skill does work of its own."""
        later = {path for path in self._ended if self._place[path] > self._place[path_id]}
        for path in {path_id, *later}:
            self._ended.pop(path, None)
        self.dropped |= later
        if self._world_untouched:
            self.told.append(f"{path_id}: {sentence}")
        self._checkpoints.pop(path_id, None)

    def looks_first(self, changes_world: bool) -> bool:
        """Returns whether a skill that begins must first look what is done already.

        So it is until one has begun that changes the world: what was kept may lag behind what was done.
        """
        looks, self._world_untouched = self._world_untouched, self._world_untouched and not changes_world
        return looks

    def awake(self, now_s: float, localised: bool) -> bool:
        """Whether the robot's senses can be trusted: it is localised and a moment has passed since the restart."""
        self._begun_s = now_s if self._begun_s is None else self._begun_s
        since_s = now_s - self._begun_s
        return since_s >= PATIENCE_S or (localised and since_s >= AWAKE_AFTER_S)
