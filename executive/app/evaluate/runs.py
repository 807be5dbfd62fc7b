"""One run of an evaluation as plain data, the same on every machine, with an id that is the hash of its content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, Final

from executive.words.variation import NO_VARIATION, Variation

__all__ = ["Evaluation", "RunSpec"]

_ID_LETTERS: Final = 16


@dataclass(frozen=True)
class RunSpec:
    """What one run does.

    Exactly one of `sentence` and `file` says what is asked for; `file`, `scenario` and `stack` are paths. `files` has
    the texts of those and of all that they use, by path, so that a machine that has none of them can run it.
    `mission` is what people call it, `given` are values for the file's parameters. `robots` maps the robots' names to
    their kinds; empty: the world's own. `varied` says in words what is varied, by dimension.
    """

    mission: str
    seed: int
    sentence: str | None = None
    file: str | None = None
    world: str | None = None
    robots: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, Any] = field(default_factory=dict)
    answers: tuple[str, ...] = ()
    stack: str | None = None
    time_limit_s: float | None = None
    variation: Variation = NO_VARIATION
    faults: tuple[str, ...] = ()
    random_faults: int = 0
    scenario: str | None = None
    varied: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def id(self) -> str:
        """The hash of its content: equal for equal runs, wherever the files lie."""
        content = asdict(self)
        for name in ("mission", "varied", "files"):
            del content[name]
        for name in ("file", "scenario", "stack"):
            content[name] = self._content(content[name])
        text = json.dumps({**content, "files": sorted(self.files.values())}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_LETTERS]

    def _content(self, path: str | None) -> str | None:
        """The text of a file that it carries, else the name itself."""
        return path if path is None else self.files.get(path, path)

    @property
    def robot_words(self) -> str:
        """The robots as `errand run --robots` takes them."""
        return ",".join(f"{name}={kind}" for name, kind in self.robots.items())

    @property
    def variation_words(self) -> str:
        """What is varied, on one line."""
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
