"""Request of a user with all options for its run, in one form for the command line, the store and the queue."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypedDict

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from executive.mission.scenario import NO_SCENARIO, Scenario
from executive.words.forms import Option
from executive.words.forms import OptionGroup as Heading  # no name of a caller: its annotations are resolved late
from executive.words.mission import QuestionPolicy
from executive.words.robot_config import RobotConfig, parse_pose, parse_robots
from executive.words.variation import NO_VARIATION, Variation
from skills.inputs.errors import InputError
from skills.inputs.outside import is_there
from skills.inputs.plugins import installed_plugins
from skills.inputs.schema import first_error
from skills.quantities import LongDuration, QuantityError, Seed, clock_text
from skills.robot import Pose2D

Start = Pose2D | Literal["unknown"]
"""True pose of the robot (world frame), or "unknown": a free pose that the seed chooses and the robot does not know."""


def parse_start(text: str) -> Start:
    """Parses a start such as "1.5 2 0" (m, m, rad) or "unknown". Raises InputError for any other text."""
    if text == "unknown":
        return "unknown"
    try:
        return parse_pose(text.split())
    except QuantityError as error:
        raise InputError(f"--start {text[:60]}: {error.what}", hint=error.hint) from None


def _time_of_day(text: str) -> str:
    """Parses a time of day such as "08:30". Raises InputError for any other text."""
    try:
        return clock_text(text)
    except QuantityError as error:
        raise InputError(f"--time-of-day {text}: {error.what}", hint=error.hint) from error


def _given(settings: list[str]) -> Mapping[str, Any]:
    """Parses parameter values such as "speed=0.5". Raises InputError for any other text."""
    from executive.mission.parameters import parse_values

    return parse_values(settings)


def _stack_file(path: Path) -> Path:
    from skills.stack import stack_file

    return stack_file(path)


def _robots(text: str) -> tuple[RobotConfig, ...]:
    """Parses robots such as "alice=spot,bob=fetch". Raises InputError for any other text."""
    return parse_robots(text, [kind.name for kind in installed_plugins("errand.robots")])


class RequestFields(TypedDict, total=False):
    """Fields of a request as keyword arguments, in the form that users type at the command line.

    `faults` belong to the scenario; `light`, `clutter`, `people` and `friction` belong to the variation.
    """

    world: str
    seed: int
    out: Path | str
    record: bool
    robots: str
    stack: Path | str
    map: Path | str
    start: Pose2D | str
    answers: Sequence[str]
    require_wake: bool
    given: Mapping[str, Any]
    time_limit_s: float
    faults: Sequence[str]
    light: str
    clutter: int
    people: int
    friction: float


TIME_LIMIT_S: Final = 1200.0
"""Default time limit of a run, beyond the waits of which its mission tells."""
_READERS: Final[Mapping[str, Callable[[Any], Any]]] = {
    "robots": lambda value: _robots(value) if isinstance(value, str) else value,
    "start": lambda value: parse_start(value) if isinstance(value, str) else value,
    "stack": lambda value: _stack_file(Path(value)),
}


def with_fields(request: Request, fields: RequestFields) -> Request:
    """Copies a request with other fields. Raises InputError for an unknown field or an invalid value."""
    changed: dict[str, Any] = {}
    for name, value in fields.items():
        part = next((each for each in ("variation", "scenario") if hasattr(getattr(request, each), name)), None)
        read = _READERS.get(name, lambda plain: plain)(value)
        if part is None:
            changed[name] = read
        else:
            changed[part] = {**changed.get(part, vars(getattr(request, part))), name: read}
    try:
        return Request(**{**vars(request), **changed})
    except ValidationError as error:
        where, what, hint = first_error(error.errors())
        raise InputError(f"{'.'.join(map(str, where))}: {what}", hint=hint) from error


@dataclass(frozen=True, config=ConfigDict(extra="forbid", defer_build=True))
class Request:
    """Request of a user: a sentence, a mission file, or only commands after a conversation.

    A field with an `Option` is an option of the command line. `world` is the typed name. `require_wake` says whether
    the sentence must begin with the robot's name (None: the world decides). `answers` answer open questions in order,
    and `questions` is the policy for further questions. `given` are values for the file's parameters. The robot stands
    at `start`, by default at the world's start. `out` is the folder for the run's files, `stack` the file with the
    robot's components, `map` the folder with a map that replaces the world's map. `scenario` has faults and events,
    `scenario_files` add more; `variation` changes the world.

    `robots` are the robots of the run, if there are several or if kind or start differ from the world's.

    The run begins at `time_of_day` ("14:30"; None: now) and ends after `time_limit_s` (None: the default).

    The fields below `robots` are set once the request is understood. Then another process can run it: the sentence
    contains the answers, `text` is the file's text, and `scenario` holds the content of its files and the drawn faults;
    `given_scenario` keeps both fields of the scenario as the user gave them.
    """

    sentence: Annotated[
        str | None, Option('What is said, as in "Hey Alice, fetch me a drink".', "--say", group=Heading.REQUEST)
    ] = None
    file: Annotated[Path | None, Option("File, or name in `errand missions`.", metavar="MISSION", argument=True)] = None
    world: Annotated[str | None, Option("World by name or folder; flat unless said.", group=Heading.WORLD)] = None
    require_wake: Annotated[
        bool | None,
        Option(
            "Whether the robot's name must be said; by default if spoken, or where the world asks for it.",
            "--wake/--no-wake",
            group=Heading.REQUEST,
        ),
    ] = None
    answers: Annotated[
        tuple[str, ...],
        Option(
            "Answers a question that the sentence leaves open; repeat it for further ones, in their order.",
            "--answer",
            group=Heading.REQUEST,
        ),
    ] = ()
    questions: Annotated[
        QuestionPolicy | None,
        Option(
            "How to answer further questions; by default as the mission file says, else at the terminal, else not.",
            group=Heading.REQUEST,
        ),
    ] = None
    seed: Annotated[Seed, Option("Sets the objects in the world and all noise.", group=Heading.WORLD)] = 1
    out: Annotated[Path, Option("Folder in which each run gets its own folder.", group=Heading.OUTPUT)] = Path("out")
    record: Annotated[
        bool,
        Option(
            "Leaves no recording and no pictures.", "--no-record", read=operator.not_, typed=bool, group=Heading.OUTPUT
        ),
    ] = True
    stack: Annotated[
        Path | None,
        Option(
            "A stack file, or the name of a plug-in's: localiser, planners and so on; see errand stack show.",
            read=_stack_file,
            typed=Path,
            group=Heading.ROBOTS,
        ),
    ] = None
    map: Annotated[
        Path | None,
        Option("The robot's map, a folder of `errand map build`; by default the world's own.", group=Heading.ROBOTS),
    ] = None
    start: Annotated[
        Start | None,
        Option(
            "Where the robot stands (m, rad); 'unknown' puts it anywhere, and it finds out where.",
            metavar="X Y YAW",
            read=parse_start,
            group=Heading.ROBOTS,
        ),
    ] = None
    scenario: Scenario = NO_SCENARIO
    scenario_files: Annotated[
        tuple[Path, ...],
        Option(
            "Adds the faults and events of a file: people walk, doors close, objects are moved.",
            "--scenario",
            metavar="FILE",
            group=Heading.DISTURBANCES,
        ),
    ] = ()
    variation: Variation = NO_VARIATION
    given: Annotated[
        Mapping[str, Any],
        Option(
            "A value for a parameter of the mission file.",
            "--set",
            metavar="NAME=VALUE",
            read=_given,
            typed=list[str],
            group=Heading.REQUEST,
        ),
    ] = field(default_factory=dict)
    time_of_day: Annotated[
        str | None,
        Option(
            "Time of day when the run begins; by default the time on this machine.",
            metavar="HH:MM",
            read=_time_of_day,
            group=Heading.WORLD,
        ),
    ] = None
    time_limit_s: Annotated[
        LongDuration | None,
        Option(
            'Ends the run after so long: seconds, or "2 h"; by default 20 min beyond the mission\'s own waits.',
            "--time-limit",
            group=Heading.REQUEST,
        ),
    ] = None
    robots: Annotated[
        tuple[RobotConfig, ...],
        Option(
            "The robots and their kinds, as in alice=spot,bob=fetch@1.0,2.0,0.0.",
            metavar="NAME=KIND,...",
            read=_robots,
            group=Heading.ROBOTS,
        ),
    ] = ()
    name: str = ""
    world_name: str = ""
    robot: str = ""
    commands: tuple[str, ...] = ()
    fingerprint: str = ""
    text: str | None = None
    given_scenario: tuple[Scenario, tuple[Path, ...]] | None = None

    @property
    def only_commands(self) -> bool:
        """Returns whether the request has neither a sentence nor a file."""
        return self.sentence is None and self.file is None and bool(self.commands)

    def to_json(self) -> str:
        """Returns the JSON form, which `from_json` reads; omits default values."""
        return _form().dump_json(self, exclude_defaults=True).decode()

    @staticmethod
    def from_json(text: str | bytes) -> Request:
        """Reads the JSON form of a request. Raises ValueError for any other text."""
        return _form().validate_json(text)

    def from_anywhere(self) -> Request:
        """Copies the request with absolute paths, for a process in another folder."""
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
