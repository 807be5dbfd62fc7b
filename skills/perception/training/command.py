"""How the small commands of this folder end."""

from __future__ import annotations

import sys
from collections.abc import Callable

from skills.perception.training.labels import TrainingDataError

__all__ = ["exit_code_of"]


def exit_code_of(work: Callable[[], object]) -> int:
    """0 when the work is done, 2 when it could not be, with one line on standard error that says why."""
    try:
        work()
    except (TrainingDataError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    return 0
