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
from typer._completion_classes import BashComplete
from typer.main import get_command

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.cli.defaults import default_map
from executive.cli.entry import app
from executive.words.mission import DEFAULT_WORLD

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
    """Yields the lines that the user types or pipes in; at a terminal with history and completion."""
    if not sys.stdin.isatty():
        yield from sys.stdin
        return
    import readline  # takes the keys of `input`

    file = Path(os.environ.get("HOME", ".")) / _HISTORY
    with suppress(OSError):
        readline.read_history_file(file)
    readline.set_history_length(_LONGEST_HISTORY)
    readline.set_completer_delims(" ")
    readline.set_completer(
        lambda text, number: [*words_of_line(readline.get_line_buffer()[: readline.get_begidx()], text), None][number]
    )
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


def words_of_line(before: str, typed: str) -> list[str]:
    """Completes a word of a line in `errand shell`: as other shells do, and after `say` words of the world's names."""
    words = before.split()
    if words[:1] != ["say"]:
        return [each.value for each in BashComplete(get_command(app), {}, "errand", "").get_completions(words, typed)]
    known = knowledge_of(open_world(default_map(Path()).get("run", {}).get("world", DEFAULT_WORLD)))
    names = (*known.place_names(), *known.object_names(), *known.people)
    return sorted({word for name in names for word in name.split() if word.lower().startswith(typed.lower())})
