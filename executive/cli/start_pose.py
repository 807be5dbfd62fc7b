"""`--start X Y YAW`: where the robot stands."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

import typer

from executive.mission.request import Start
from skills.robot import Pose2D

__all__ = ["START", "joined", "start_pose"]

_NAME = "--start"
START = Annotated[
    str | None, typer.Option(_NAME, metavar="X Y YAW", help="Where the robot stands: metres and radians.")
]


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
    return None if text is None else Start.of(text).pose


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
