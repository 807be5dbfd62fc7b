"""Stack files: the components of a robot and their options, read with file and line."""

from __future__ import annotations

from pathlib import Path

from skills.files.outside import is_file, is_there
from skills.files.yaml_source import read_yaml
from skills.stack import DEFAULT_FILE, RobotStack, StackError, default_stack, stack_of


def stack_file(given: Path) -> Path:
    """A stack file as it was given, or the one of that name that comes with Errand."""
    own = DEFAULT_FILE.with_name(f"{given.name}_stack.yaml")
    return own if given == Path(given.name) and not is_there(given) and is_file(own) else given


def load_stack(path: Path | None) -> RobotStack:
    """The stack of a file, or the one that comes with Errand. Raises InputError with file and line."""
    if path is None:
        return default_stack()
    source = read_yaml(path)
    try:
        return stack_of(source.data or {})
    except StackError as error:
        raise source.error(error.path, error.message, error.hint) from error
