"""Options that several commands have: `--start`, where the robot stands, and `--set`, values for a mission file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

if TYPE_CHECKING:
    from skills.robot import Pose2D

__all__ = [
    "FAULT",
    "RANDOM_FAULTS",
    "SCENARIO",
    "SET",
    "START",
    "START_OR_UNKNOWN",
    "StartCommand",
    "joined",
    "start_pose",
]

_NAME = "--start"
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
RANDOM_FAULTS = Annotated[int, typer.Option("--random-faults", min=0, max=100, help="So many faults, by the seed.")]
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
        after = arguments[at + 1 : at + 4]
        if arguments[at] == _NAME and len(after) == 3 and all(map(_is_number, after)):
            yield f"{_NAME}={' '.join(after)}"
            at += 4
        else:
            yield arguments[at]
            at += 1


def start_pose(text: str | None) -> Pose2D | None:
    """The pose in `X Y YAW`; None where none is said. Raises InputError."""
    from executive.mission.request import Start

    return None if text is None else Start.of(text).pose


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
