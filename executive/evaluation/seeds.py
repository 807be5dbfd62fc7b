"""Seeds from text: "1-20", "3" or "1,4,7-9"."""

from __future__ import annotations

from skills.files.errors import InputError

__all__ = ["seed_range"]


def seed_range(text: str) -> tuple[int, ...]:
    """Seeds from "1-20", "3" or "1,4,7-9".

    Raises:
        InputError: anything else.
    """
    try:
        seeds = tuple(seed for part in text.split(",") for seed in _span(part))
    except ValueError as error:
        raise InputError(f"'{text}' is no range of seeds", hint="write it like 1-20 or 1,4,7") from error
    if not seeds:
        raise InputError(f"'{text}' holds no seed", hint="write it like 1-20")
    return seeds


def _span(part: str) -> range:
    first, dash, last = part.partition("-")
    return range(int(first), int(last if dash else first) + 1)
