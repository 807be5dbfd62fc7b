"""A step of a mission: its policy, its place in the file, and what every kind of step can tell of itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

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
    """The place of a step or a mission in a file: the document, and the path in it.

    What does not stand in the `part` of one of several robots is looked for at the file's top.
    """

    document: YamlSource
    path: KeyPath = ()
    part: bool = False

    def line(self, below: KeyPath = ()) -> SourceLine:
        """The line of what stands at a path below."""
        return SourceLine(self.document.path, self.document.line(self._whole(below)))

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at a path below."""
        return self.document.error(self._whole(below), message, hint)

    def _whole(self, below: KeyPath) -> KeyPath:
        own = (*self.path, *below)
        return below if self.part and own not in self.document.lines else own


class Placed(Policy):
    """A step or a mission: its policy, and where it stands in a file."""

    _place: Place | None = PrivateAttr(default=None)

    @property
    def place(self) -> Place | None:
        """Where it stands in a file; None when it was spoken."""
        return self._place

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at a path below it, for instance ("world",)."""
        return InputError(message, hint=hint) if self._place is None else self._place.error(below, message, hint)

    def with_place(self, place: Place | None) -> Self:
        """The same, which stands at a place."""
        copy = self.model_copy()
        copy._place = place
        return copy


class Step(Placed):
    """A step: its policy, and what it is to do."""

    key: ClassVar[str] = ""
    """The first key of its form, which names it in path ids."""

    @property
    def source(self) -> SourceLine | None:
        """The line where it stands; None when it was spoken."""
        return None if self._place is None else self._place.line()

    @property
    def is_block(self) -> bool:
        """Returns whether it decides, repeats, waits or the like, and is no command, skill or mission."""
        return bool(self.key)

    @property
    def commands(self) -> tuple[Command, ...]:
        """Its own commands."""
        return ()

    @property
    def inner_steps(self) -> tuple[Step, ...]:
        """The steps that it holds, in the order of its fields."""
        return tuple(step for name in type(self).model_fields for step in _steps_in(getattr(self, name)))

    @property
    def words(self) -> str:
        """What it is called in sentences."""
        return self.key

    @property
    def faults(self) -> Iterator[Fault]:
        """What is wrong with its values by themselves."""
        yield from ()

    def walk(self) -> Iterator[Step]:
        """Itself and all steps that it holds, those of a used mission included."""
        yield self
        for step in self.inner_steps:
            yield from step.walk()


def _steps_in(value: Any) -> Iterator[Step]:
    if isinstance(value, Step):
        yield value
    elif isinstance(value, tuple | dict):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _steps_in(part)


def unreadable(path: KeyPath, read: Callable[[], object]) -> Iterator[Fault]:
    """What is wrong with an expression or a text with expressions."""
    try:
        read()
    except ExpressionError as error:
        yield path, error.message, error.hint
