"""The one place that imports the packages of the extra `objects`, which may be missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from plant.models.builder.importing.errors import ObjectsExtraMissingError


def objects_module(name: str) -> Any:
    """The module of that name, imported when it is needed. Raises ObjectsExtraMissingError."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ObjectsExtraMissingError(f"importing objects needs {name}, which is not installed") from error
