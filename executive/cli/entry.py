"""Where the console script begins: commands on pictures alone are run without loading the language and the plant."""

from __future__ import annotations

import sys
from typing import Final

import typer

from executive.cli.detect_command import detect
from executive.cli.refine_command import refine_command
from executive.cli.score_command import score_command
from executive.cli.train_command import train_command

__all__ = ["main"]

LIGHT: Final = (("detect",), ("dataset", "score"), ("dataset", "train"), ("dataset", "refine"))


def light_app() -> typer.Typer:
    """The commands that need only pictures and the detector, as they stand in `executive.cli.main` too."""
    app = typer.Typer(name="errand", add_completion=False, pretty_exceptions_enable=False)
    app.command()(detect)
    dataset = typer.Typer(name="dataset", help="Pictures with labels.")
    dataset.command(name="score")(score_command)
    dataset.command(name="train")(train_command)
    dataset.command(name="refine")(refine_command)
    dataset.callback()(_group)
    app.add_typer(dataset)
    return app


def _group() -> None:
    """Pictures with labels."""


def main() -> None:
    """The entry point."""
    if any(tuple(sys.argv[1 : 1 + len(words)]) == words for words in LIGHT):
        light_app()()
        return
    from executive.cli.main import main as all_commands

    all_commands()


if __name__ == "__main__":
    main()
