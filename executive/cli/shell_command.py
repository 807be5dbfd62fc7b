"""`errand shell` takes one command after another in one process, so that what a command loads is loaded once."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import typer

from executive.cli.entry import COMMANDS, app

_PROMPT: Final = "errand> "
_HISTORY: Final = Path(".local") / "state" / "errand" / "history"
_LONGEST_HISTORY: Final = 1_000
_HELP: Final = """COMMAND ...       any command of errand, as in: check patrol, run fetch_drink --seed 3, runs, log
say SENTENCE      runs a sentence, as in: say fetch me a drink
help, exit        this list; the end (also Ctrl-D)"""


def shell() -> None:
    """Takes commands one after another, each as after `errand`, with history; parsers and networks stay loaded."""
    if sys.stdin.isatty():
        typer.echo(_HELP)
    for line in _lines():
        first, _, rest = line.strip().partition(" ")
        try:
            words = ["run", "--say", rest.strip().strip("'\"")] if first == "say" else shlex.split(line, comments=True)
        except ValueError as error:
            typer.echo(f"errand: '{line.strip()[:60]}' cannot be read ({error}); close the quotation mark", err=True)
            continue
        if words[:1] in (["exit"], ["quit"]):
            return
        if words[:1] == ["help"]:
            typer.echo(_HELP)
        elif words[:1] == ["shell"]:
            typer.echo("errand: this is the shell already; `help` lists what it takes", err=True)
        elif words:
            with suppress(SystemExit, KeyboardInterrupt):
                app(words, prog_name="errand")


def _lines() -> Iterator[str]:
    """Yields the lines that the user types or pipes in; at a terminal with history and the names of commands."""
    if not sys.stdin.isatty():
        yield from sys.stdin
        return
    import readline  # takes the keys of `input`

    file = Path(os.environ.get("HOME", ".")) / _HISTORY
    with suppress(OSError):
        readline.read_history_file(file)
    readline.set_history_length(_LONGEST_HISTORY)
    readline.set_completer(lambda text, number: [*(name for name in COMMANDS if name.startswith(text)), None][number])
    readline.parse_and_bind("tab: complete")
    try:
        while True:
            with suppress(KeyboardInterrupt):
                yield input(_PROMPT)
    except EOFError:
        typer.echo()
    finally:
        with suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            readline.write_history_file(file)
