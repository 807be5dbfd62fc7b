"""State that a run's control shows, and the requests that it makes to the runner."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.tree.compiler import CompiledTree
from skills.api import Question


class Mode(enum.Enum):
    """State of a run; when several reasons stop the robots, the strongest reason determines the state."""

    READY = "ready"  # it has not begun
    RUNNING = "running"  # trees are ticked
    PAUSED = "paused"  # by the operator or at a breakpoint
    STEPPING = "stepping"  # paused, until the step under way is complete
    LEASE_LOST = "lease lost"  # another program moves the robot
    STOPPED = "stopped"  # the stop button is pressed
    ENDED = "ended"  # it is over


@dataclass(frozen=True)
class RobotMode:
    """State of one robot of a run, and the reason why it does not move."""

    mode: Mode
    reason: str = ""


@dataclass(frozen=True)
class OpenQuestion:
    """Question of a robot, open until `until_s` of the robot's clock."""

    question: Question
    until_s: float
    robot: str = ""

    @property
    def id(self) -> str:
        """Id of the question."""
        return self.question.id

    @property
    def options(self) -> tuple[str, ...]:
        """Answers to choose from; empty when any text is an answer."""
        return self.question.options


@dataclass
class PendingRemark:
    """Remark that a robot's skill waits for (`skills.api.Listen`); `waits` is False once the skill stops waiting."""

    robot: str
    waits: bool = True
    text: str | None = None

    def done(self) -> bool:
        """Returns whether a person has made the remark."""
        return self.text is not None

    def result(self) -> str:
        """Returns what the person said. Raises RuntimeError when nobody has spoken yet."""
        if self.text is None:
            raise RuntimeError("nobody has spoken yet")
        return self.text

    def withdraw(self) -> None:
        """Stops waiting for the remark."""
        self.waits = False


@dataclass(frozen=True)
class ControlState:
    """State of a run at one moment, as the control shows it.

    `version` grows with every change. `mode` is the mode of the whole run, `robots` has the mode of each robot.
    `missions` lists the missions that each robot has begun and not ended, the present mission last. `at` is the path id
    of the breakpoint at which the run waits; `buttons` are the buttons that missions wait for or use in conditions.
    """

    version: int = 0
    mode: Mode = Mode.READY
    reason: str = ""
    at: str | None = None
    questions: tuple[OpenQuestion, ...] = ()
    breakpoints: frozenset[str] = frozenset()
    missions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    buttons: tuple[str, ...] = ()
    robots: Mapping[str, RobotMode] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """Event of the control, for the log."""

    what: str
    message: str


class Turn(enum.Enum):
    """Order in which a robot executes a requested mission and its present mission."""

    FIRST = "first"  # the present mission is suspended, and continues afterwards
    INSTEAD = "instead"  # the present mission, or one that waits, is given up
    LATER = "later"  # after the mission that the robot began with


@dataclass(frozen=True)
class MissionRequest:
    """Request for another mission; INSTEAD replaces the mission `instead_of` (None: the present mission)."""

    tree: CompiledTree
    turn: Turn
    instead_of: str | None = None


@dataclass(frozen=True)
class ControlRequests:
    """Requests to the run at one moment.

    `insists` is set when a run was cancelled twice, and must end at once. `hold` is the reason why all robots stand
    still, `holds` has the reasons for single robots. `cancels` has pairs of a robot whose mission must end and the
    reason.
    """

    cancel: str | None = None
    insists: bool = False
    hold: str | None = None
    breakpoints: frozenset[str] = frozenset()
    events: tuple[Event, ...] = ()
    missions: tuple[MissionRequest, ...] = ()
    holds: Mapping[str, str] = field(default_factory=dict)
    cancels: tuple[tuple[str, str], ...] = ()

    @property
    def of_robots(self) -> bool:
        """Returns whether single robots have requests, or any robot must stand still."""
        return bool(self.missions or self.cancels or self.holds) or self.hold is not None

    def holds_robot(self, robot_name: str) -> bool:
        """Returns whether this robot must stand still, by a request for it alone or for all robots."""
        return self.hold is not None or robot_name in self.holds
