"""Errors of importing objects: unusable files and options, and missing libraries."""

from importlib import import_module
from typing import Any


class ObjectImportError(Exception):
    """Error of an unusable mesh file or option, with the reason as message and a `hint`."""

    def __init__(self, message: str, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")


class LibraryMissingError(ImportError):
    """A library of errand-make that is not installed."""


def library(name: str) -> Any:
    """Imports a slow library on demand. Raises LibraryMissingError when it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise LibraryMissingError(f"importing objects needs {name}, which is not installed") from error
