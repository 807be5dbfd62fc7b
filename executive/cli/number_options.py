"""Options and arguments that are numbers: each has a quantity, whose range its messages name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO, Any

import typer

from skills.files.errors import one_line
from skills.quantities import QuantityError, number_in, range_text


class OutOfRangeError(typer.BadParameter):
    """The words of an option give no number of its quantity; told in one line, as other bad input is."""

    def show(self, file: IO[Any] | None = None) -> None:
        """Writes the line to standard error."""
        name = "" if self.param is None else f"{self.param.get_error_hint()}: ".replace("'", "")
        typer.echo(one_line(f"errand: {name}{self.message}"), file=file, err=file is None)


@dataclass(frozen=True)
class NumberReader:
    """Reads the words of an option as a number of a quantity; a duration may have units."""

    hint: Any

    def __call__(self, words: Any) -> Any:
        """The number. Raises OutOfRangeError, which ends the command, when the words give none or one out of range."""
        if not isinstance(words, str):
            return words
        try:
            return number_in(words, self.hint)
        except QuantityError as error:
            raise OutOfRangeError(f"{error.what}; {error.hint}") from error


def quantity_option(hint: Any, *names: str, help: str, show_default: bool = True) -> Any:
    """An option that takes a number of a quantity."""
    reader = NumberReader(hint)
    return typer.Option(
        *names,
        parser=reader,
        metavar=f"<{range_text(hint).removeprefix('from ')}>",
        help=help,
        show_default=show_default,
    )


def quantity_argument(hint: Any, *, metavar: str, help: str) -> Any:
    """An argument that is a number of a quantity."""
    return typer.Argument(parser=NumberReader(hint), metavar=metavar, help=help)
