"""Declares with a field how it is typed on the command line, so that each option has one place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Option:
    """How a field is typed on the command line; a number has the range of the field's quantity.

    `name` is its option, by default the field's name; an `argument` has none. `read` makes the field's value of what is
    typed, a value of the type `typed`; it raises InputError.
    """

    help: str
    name: str = ""
    metavar: str | None = None
    argument: bool = False
    read: Callable[[Any], Any] | None = None
    typed: Any = str
