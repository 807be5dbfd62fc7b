"""Command-line options, declared with the fields that they fill."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Option:
    """Command-line option of a field; a number has the range of the field's quantity.

    `name` is the option, by default the field's name; an `argument` has none. `read` converts the typed value, of type
    `typed`, to the field's value; it raises InputError.
    """

    help: str
    name: str = ""
    metavar: str | None = None
    argument: bool = False
    read: Callable[[Any], Any] | None = None
    typed: Any = str
