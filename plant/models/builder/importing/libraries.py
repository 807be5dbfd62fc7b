"""Imports the packages of the extra `objects`, which may be missing; errors of importing meshes."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class ObjectImportError(Exception):
    """The file or what is wanted of it cannot be used; the message says why, `hint` what to do."""

    def __init__(self, message: str, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")


class ObjectsExtraMissingError(ImportError):
    """A library of the extra `objects` is not installed."""


def objects_module(name: str) -> Any:
    """The module of that name, imported when it is needed. Raises ObjectsExtraMissingError."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ObjectsExtraMissingError(f"importing objects needs {name}, which is not installed") from error
