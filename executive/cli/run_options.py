"""Options that several commands have: `--start`, where the robot stands, and `--set`, values for a mission file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from executive.cli.number_options import quantity_option
from executive.mission.scenario import RandomFaults
from executive.words.variation import Clutter, Friction, MorePeople
from skills.quantities import LongDuration, Port, QuantityError, Wait, clock_text

if TYPE_CHECKING:
    from executive.words.robots import RobotConfig
    from skills.robot import Pose2D

__all__ = [
    "CLUTTER",
    "FAULT",
    "FRICTION",
    "LIGHT",
    "NO_RECORD",
    "PEOPLE",
    "RANDOM_FAULTS",
    "ROBOTS",
    "SCENARIO",
    "SET",
    "START",
    "START_OR_UNKNOWN",
    "VIEW",
    "VIEW_FOR",
    "VIEW_PORT",
    "StartCommand",
    "joined",
    "start_pose",
]

_NAME = "--start"
_NUMERIC = re.compile(r"[-+]?\.?\d[\d.,]*(?:e[-+]?\d+)?", re.IGNORECASE)
START = Annotated[
    str | None, typer.Option(_NAME, metavar="X Y YAW", help="Where the robot stands: metres and radians.")
]
START_OR_UNKNOWN = Annotated[
    str | None,
    typer.Option(
        _NAME, metavar="X Y YAW", help="Where the robot stands (m, rad); 'unknown': anywhere, and it finds out."
    ),
]
FAULT = Annotated[
    list[str] | None,
    typer.Option(
        "--fault", metavar="WORDS", help='A fault, as in "camera.hand: dropout 5 s at 20 s"; may be repeated.'
    ),
]
SCENARIO = Annotated[
    list[Path] | None,
    typer.Option("--scenario", metavar="FILE", help="Faults and events: people walk, doors close, objects are moved."),
]
RANDOM_FAULTS = Annotated[int, quantity_option(RandomFaults, "--random-faults", help="So many faults, by the seed.")]
TIME_OF_DAY = Annotated[
    str | None, typer.Option("--time-of-day", metavar="HH:MM", help="When the run begins; the time on this machine.")
]
TIME_LIMIT = Annotated[
    float | None,
    quantity_option(LongDuration, "--time-limit", help='The run ends after so long: seconds, or "2 h"; 20 min.'),
]
LIGHT = Annotated[
    str, typer.Option(metavar="NAME", help="normal, dim, bright, evening, low sun, or a brightness (1 is day light).")
]
CLUTTER = Annotated[int, quantity_option(Clutter, help="So many more objects lie about, by the seed.")]
PEOPLE = Annotated[int, quantity_option(MorePeople, help="So many more people walk about, by the seed.")]
FRICTION = Annotated[float, quantity_option(Friction, help="A factor on the friction of loose objects and robots.")]
ROBOTS = Annotated[
    str | None,
    typer.Option(
        "--robots", metavar="NAME=KIND,...", help="The robots and their kinds, as in alice=spot,bob=fetch@1.0,2.0,0.0."
    ),
]
NO_RECORD = Annotated[bool, typer.Option("--no-record", help="No recording and no pictures.")]
VIEW = Annotated[bool, typer.Option("--view", help="Serve a live page on 127.0.0.1, also after the end.")]
VIEW_FOR = Annotated[float | None, quantity_option(Wait, help="The page stays so long (s) after the end.")]
VIEW_PORT = Annotated[int, quantity_option(Port, help="The page's port; 0 takes a free one.")]
SET = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A value for a parameter of the mission file.")
]


class StartCommand(TyperCommand):
    """A command whose `--start` takes three numbers, or one word."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As click's, after the numbers are joined."""
        return super().parse_args(ctx, joined(args))


def joined(arguments: Sequence[str]) -> list[str]:
    """The arguments with three numbers after `--start` as one, so that a word may stand there as well."""
    return list(_joined(list(arguments)))


def _joined(arguments: list[str]) -> Iterator[str]:
    at = 0
    while at < len(arguments):
        words = arguments[at + 1 : at + 4]
        if arguments[at] == _NAME and words and _NUMERIC.fullmatch(words[0]):
            told = [*takewhile(lambda word: not word.startswith("--"), words)]
            yield f"{_NAME}={' '.join(told)}"
            at += 1 + len(told)
        else:
            yield arguments[at]
            at += 1


def time_of_day(text: str | None) -> str | None:
    """The time of day of an option, as "08:30". Raises InputError: it is none."""
    from skills.files.errors import InputError

    try:
        return None if text is None else clock_text(text)
    except QuantityError as error:
        raise InputError(f"--time-of-day {text}: {error.what}", hint=error.hint) from error


def robots_of(text: str | None) -> tuple[RobotConfig, ...]:
    """The robots of the option. Raises InputError: they are none, or of a kind that is not installed."""
    from executive.words.robots import parse_robots
    from plant.kinds import robot_kinds

    return () if text is None else parse_robots(text, robot_kinds())


def start_pose(text: str | None) -> Pose2D | None:
    """The pose in `X Y YAW`; None where none is said. Raises InputError."""
    from executive.mission.request import Start

    return None if text is None else Start.of(text).pose
