"""Options that are numbers: each has a quantity, and its messages name the range."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import pytest
import typer
from typer.testing import CliRunner

from errand_train.commands.dataset import dataset
from executive.cli.entry import COMMANDS, app
from executive.cli.number_options import NumberReader
from skills.quantities import bounds


def functions(name: str) -> Iterator[Any]:
    """The functions of a command, or of all commands of a group."""
    entry = COMMANDS.get(name)
    found = dataset if entry is None else getattr(import_module(f"executive.cli.{entry.module}"), entry.attribute)
    if isinstance(found, typer.Typer):
        groups = [found, *(group.typer_instance for group in found.registered_groups)]
        yield from (each.callback for group in groups if group is not None for each in group.registered_commands)
    else:
        yield found


def numbers(function: Any) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """The options of a function that are numbers, with their marks."""
    for name, hint in get_type_hints(function, include_extras=True).items():
        plain = get_args(hint)[0] if get_origin(hint) is Annotated else hint
        options = get_args(plain) if get_origin(plain) in (Union, UnionType, list, tuple) else (plain,)
        if {int, float} & set(options):
            yield name, getattr(hint, "__metadata__", ())


@pytest.mark.parametrize("command", [*COMMANDS, "dataset"])
def test_every_number_of_the_command_line_has_a_quantity_with_a_range(command: str) -> None:
    for function in functions(command):
        for name, marks in numbers(function):
            readers = [mark.parser for mark in marks if isinstance(getattr(mark, "parser", None), NumberReader)]
            assert readers, f"{command}: {name} has no quantity"
            assert len(bounds(readers[0].hint)) == 2, f"{command}: {name} has no range"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "--seed", "-1"), "errand: --seed: should be from 0 to 2147483647; it reads -1 now"),
        (("run", "--seed", "9" * 5000), "errand: --seed: is a number of 5000 digits"),
        (("run", "--seed", "1.0"), "errand: --seed: should be a whole number; write 1"),
        (("run", "--time-limit", "soon"), "errand: --time-limit: should be a number, seconds, or as in"),
        (("run", "--friction", "0,5"), "errand: --friction: should be a number; write 0.5, with a point"),
        (("run", "--people", "three"), "errand: --people: should be a whole number; write 3"),
        (("evaluate", "--jobs", "0"), "errand: --jobs: should be from 1 to 100000; it reads 0 now"),
        (("detect", "x.png", "--threshold", "50"), "errand: --threshold: should be from 0 to 1; it reads 50 now"),
        (("run", "--say", "x", "--start", "5", "4.5", "90"), "--start 5 4.5 90: the heading should be from -6.283"),
        (("run", "--say", "x", "--start", "5", "4,5", "0"), "--start 5 4,5 0: y should be a number; write 4.5"),
        (("run", "--say", "x", "--start", "5", "4.5"), "--start 5 4.5: a pose has 3 numbers, not 2"),
        (("run", "--say", "x", "--time-of-day", "24:00"), "--time-of-day 24:00: should be a time of day from 00:00"),
    ],
)
def test_a_number_out_of_range_is_one_line_and_leaves_nothing(
    arguments: tuple[str, ...], says: str, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, arguments)
    (line,) = result.stderr.splitlines()
    assert (result.exit_code, says in line) == (2, True), line
    assert list(tmp_path.iterdir()) == []
