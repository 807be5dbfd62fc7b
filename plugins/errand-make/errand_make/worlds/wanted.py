"""Parts that `errand world add` adds, and its options."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Addition(StrEnum):
    """Parts that `errand world add` adds to a world."""

    TABLE = "table"
    DESK = "desk"
    SHELF = "shelf"
    OBJECT = "object"
    PERSON = "person"
    DOCK = "dock"
    ROOM = "room"
    PLACE = "place"


@dataclass(frozen=True)
class Wanted:
    """Options of an addition; without a pose, furniture and a dock find a place of their own."""

    what: Addition
    name: str
    room: str | None = None
    at: tuple[float, float, float] | None = None
    size: tuple[float, float, float] | None = None
    surface: str | None = None
    near: str | None = None
