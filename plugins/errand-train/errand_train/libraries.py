"""Libraries that only training needs; the extra `torch` brings them."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

from skills.inputs.errors import InputError

__all__ = ["check_libraries"]


def check_libraries(needed: Sequence[str], work: str = "training") -> None:
    """Raises InputError for libraries that are not installed; `work` says what needs them."""
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(
            f"{work} needs {' and '.join(missing)}",
            hint="pip install 'errand-train[torch]'; in a clone of Errand: make train",
        )
