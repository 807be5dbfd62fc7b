"""The numbers of the object classes, as detectors and messages use them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

__all__ = ["CLASS_IDS", "NOTHING_ID"]

NOTHING_ID: Final = 0

CLASS_IDS: Final[Mapping[str, int]] = MappingProxyType(
    {
        "beer": 1,
        "coke": 2,
        "extinguisher": 3,
        "hammer": 4,
        "screwdriver": 5,
        "wrench": 6,
        "person": 7,
        "cylinder": 8,
        "cube": 9,
    }
)
