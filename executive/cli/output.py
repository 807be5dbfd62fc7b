"""Output of the command line for people (console) and scripts (last line of standard output), and questions."""

from __future__ import annotations

import errno
import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

import typer

from skills.inputs.errors import InputError, shortage
from skills.inputs.outside import LONGEST_ANSWER, LONGEST_TEXT, plain_text, writing

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    from executive.language.questions import Answerer, ClarifyingQuestion

NOT_ACHIEVED = 1
BAD_INPUT = 2
BAR_REFRESH_HZ: Final = 2.0
_OF_NAMES: Final = frozenset(
    {errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM, errno.EROFS, errno.ELOOP, errno.EEXIST}
)
_SHOWN: Final = 100
_MOST_LINES: Final = 50


def console_for(as_json: bool) -> Console:
    """Returns the console for people: standard error if scripts read standard output."""
    from rich.console import Console

    return Console(stderr=as_json, highlight=False, soft_wrap=True)


def plain_lines(console: Console) -> Callable[[str], None]:
    """Returns a function that prints a line on a console without markup."""
    return lambda line: console.print(line, markup=False)


def print_json(value: Mapping[str, Any] | Sequence[Any]) -> None:
    """Prints one JSON object or array on one line of standard output."""
    sys.stdout.write(json.dumps(value, ensure_ascii=False, allow_nan=False) + "\n")
    sys.stdout.flush()


def finish(
    values: Mapping[str, Any] | Sequence[Any], as_json: bool, *, good: bool = True, otherwise: int = NOT_ACHIEVED
) -> None:
    """Ends a command: prints the result if `as_json`, and exits with the status `otherwise` unless `good`."""
    if as_json:
        print_json(values)
    if not good:
        raise typer.Exit(otherwise)


@contextmanager
def progress_bar(console: Console, what: str, total: int, *, lines: bool = False) -> Iterator[Callable[..., None]]:
    """Shows a bar over `total` steps with the time left; nothing without a terminal, or for a single step.

    Call the yielded function at the end of each step, perhaps with the name of the next step. Without a terminal,
    `lines` shows what it is called with. A `total` that it is called with is the new one, after steps were added.
    """
    if not console.is_terminal or total < 2:
        numbers = iter(range(1, total + 1))

        def tell(line: str | None = None, **_: int) -> None:
            if lines and line is not None:
                console.print(f"{next(numbers)} of {total} {what}: {line}", markup=False)

        yield tell
        return
    from rich import progress

    columns = (progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn())
    times = (progress.TimeElapsedColumn(), progress.TimeRemainingColumn(), progress.TextColumn("left"))
    with progress.Progress(*columns, *times, console=console, transient=True, refresh_per_second=BAR_REFRESH_HZ) as bar:
        task = bar.add_task(what, total=total)
        yield lambda following=None, **new: bar.update(task, advance=1, description=following, **new)


def show_table(console: Console, header: Sequence[str], rows: Iterable[Sequence[str | Text]]) -> None:
    """Prints a table: in a box at a terminal, else one line for each row, with columns two spaces apart."""
    if console.is_terminal:
        from rich.table import Column, Table
        from rich.text import Text

        table = Table(*(Column(name, overflow="fold") for name in header))
        for row in rows:
            table.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in row))
        console.print(table)
        return
    plain = [[str(cell).replace("\n", "; ") for cell in row] for row in (header, *rows)]
    widths = [max(map(len, column)) for column in zip(*plain, strict=True)]
    for cells in plain:
        line = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        console.print(line.rstrip(), markup=False)


def refuse(error: InputError | OSError) -> NoReturn:
    """Ends a command with exit status 2 for bad input, a file that cannot be used, or a lack of disk or files.

    Prints a line on standard error for each error, and the number of those beyond `_MOST_LINES`. Raises any other
    OSError again.
    """
    if isinstance(error, InputError):
        refused = error
    elif lack := shortage(error):
        what = f"{lack}; what this command was writing is lost or incomplete"
        refused = InputError(what, hint="make room, and give the command again", file=error.filename)
    elif isinstance(error, FileNotFoundError) and error.filename is None:  # of the working directory
        refused = InputError("the folder in which it was called is removed", hint="go to another one by cd")
    elif isinstance(error, FileNotFoundError) and not Path(error.filename).parent.is_dir():
        what = "its folder was removed while this command used it; what it held is lost"
        refused = InputError(what, hint="give the command again", file=error.filename)
    elif error.errno not in _OF_NAMES or error.filename is None:
        raise error
    else:
        what = f"cannot use it ({error.strerror})"
        refused = InputError(what, hint="name another", file=str(error.filename)[:_SHOWN])
    every = (refused, *refused.others)
    for each in every[:_MOST_LINES]:
        typer.echo(f"errand: {each}", err=True)
    if len(every) > _MOST_LINES:
        typer.echo(f"errand: and {len(every) - _MOST_LINES} more; mend these first", err=True)
    raise SystemExit(BAD_INPUT) from error


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yields a temporary folder, and copies it to a new folder when the block ends without an error.

    Raises InputError if the new folder exists and is not empty, or cannot be written.
    """
    with writing(out, "name another --out"):
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError("it exists already", hint="name a new folder by --out", file=out)
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as folder:
            yield Path(folder)
            shutil.copytree(folder, out, dirs_exist_ok=True)


def terminal_answerer() -> Answerer | None:
    """Returns the function that asks questions at the terminal; None if there is no terminal, as in scripts."""
    attended = sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()
    return ask_at_terminal if attended else None


def ask_at_terminal(question: ClarifyingQuestion) -> str | None:
    """Asks a question at the terminal; returns None for an empty line or the end of the input."""
    numbers = "  ".join(f"[{number}] {name}" for number, name in enumerate(question.candidates, start=1))
    typer.echo(f"? {question.text}  {numbers}".rstrip(), err=True)
    try:
        line = sys.stdin.readline(LONGEST_TEXT)
        return plain_text(line, what="the answer", longest=LONGEST_ANSWER) or None
    except (OSError, UnicodeDecodeError):
        return None
