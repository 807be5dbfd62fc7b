"""Robots in a run: their names, kinds, starts, docks and stacks."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from skills.inputs.errors import InputError, SourceLine, known_names, suggestion
from skills.inputs.schema import Name, Strict
from skills.inputs.yaml_source import YamlSource
from skills.quantities import Angle, Coordinate, QuantityError, number_in
from skills.robot import Pose2D

EVERYBODY: Final = frozenset({"all", "both", "everybody", "everyone", "you", "all robots", "all of you"})
"""Words that call all robots; no robot has one of them as its name."""
_FORM: Final = "write NAME=KIND for each, for instance alice=spot,bob=fetch"
_NAME: Final = re.compile(r"[^\W\d_][\w' .-]*")
_ASSIGNED: Final = re.compile(r"([^=@,]*)=(.*)", re.DOTALL)
_NUMBER: Final = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?\s*", re.IGNORECASE)


@dataclass(frozen=True)
class RobotConfig:
    """Robot of a run.

    `kind` is a name in the entry-point group `errand.robots`; the robot begins at `start` (world frame), charges at the
    place `dock` and uses the components in the file `stack`. None stands for the world's value, or else the kind's.
    `source` is the line of the file that names the robot.
    """

    name: str
    kind: str
    start: Pose2D | None = None
    dock: str | None = None
    stack: Path | None = None
    source: Annotated[SourceLine | None, Field(exclude=True)] = field(default=None, compare=False)

    def __str__(self) -> str:
        """Text form of the option `--robots`."""
        at = "" if self.start is None else f"@{self.start.x_m!r},{self.start.y_m!r},{self.start.yaw_rad!r}"
        return f"{self.name}={self.kind}{at}"


class NamedRobot(Strict):
    """Robot of a file: its kind, start, dock and stack."""

    kind: Name = Field(description="The kind of robot: spot, fetch, or one that a package adds.")
    at: tuple[Coordinate, Coordinate, Angle] | None = Field(
        None,
        description="Where it begins: x and y (m) and the heading (rad), in the world frame. By default the first "
        "robot begins at the world's start, each other one at the nearest free place.",
    )
    dock: Name | None = Field(
        None, description="The place where it charges; by default the world's dock for the first, else where it begins."
    )
    stack: Name | None = Field(None, description="A stack file, seen from this file's folder; by default its kind's.")


_SHORT: Final = BeforeValidator(
    lambda value: {"kind": value} if isinstance(value, str) else value, json_schema_input_type=NamedRobot | Name
)
RobotsFile = Annotated[dict[Name, Annotated[NamedRobot, _SHORT]], Field(min_length=1)]
"""Robots by name, each as its kind alone or with more keys."""


def name_key(name: str) -> str:
    """Normal form of a robot's name, without case and without separators between words."""
    return re.sub(r"[\W_]+", " ", name.casefold()).strip()


def display_name(name: str) -> str:
    """Robot's name as shown to users: "alice" becomes Alice; capitals stay."""
    return name[:1].upper() + name[1:]


def find_robot(said: str, names: Iterable[str]) -> str | None:
    """Finds the robot of that name among `names`, ignoring case and separators; None if there is no such robot."""
    return next((name for name in names if name_key(name) == name_key(said)), None)


def named_robot(said: str, names: Iterable[str]) -> tuple[str | None, str]:
    """Splits a text such as "bob: robot dies" into the robot that it names, None for no robot, and the rest."""
    head, _, rest = said.partition(":")
    robot = find_robot(head, names) if rest else None
    return robot, said if robot is None else rest.strip()


def name_clash(name: str, names: Iterable[str]) -> InputError | None:
    """Error if `name` is one of `names`, or differs only in case or separators; else None."""
    other = find_robot(name, names)
    if other is None:
        return None
    what = f"two robots are called '{name}'" if other == name else f"'{other}' and '{name}' are the same name"
    return InputError(what, hint="give one of them another name")


def check_name(name: str) -> str:
    """Returns the name if it is valid for a robot. Raises InputError if it is not."""
    if not name:
        raise InputError("a robot without a name", hint=_FORM)
    if not _NAME.fullmatch(name) or not name_key(name).strip():
        raise InputError(
            f"'{name[:60]}' is no name for a robot",
            hint="write a letter, then letters, digits, spaces, dots, dashes and apostrophes, as in 'alice'",
        )
    if name_key(name) in EVERYBODY:
        raise InputError(f"'{name}' means all robots, so no robot can have that name", hint="give it another name")
    return name


def check_kind(kind: str, kinds: Collection[str]) -> str:
    """Returns the kind if it is known. Raises InputError with the known kinds and the nearest one."""
    if kind not in kinds:
        known = known_names(kind, sorted(kinds))
        near = suggestion(kind, kinds, known)
        raise InputError(f"unknown kind of robot '{kind[:60]}'", hint=near if near == known else f"{near} ({known})")
    return kind


def parse_robots(text: str, kinds: Collection[str]) -> tuple[RobotConfig, ...]:
    """Parses the option `--robots`: "alice=spot,bob=fetch" or "alice=spot@1.0,2.0,1.57,bob=fetch".

    Raises:
        InputError: there is no robot, two have one name, a name or start is invalid, or a kind is not among `kinds`.
    """
    robots: dict[str, RobotConfig] = {}
    for said in _entries(text):
        match = _ASSIGNED.fullmatch(said)
        if match is None:
            raise InputError(f"'{said.strip()[:60]}' does not give a robot and its kind", hint=_FORM)
        name, (kind, at, start) = check_name(match[1].strip()), match[2].partition("@")
        if (double := name_clash(name, robots)) is not None:
            raise double
        check_kind(kind.strip(), kinds)
        try:
            pose = parse_pose(start.split(",")) if at else None
        except QuantityError as error:
            raise InputError(f"'{start[:60]}' is no start for {name}: {error.what}", hint=error.hint) from None
        robots[name] = RobotConfig(display_name(name), kind.strip(), pose)
    return tuple(robots.values())


def robots_of_file(
    robots: Mapping[str, NamedRobot], kinds: Collection[str], source: YamlSource | None
) -> tuple[RobotConfig, ...]:
    """Reads the robots under `robots` in a file, in the file's order; stack paths are relative to the file's folder.

    Raises:
        InputError: with file and line: two have one name, a name is invalid, or a kind is not among `kinds`.
    """
    found: dict[str, RobotConfig] = {}
    for name, robot in robots.items():
        line = None if source is None else SourceLine(source.path, source.line(("robots", name)))
        try:
            if (double := name_clash(check_name(name), found)) is not None:
                raise double
            check_kind(robot.kind, kinds)
        except InputError as error:
            raise InputError.at(line, error.message, hint=error.hint) from error
        start = None if robot.at is None else Pose2D(*robot.at)
        stack = None if robot.stack is None else (Path() if source is None else source.path.parent) / robot.stack
        found[name] = RobotConfig(display_name(name), robot.kind, start, robot.dock, stack, line)
    return tuple(found.values())


def parse_pose(words: Sequence[str]) -> Pose2D:
    """Parses three words as a pose: x and y (m) and the heading (rad). Raises QuantityError."""
    named = (("x", Coordinate), ("y", Coordinate), ("the heading", Angle))
    if len(words) != len(named):
        how = "give x and y in metres and the heading in radians"
        raise QuantityError(f"a pose has 3 numbers, not {len(words)}", how)
    numbers = []
    for word, (name, hint) in zip(words, named, strict=True):
        try:
            numbers.append(float(number_in(word, hint)))
        except QuantityError as error:
            raise QuantityError(f"{name} {error.what}", error.hint) from error
    return Pose2D(*numbers)


def _entries(text: str) -> Iterator[str]:
    """Yields the text for each robot in the option; commas in a start do not separate robots. Raises InputError."""
    if not text.strip(" ,"):
        raise InputError("no robots are named", hint=_FORM)
    entry = ""
    for piece in text.split(","):
        if "@" in entry and _NUMBER.fullmatch(piece):
            entry = f"{entry},{piece}"
            continue
        if entry:
            yield entry
        entry = piece
        if not piece.strip():
            raise InputError(f"'{text[:60]}' has a comma too many", hint=_FORM)
    yield entry
