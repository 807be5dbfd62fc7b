"""Gives memory back to the system between missions of one process."""

from __future__ import annotations

import ctypes
import gc
from contextlib import suppress
from typing import Final

__all__ = ["return_memory"]

_LIBRARY: Final = ctypes.CDLL(None)


def return_memory() -> None:
    """Return what no mission needs any more to the system.

    The C library keeps what was freed, in pieces that the next mission hardly fits into; a worker would grow by some
    hundred megabytes with each mission. It does nothing where the C library has no `malloc_trim`.
    """
    gc.collect()
    with suppress(AttributeError):
        _LIBRARY.malloc_trim(0)
