"""Base of all steps of a mission: policy, place in the file, and common properties."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from pydantic import PrivateAttr, StrictBool

from executive.words.command import Command
from executive.words.expression import ExpressionError
from executive.words.policy import Policy
from skills.inputs.errors import InputError, SourceLine
from skills.inputs.yaml_source import KeyPath, YamlSource
from skills.quantities import Number, Whole

Given = str | StrictBool | Whole | Number
Scalar = Given | None
Fault = tuple[KeyPath, str, str]
"""Path below a step to its fault, a sentence and a hint."""


@dataclass(frozen=True)
class Place:
    """Place of a step or a mission in a file: the document, and the path in it.

    Keys that the `part` of one of several robots does not have are looked up at the file's top.
    """

    document: YamlSource
    path: KeyPath = ()
    part: bool = False

    def line(self, below: KeyPath = ()) -> SourceLine:
        """Line of the value at a path below."""
        return SourceLine(self.document.path, self.document.line(self._whole(below)))

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """Error in the value at a path below."""
        return self.document.error(self._whole(below), message, hint)

    def _whole(self, below: KeyPath) -> KeyPath:
        own = (*self.path, *below)
        return below if self.part and own not in self.document.lines else own


class Placed(Policy):
    """Policy of a step or a mission, with its place in a file."""

    _place: Place | None = PrivateAttr(default=None)

    @property
    def place(self) -> Place | None:
        """Place in a file; None without a file."""
        return self._place

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """Error in the value at a path below the step or mission, for instance ("world",)."""
        return InputError(message, hint=hint) if self._place is None else self._place.error(below, message, hint)

    def with_place(self, place: Place | None) -> Self:
        """Copies the step or mission, with another place."""
        copy = self.model_copy()
        copy._place = place
        return copy


class Step(Placed):
    """Step of a mission, with its policy."""

    key: ClassVar[str] = ""
    """First key of its form, which names the step in path ids."""

    @property
    def source(self) -> SourceLine | None:
        """Line of the step; None without a file."""
        return None if self._place is None else self._place.line()

    @property
    def is_block(self) -> bool:
        """Returns whether the step decides, repeats, waits or the like, and is no command, skill or mission."""
        return bool(self.key)

    @property
    def commands(self) -> tuple[Command, ...]:
        """Commands of the step itself."""
        return ()

    @property
    def inner_steps(self) -> tuple[Step, ...]:
        """Steps inside the step, in the order of the fields."""
        return tuple(step for name in type(self).model_fields for step in _steps_in(getattr(self, name)))

    @property
    def words(self) -> str:
        """Name of the step in sentences."""
        return self.key

    @property
    def faults(self) -> Iterator[Fault]:
        """Faults in the step's own values."""
        yield from ()

    def walk(self) -> Iterator[Step]:
        """Yields the step and all steps inside it, those of a used mission included."""
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
    """Yields the fault of an expression, or of a text with expressions, that cannot be parsed."""
    try:
        read()
    except ExpressionError as error:
        yield path, error.message, error.hint
