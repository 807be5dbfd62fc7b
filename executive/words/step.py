"""A step of a mission: its policy, its place in the file, and what every kind of step can tell of itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar, Self

from pydantic import PrivateAttr, StrictBool

from executive.words.command import Command
from executive.words.expression import ExpressionError
from executive.words.policy import Policy
from skills.files.errors import InputError, SourceLine
from skills.files.yaml_source import KeyPath, YamlSource
from skills.quantities import Number, Whole

Given = str | StrictBool | Whole | Number
Scalar = Given | None
Fault = tuple[KeyPath, str, str]
"""The path below a step to what is wrong with it, a sentence and a hint."""


@dataclass(frozen=True)
class Place:
    """The place of a step in a file: the document, and the path in it."""

    source: YamlSource
    path: KeyPath

    @property
    def line(self) -> SourceLine:
        """Its line."""
        return SourceLine(self.source.path, self.source.line(self.path))

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at a path below."""
        return self.source.error((*self.path, *below), message, hint)


class Step(Policy):
    """A step: its policy, and what it is to do."""

    key: ClassVar[str] = ""
    """The first key of its form, which names it in path ids."""
    _place: Place | None = PrivateAttr(default=None)

    @property
    def place(self) -> Place | None:
        """Where it stands in a file; None when it was spoken."""
        return self._place

    @property
    def source(self) -> SourceLine | None:
        """The line where it stands; None when it was spoken."""
        return None if self._place is None else self._place.line

    @property
    def is_block(self) -> bool:
        """Whether it decides, repeats, waits or the like, and is no command, skill or mission."""
        return bool(self.key)

    @property
    def commands(self) -> tuple[Command, ...]:
        """Its own commands."""
        return ()

    @property
    def inner_steps(self) -> tuple[Step, ...]:
        """The steps that it holds, in order."""
        return ()

    @property
    def words(self) -> str:
        """What it is called in sentences."""
        return self.key

    @property
    def faults(self) -> Iterator[Fault]:
        """What is wrong with its values by themselves."""
        yield from ()

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at a path below the step."""
        return InputError(message, hint=hint) if self._place is None else self._place.error(below, message, hint)

    def with_place(self, place: Place | None) -> Self:
        """The same step, which stands at a place."""
        copy = self.model_copy()
        copy._place = place
        return copy

    def walk(self) -> Iterator[Step]:
        """Itself and all steps that it holds, those of a used mission included."""
        yield self
        for step in self.inner_steps:
            yield from step.walk()


def unreadable(path: KeyPath, read: Callable[[], object]) -> Iterator[Fault]:
    """What is wrong with an expression or a text with expressions."""
    try:
        read()
    except ExpressionError as error:
        yield path, error.message, error.hint
