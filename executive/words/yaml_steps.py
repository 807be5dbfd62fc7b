"""Steps as lines of text and back: commands in their text form, other steps in YAML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from executive.words.command import parse_command
from executive.words.forms import Strict
from executive.words.leaf_steps import Do, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Steps
from skills.files.errors import InputError
from skills.files.yaml_source import parse_yaml, yaml_of


class _Document(Strict):
    """Document of steps alone."""

    steps: Steps


def steps_to_data(steps: Iterable[Step]) -> list[Any]:
    """Converts steps to the plain data of a mission file, without default values."""
    return [_short(step.model_dump(mode="json", by_alias=True, exclude_defaults=True)) for step in steps]


def steps_to_yaml(steps: Iterable[Step]) -> tuple[str, ...]:
    """Lines of a mission file's `steps`; none for no steps."""
    data = steps_to_data(steps)
    if not data:
        return ()
    text = yaml_of(data, width=1_000_000)
    return tuple(text.splitlines())


def lines_of_steps(steps: Sequence[Step]) -> tuple[str, ...]:
    """Lines that `steps_from_lines` reads: commands in their text form where all steps are commands, otherwise YAML.

    For the steps of a mission file, only the commands.
    """
    walked = [step for one in steps for step in one.walk()]
    if all(isinstance(step, Do) for step in walked) or any(step.source is not None for step in walked):
        return tuple(str(command) for step in walked for command in step.commands)
    return steps_to_yaml(steps)


def steps_from_lines(lines: Sequence[str]) -> Steps:
    """Parses commands in their text form, or steps in YAML. Raises ValueError for other lines."""
    try:
        return steps_of_commands(tuple(map(parse_command, lines)))
    except ValueError:
        return steps_from_yaml(lines)


def steps_from_yaml(lines: Sequence[str]) -> Steps:
    """Parses steps in YAML. Raises ValueError for other lines."""
    try:
        data = parse_yaml("\n".join(lines), Path("steps")).data
    except InputError as error:
        raise ValueError(error.message) from error
    return _Document.model_validate({"steps": data}, by_alias=True, by_name=False).steps


def _short(value: Any) -> Any:
    """Drops empty keys; an expression stands for itself, and a whole number of seconds has no point."""
    if isinstance(value, list):
        return [_short(each) for each in value]
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if not isinstance(value, dict):
        return value
    if value.keys() == {"expression"}:
        return value["expression"]
    short = {key: _short(each) for key, each in value.items() if each is not None and each != []}
    if "choices" in value:
        short["choices"] = {name: _short(steps) or None for name, steps in value["choices"].items()}
    return short
