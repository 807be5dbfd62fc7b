"""One run of an evaluation as plain data, the same on every machine, with an id that is the hash of its content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

from executive.mission.request import Request
from skills.files.errors import InputError

__all__ = ["Evaluation", "RunSpec", "first_seeds", "seed_range"]

_ID_LETTERS: Final = 16


@dataclass(frozen=True)
class RunSpec:
    """A request, what people call its `mission`, and in words what is varied, by dimension.

    `files` has the texts of the request's files and of all that they use, by path, so that a machine that has none of
    them can run it. A run with a `folder` leaves all its files there, else only one that is to be looked at leaves any.
    """

    request: Request
    mission: str
    varied: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""

    @cached_property
    def id(self) -> str:
        """The hash of its content: equal for equal runs, wherever the files lie."""
        content = json.loads(replace(self.request, out=Path()).to_json())
        for name in {"file", "stack"} & content.keys():
            content[name] = self.files.get(content[name], content[name])
        content["scenario_files"] = [self.files.get(str(path), str(path)) for path in self.request.scenario_files]
        text = json.dumps({**content, "files": sorted(self.files.values())}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_LETTERS]

    @property
    def robot_words(self) -> str:
        """The robots as `errand run --robots` takes them."""
        return ",".join(map(str, self.request.robots))

    @property
    def variation_words(self) -> str:
        """The variation on one line."""
        return ", ".join(f"{name} {value}" for name, value in self.varied.items())


@dataclass(frozen=True)
class Evaluation:
    """All runs of an evaluation; `name` is that of its scenario file, or says what is drawn."""

    name: str
    runs: Sequence[RunSpec]

    @cached_property
    def digest(self) -> str:
        """Equal for evaluations of the same runs."""
        return hashlib.sha256("".join(run.id for run in self.runs).encode()).hexdigest()[:_ID_LETTERS]


def seed_range(text: str) -> tuple[int, ...]:
    """Seeds from "1-20", "3" or "1,4,7-9".

    Raises:
        InputError: anything else.
    """
    try:
        seeds = tuple(seed for part in text.split(",") for seed in _span(part))
    except ValueError as error:
        raise InputError(f"'{text}' is no range of seeds", hint="write it like 1-20 or 1,4,7") from error
    if not seeds:
        raise InputError(f"'{text}' holds no seed", hint="write it like 1-20")
    return seeds


def first_seeds(text: str, count: int) -> tuple[int, ...]:
    """The first `count` seeds from text whose last range may have no end: "8001-" or "3,8001-".

    Raises:
        InputError: it is no range of seeds, or holds fewer.
    """
    before, _, last = text.rpartition(",")
    begun, dash, end = last.partition("-")
    if dash and not end.strip():
        listed = seed_range(before) if before else ()
        seeds = (*listed, *range(first := seed_range(begun)[0], first + count))
    else:
        seeds = seed_range(text)
    if len(seeds) < count:
        raise InputError(
            f"'{text}' holds {len(seeds)} seeds, fewer than {count}", hint="leave its end open, as in 8001-"
        )
    return seeds[:count]


def _span(part: str) -> range:
    first, dash, last = part.partition("-")
    return range(int(first), int(last if dash else first) + 1)
