"""Seeds from text: "1-20", "3" or "1,4,7-9"."""

from __future__ import annotations

from skills.files.errors import InputError

__all__ = ["first_seeds", "seed_range"]


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


def first_seeds(text: str, count: int) -> tuple[int, ...]:
    """The first `count` seeds from text whose last range may have no end: "8001-" or "3,8001-".

    Raises:
        InputError: it is no range of seeds, or holds fewer.
    """
    before, _, last = text.rpartition(",")
    begun, dash, end = last.partition("-")
    if dash and not end.strip():
        listed = seed_range(before) if before else ()
        seeds = (*listed, *range(first := seed_range(begun)[0], first + count))
    else:
        seeds = seed_range(text)
    if len(seeds) < count:
        raise InputError(
            f"'{text}' holds {len(seeds)} seeds, fewer than {count}", hint="leave its end open, as in 8001-"
        )
    return seeds[:count]


def _span(part: str) -> range:
    first, dash, last = part.partition("-")
    return range(int(first), int(last if dash else first) + 1)
