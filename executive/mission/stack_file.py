"""Stack files: components of a robot and their options, read with file and line."""

from __future__ import annotations

from pathlib import Path

from skills.files.outside import is_file, is_there
from skills.files.yaml_source import read_yaml
from skills.stack import DEFAULT_FILE, RobotStack, StackError, default_stack, stack_of


def stack_file(given: Path) -> Path:
    """Path of a stack file: the given one, or the shipped file of that name."""
    own = DEFAULT_FILE.with_name(f"{given.name}_stack.yaml")
    return own if given == Path(given.name) and not is_there(given) and is_file(own) else given


def load_stack(path: Path | None) -> RobotStack:
    """Reads the stack of a file, or the default one. Raises InputError with file and line."""
    if path is None:
        return default_stack()
    source = read_yaml(path)
    try:
        return stack_of(source.data or {})
    except StackError as error:
        raise source.error(error.path, error.message, error.hint) from error
