"""Logs the faults that begin and end in a run, and what happens in the world whatever the robot does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from executive.record.schemas import CONTROL
from executive.run.visitor import Progress, RunVisitor
from skills.api import Publish
from skills.faults.faulty_robot import FaultyRobot
from skills.robot import Robot

__all__ = ["HappeningLog"]

Happened = Callable[[], Sequence[tuple[float, str]]]
FAULT: Final = "fault"
EVENT: Final = "event"


class HappeningLog(RunVisitor):
    """Logs after each tick what is new."""

    def __init__(self, publish: Publish, robot: Robot, happened: Happened) -> None:
        """`happened` gives all that has happened in the world so far: times (s) and sentences."""
        self._publish, self._happened = publish, happened
        self._robot = robot if isinstance(robot, FaultyRobot) else None
        self._at_work: tuple[str, ...] = ()
        self._told = len(happened())

    def tick(self, progress: Progress) -> None:
        """Log what has begun, ended or happened since the last tick."""
        for now_s, sentence in self._happened()[self._told :]:
            self._log(now_s, EVENT, sentence)
        self._told = len(self._happened())
        now = () if self._robot is None else self._robot.faults_at_work()
        for words in now:
            if words not in self._at_work:
                self._log(progress.now_s, FAULT, f"{words}: begins")
        for words in self._at_work:
            if words not in now:
                self._log(progress.now_s, FAULT, f"{words}: is over")
        self._at_work = now

    def _log(self, now_s: float, what: str, message: str) -> None:
        self._publish(CONTROL, {"t": round(now_s, 6), "what": what, "message": message})
