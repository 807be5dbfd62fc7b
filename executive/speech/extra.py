"""The one place that imports the packages of the extra `speech`, which may be missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Final

from skills.files.errors import InputError

__all__ = ["speech_module"]

_HINT: Final = "install the extra that listens: pip install 'spot-errand[speech]'"


def speech_module(name: str) -> ModuleType:
    """The module of that name.

    Raises:
        InputError: the extra `speech` is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise InputError(f"speech needs {name.split('.')[0]}, which is not installed", hint=_HINT) from error
