"""A user's request and how it is run: one form, from the command line to the store and back."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, TypeAdapter
from pydantic.dataclasses import dataclass

from executive.mission.scenario import NO_SCENARIO, Scenario
from executive.words.mission import QuestionPolicy
from executive.words.option import Option
from executive.words.robot_config import RobotConfig, parse_robots, pose_in
from executive.words.variation import NO_VARIATION, Variation
from skills.files.errors import InputError
from skills.files.outside import is_there
from skills.files.plugins import installed_plugins
from skills.quantities import LongDuration, QuantityError, Seed, clock_text
from skills.robot import Pose2D

Start = Pose2D | Literal["unknown"]
"""Where the robot really stands: a pose (world frame), or a free one that the seed chooses and that nobody tells it."""


def start_in(text: str) -> Start:
    """The start in a text such as "1.5 2 0" (m, m, rad) or "unknown". Raises InputError."""
    if text == "unknown":
        return "unknown"
    try:
        return pose_in(text.split())
    except QuantityError as error:
        raise InputError(f"--start {text[:60]}: {error.what}", hint=error.hint) from None


def _time_of_day(text: str) -> str:
    """A time of day as "08:30". Raises InputError: it is none."""
    try:
        return clock_text(text)
    except QuantityError as error:
        raise InputError(f"--time-of-day {text}: {error.what}", hint=error.hint) from error


def _given(settings: list[str]) -> Mapping[str, Any]:
    """The values of parameters in texts such as "speed=0.5". Raises InputError."""
    from executive.mission.parameters import given_values

    return given_values(settings)


def _stack_file(path: Path) -> Path:
    from executive.mission.stack_file import stack_file

    return stack_file(path)


def _robots(text: str) -> tuple[RobotConfig, ...]:
    """The robots in a text such as "alice=spot,bob=fetch". Raises InputError."""
    return parse_robots(text, [kind.name for kind in installed_plugins("errand.robots")])


@dataclass(frozen=True, config=ConfigDict(extra="forbid", defer_build=True))
class Request:
    """A sentence, or a mission file, or neither where a conversation left only commands.

    A field with an `Option` is typed at the command line: commands take their options from here. `world` is as it was
    said, if it was; `require_wake` tells whether the robot's name must be said (None: the world decides); `answers` are
    to the questions that it leaves open, in their order, and `questions` says what becomes of further ones. `given` are
    values for a file's parameters; the robot stands at `start`, where the world's own is not meant. `out` is the folder
    for the run's files, `stack` the file that says what the robot uses, `map` the folder of the map that it has in
    place of the world's own. `scenario` is what goes wrong and happens meanwhile, and `scenario_files` hold more of it;
    `variation` is how the world differs from what its files say.

    `robots` are those of a run with several, or with one of another kind or start than the world's.

    The run begins at `time_of_day` ("14:30"; None: what it is) and is ended after `time_limit_s` (None: as usual).

    The fields below `robots` are filled once the request is understood. Then another process can run it: a sentence
    has the answers in their places, `text` is that of the file, and `scenario` holds all that its files say and the
    seed draws.
    """

    sentence: Annotated[str | None, Option('What is said, as in "Hey Alice, fetch me a drink".', "--say")] = None
    file: Annotated[
        Path | None, Option("A file, or a name of `errand missions`.", metavar="MISSION", argument=True)
    ] = None
    world: Annotated[str | None, Option("World by name or folder; flat unless said.")] = None
    require_wake: Annotated[
        bool | None,
        Option(
            "Whether the robot's name must be said; by default if spoken, or where the world asks for it.",
            "--wake/--no-wake",
        ),
    ] = None
    answers: Annotated[
        tuple[str, ...],
        Option(
            "Answers a question that the sentence leaves open; repeat it for further ones, in their order.", "--answer"
        ),
    ] = ()
    questions: Annotated[
        QuestionPolicy | None,
        Option("How to answer further questions; by default as the mission file says, else at the terminal, else not."),
    ] = None
    seed: Annotated[Seed, Option("Sets the objects in the world and all noise.")] = 1
    out: Annotated[Path, Option("Folder for log, tree, recording and pictures.")] = Path("out")
    record: Annotated[
        bool, Option("Leaves no recording and no pictures.", "--no-record", read=operator.not_, typed=bool)
    ] = True
    stack: Annotated[
        Path | None,
        Option(
            "A stack file: localiser, planners and so on; see errand stack show. 'no_map': for unknown places.",
            read=_stack_file,
            typed=Path,
        ),
    ] = None
    map: Annotated[
        Path | None, Option("The robot's map, a folder of `errand map build`; by default the world's own.")
    ] = None
    start: Annotated[
        Start | None,
        Option(
            "Where the robot stands (m, rad); 'unknown' puts it anywhere, and it finds out where.",
            metavar="X Y YAW",
            read=start_in,
        ),
    ] = None
    scenario: Scenario = NO_SCENARIO
    scenario_files: Annotated[
        tuple[Path, ...],
        Option(
            "Adds the faults and events of a file: people walk, doors close, objects are moved.",
            "--scenario",
            metavar="FILE",
        ),
    ] = ()
    variation: Variation = NO_VARIATION
    given: Annotated[
        Mapping[str, Any],
        Option(
            "A value for a parameter of the mission file.", "--set", metavar="NAME=VALUE", read=_given, typed=list[str]
        ),
    ] = field(default_factory=dict)
    time_of_day: Annotated[
        str | None,
        Option(
            "Time of day when the run begins; by default the time on this machine.", metavar="HH:MM", read=_time_of_day
        ),
    ] = None
    time_limit_s: Annotated[
        LongDuration | None, Option('Ends the run after so long: seconds, or "2 h"; by default 20 min.', "--time-limit")
    ] = None
    robots: Annotated[
        tuple[RobotConfig, ...],
        Option(
            "The robots and their kinds, as in alice=spot,bob=fetch@1.0,2.0,0.0.",
            metavar="NAME=KIND,...",
            read=_robots,
        ),
    ] = ()
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
        world = self.world if self.world is None or not is_there(Path(self.world)) else str(Path(self.world).resolve())
        return replace(
            self,
            file=_whole(self.file),
            world=world,
            out=self.out.resolve(),
            stack=_whole(self.stack),
            map=_whole(self.map),
            robots=tuple(replace(robot, stack=_whole(robot.stack)) for robot in self.robots),
            scenario_files=tuple(path.resolve() for path in self.scenario_files),
        )


def _whole(path: Path | None) -> Path | None:
    return None if path is None else path.resolve()


@cache
def _form() -> TypeAdapter[Request]:
    return TypeAdapter(Request)
