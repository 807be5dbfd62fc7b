"""Options and arguments that are numbers; each is of a quantity, which has a range and a name for messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO, Any

import typer

from skills.inputs.errors import one_line
from skills.quantities import QuantityError, number_in, range_text


class OutOfRangeError(typer.BadParameter):
    """Raised for an option whose text is no number of the option's quantity; shown in one line."""

    def show(self, file: IO[Any] | None = None) -> None:
        """Writes the line to standard error."""
        name = "" if self.param is None else f"{self.param.get_error_hint()}: ".replace("'", "")
        typer.echo(one_line(f"errand: {name}{self.message}"), file=file, err=file is None)


@dataclass(frozen=True)
class NumberReader:
    """Parser from an option's text to a number of a quantity; a duration may have units."""

    hint: Any

    def __call__(self, words: Any) -> Any:
        """Returns the number. Raises OutOfRangeError if the text is no number or the number is out of range."""
        if not isinstance(words, str):
            return words
        try:
            return number_in(words, self.hint)
        except QuantityError as error:
            raise OutOfRangeError(f"{error.what}; {error.hint}") from error


def quantity_option(hint: Any, *names: str, group: str | None = None, **settings: Any) -> Any:
    """Returns a typer option that takes a number of a quantity; `group` is the option's heading in the help."""
    metavar = f"<{range_text(hint).removeprefix('from ')}>"
    return typer.Option(*names, parser=NumberReader(hint), metavar=metavar, rich_help_panel=group, **settings)


def quantity_argument(hint: Any, *, metavar: str, help: str) -> Any:
    """Returns a typer argument that takes a number of a quantity."""
    return typer.Argument(parser=NumberReader(hint), metavar=metavar, help=help)
