"""Options that are numbers: each has a quantity, and its messages name the range."""

from collections.abc import Iterator
from importlib import import_module
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import pytest
import typer

from errand_train.commands.dataset import dataset
from executive.cli.entry import COMMANDS
from executive.cli.number_options import NumberReader
from skills.quantities import bounds
from tests.executive.cli.calls import refusal


def functions(name: str) -> Iterator[Any]:
    """The functions of a command, or of all commands of a group."""
    entry = COMMANDS.get(name)
    own = name.replace("-", "_")
    found = dataset if entry is None else getattr(import_module(f"executive.cli.{entry.module}"), own)
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


def test_a_number_of_thousands_of_digits_is_refused_in_one_line():
    assert "errand: --seed: is a number of 5000 digits" in refusal("run", "--seed", "9" * 5000)
