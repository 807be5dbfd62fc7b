"""Errors of importing objects: files and options that cannot be used, and libraries that are missing."""

from importlib import import_module
from typing import Any


class ObjectImportError(Exception):
    """A mesh file or an option that cannot be used; the message says why, `hint` what to do."""

    def __init__(self, message: str, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")


class LibraryMissingError(ImportError):
    """A library of errand-make that is not installed."""


def library(name: str) -> Any:
    """Imports a library that takes long to import. Raises LibraryMissingError when it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise LibraryMissingError(f"importing objects needs {name}, which is not installed") from error
