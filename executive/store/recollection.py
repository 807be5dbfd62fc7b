"""State of an interrupted run, and the results from it that a resumed run still uses."""

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
    """Last state of a node: status since `clock_s` (robot's clock), cause, and the checkpoint of a running skill."""

    status: Status
    cause: Cause | None
    message: str
    clock_s: float
    checkpoint: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ended(self) -> bool:
        """Returns whether the node had ended."""
        return self.status in (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class Memory:
    """Stored state of a robot's interrupted mission: nodes by path id, blackboard, last pose."""

    steps: Mapping[str, StepRecord]
    board: Mapping[str, Any]
    pose: Pose2D | None


class Recollection:
    """Results that skills had before the restart, each of which is used once.

    A skill with a stored result returns it instead of working. Once a skill works, the results of later skills in the
    tree are dropped, because the new run may differ from there on.
    """

    def __init__(self, order: Sequence[str], steps: Mapping[str, StepRecord]) -> None:
        """`order` has the path ids of all nodes, parents first; `steps` has the stored states."""
        self._place = {path_id: number for number, path_id in enumerate(order)}
        self._ended = {path: step for path, step in steps.items() if step.ended and path in self._place}
        self._checkpoints = {path: step.checkpoint for path, step in steps.items() if step.checkpoint}
        self._interrupted = {path for path, step in steps.items() if step.status is Status.RUNNING}
        self._last: str | None = None
        self._begun_s: float | None = None
        self._world_untouched = True
        self.dropped, self.repeated = set[str](), set[str]()
        self.log: list[str] = []

    def restrict(self, path_ids: Sequence[str]) -> Recollection:
        """Drops the results of all nodes but these; returns the recollection itself."""
        self._ended = {path: step for path, step in self._ended.items() if path in path_ids}
        successes = [path for path, step in self._ended.items() if step.status is Status.SUCCESS]
        self._last = max(successes, key=lambda path: (self._ended[path].clock_s, self._place[path]), default=None)
        return self

    def result(self, path_id: str) -> StepRecord | None:
        """Returns the unused result of a node from before the restart, which must not be overwritten, or None."""
        return self._ended.get(path_id)

    def is_last(self, path_id: str) -> bool:
        """Returns whether a node was the last to succeed before the restart; the effect of its work may be lost."""
        return path_id == self._last

    def note_use(self, path_id: str, sentence: str) -> None:
        """Records that a result was returned instead of working."""
        self._ended.pop(path_id, None)
        self.repeated.add(path_id)
        self.log.append(f"{path_id}: {sentence}")

    def checkpoint(self, path_id: str) -> Mapping[str, Any]:
        """Returns the checkpoint of an attempt that the restart interrupted; empty for another node."""
        return self._checkpoints.get(path_id, {})

    def note_work(self, path_id: str, sentence: str = "") -> None:
        """Records that a skill works instead of repeating a result (`sentence`: why); drops results of later skills."""
        later = {path for path in self._ended if self._place[path] > self._place[path_id]}
        for path in {path_id, *later}:
            self._ended.pop(path, None)
        self.repeated.discard(path_id)
        self.dropped |= later
        sentence = sentence or ("goes on here" if path_id in self._interrupted else "")
        if self._world_untouched and sentence:
            self.log.append(f"{path_id}: {sentence}")
        self._interrupted.discard(path_id)
        self._checkpoints.pop(path_id, None)

    def must_check_first(self, changes_world: bool) -> bool:
        """Returns whether a skill must check at its start for work done before the restart.

        It must until a skill that changes the world has begun, because the journal may lack the last actions.
        """
        looks, self._world_untouched = self._world_untouched, self._world_untouched and not changes_world
        return looks

    def is_awake(self, now_s: float, localised: bool) -> bool:
        """Returns whether the sensors can be trusted: the robot is localised, and 0.5 s have passed since the restart.

        After PATIENCE_S the localisation is not waited for any longer.
        """
        self._begun_s = now_s if self._begun_s is None else self._begun_s
        since_s = now_s - self._begun_s
        return since_s >= PATIENCE_S or (localised and since_s >= AWAKE_AFTER_S)
