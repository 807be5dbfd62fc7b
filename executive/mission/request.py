"""What a user asks for, and how it is to be run: the one form of it, from the command line to the store and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from pydantic import ConfigDict, TypeAdapter
from pydantic.dataclasses import dataclass

from executive.language.questions import QuestionPolicy
from executive.mission.scenario import NO_SCENARIO, Scenario
from executive.words.robots import RobotConfig, pose_in
from executive.words.variation import NO_VARIATION, Variation
from skills.files.errors import InputError
from skills.files.outside import is_there
from skills.quantities import QuantityError
from skills.robot import Pose2D

__all__ = ["Request", "Start"]

_UNKNOWN: Final = "unknown"


@dataclass(frozen=True, config=ConfigDict(defer_build=True))
class Start:
    """Where the robot really stands, in place of the world's start.

    Without a `pose`, it stands at a free pose that the seed chooses, and is not told where.
    """

    pose: Pose2D | None = None

    def __str__(self) -> str:
        return _UNKNOWN if self.pose is None else f"{self.pose.x_m!r} {self.pose.y_m!r} {self.pose.yaw_rad!r}"

    @staticmethod
    def of(text: str) -> Start:
        """What `str` wrote, or a user. Raises InputError."""
        if text == _UNKNOWN:
            return Start()
        try:
            return Start(pose_in(text.split()))
        except QuantityError as error:
            raise InputError(f"--start {text[:60]}: {error.what}", hint=error.hint) from None


@dataclass(frozen=True, config=ConfigDict(extra="forbid", defer_build=True))
class Request:
    """A sentence, or a mission file, or neither where a conversation left only commands.

    `world` is as it was said, if it was; `require_wake` tells whether the robot's name must be said (None: the world
    decides); `answers` are to the questions that it leaves open, in their order, and `questions` says what becomes of
    further ones. `given` are values for a file's parameters; the robot stands at `start`, where the world's own is not
    meant. `out` is the folder for the run's files, `stack` the file that says what the robot uses, `map` the
    folder of the map that it has in place of the world's own. `scenario` is what goes wrong and happens meanwhile, and
    `scenario_files` hold more of it; `variation` is how the world differs from what its files say.

    `robots` are those of a run with several, or with one of another kind or start than the world's.

    The run begins at `time_of_day` ("14:30"; None: what it is) and is ended after `time_limit_s` (None: as usual).

    What stands below `robots` is filled once it is understood. Then another process can take it up: a sentence
    has the answers in their places, `text` is that of the file, and `scenario` holds all that its files say and the
    seed draws.
    """

    sentence: str | None = None
    file: Path | None = None
    world: str | None = None
    require_wake: bool | None = None
    answers: tuple[str, ...] = ()
    questions: QuestionPolicy | None = None
    seed: int = 1
    out: Path = Path("out")
    record: bool = True
    stack: Path | None = None
    map: Path | None = None
    start: Start | None = None
    scenario: Scenario = NO_SCENARIO
    scenario_files: tuple[Path, ...] = ()
    variation: Variation = NO_VARIATION
    given: Mapping[str, Any] = field(default_factory=dict)
    time_of_day: str | None = None
    time_limit_s: float | None = None
    robots: tuple[RobotConfig, ...] = ()
    name: str = ""
    world_name: str = ""
    robot: str = ""
    commands: tuple[str, ...] = ()
    fingerprint: str = ""
    text: str | None = None

    @property
    def only_commands(self) -> bool:
        """True where there is neither a sentence nor a file."""
        return self.sentence is None and self.file is None and bool(self.commands)

    def to_json(self) -> str:
        """The JSON form, which `from_json` reads; what is not said is left out."""
        return _form().dump_json(self, exclude_defaults=True).decode()

    @staticmethod
    def from_json(text: str | bytes) -> Request:
        """The request that `to_json` wrote. Raises ValueError."""
        return _form().validate_json(text)

    def from_anywhere(self) -> Request:
        """The same with whole paths, for a process that works in another folder."""
        file = None if self.file is None else self.file.resolve()
        world = self.world if self.world is None or not is_there(Path(self.world)) else str(Path(self.world).resolve())
        stack = None if self.stack is None else self.stack.resolve()
        own_map = None if self.map is None else self.map.resolve()
        robots = tuple(
            robot if robot.stack is None else replace(robot, stack=robot.stack.resolve()) for robot in self.robots
        )
        return replace(self, file=file, world=world, out=self.out.resolve(), stack=stack, map=own_map, robots=robots)


@cache
def _form() -> TypeAdapter[Request]:
    return TypeAdapter(Request)
