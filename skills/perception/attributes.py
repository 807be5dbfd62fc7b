"""Whether an object that was seen is red, or big: colours of its own pixels, its size among those of its class."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from skills.perception.class_forms import class_forms
from skills.perception.colour_words import load_appearance
from skills.perception.detection_3d import Detection3D

_BIGGER: Final[Mapping[str, bool]] = MappingProxyType(
    {"big": True, "large": True, "huge": True, "small": False, "little": False, "tiny": False}
)


def known_attributes() -> frozenset[str]:
    """The attribute words that can be judged."""
    return frozenset(load_appearance().attributes) | frozenset(_BIGGER)


def shows(detected: Detection3D, attribute: str) -> bool:
    """Whether an attribute fits. Raises KeyError for an unknown word."""
    word = attribute.lower()
    if word in _BIGGER:
        return _is_big(detected) == _BIGGER[word]
    return len(detected.colours) > 0 and load_appearance().shows(detected.colours, word)


def _is_big(detected: Detection3D) -> bool:
    """Whether its longest side is beyond the middle of what is usual in its class."""
    low, high = class_forms()[detected.class_name].length_m
    return max(detected.size_m) > math.sqrt(low * high)
