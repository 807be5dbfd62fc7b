"""Orders of objects by size or weight: biggest, smallest, thinnest, heaviest, lightest."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from skills.relations import EQUAL_SIZE_M

_THIN_M: Final = 0.005
_HEAVY_KG: Final = 0.01
"""Differences up to which two objects are equally thin, or heavy."""


@dataclass(frozen=True)
class Order:
    """Order by the longest side, the shortest side (m) or the weight (kg); with `descends`, the greatest come first.

    Values that differ by less than `equal` are equal.
    """

    by: str
    descends: bool
    equal: float

    @property
    def weighs(self) -> bool:
        """Returns whether it orders by weight."""
        return self.by == "weight"

    def key(self, sides_m: tuple[float, float, float], mass_kg: float) -> float:
        """Value by which it sorts, the first least."""
        value = {"longest side": max(sides_m), "shortest side": min(sides_m), "weight": mass_kg}[self.by]
        return -value if self.descends else value


ORDERS: Final[Mapping[str, Order]] = MappingProxyType(
    {
        **dict.fromkeys(("biggest", "largest"), Order("longest side", True, EQUAL_SIZE_M)),
        "smallest": Order("longest side", False, EQUAL_SIZE_M),
        "thinnest": Order("shortest side", False, _THIN_M),
        "heaviest": Order("weight", True, _HEAVY_KG),
        "lightest": Order("weight", False, _HEAVY_KG),
    }
)
"""Orders by their superlatives."""


def order_of(words: tuple[str, ...]) -> str:
    """Superlative among the attributes of an object; empty when there is none."""
    return next((word for word in words if word in ORDERS), "")
