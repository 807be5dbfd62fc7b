"""Whether an object that was seen is red, or big: colours of its own pixels, its size among those of its class."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, TypeAdapter

from skills.files.yaml_source import read_yaml
from skills.perception.class_forms import class_forms

if TYPE_CHECKING:
    from skills.perception.detection_3d import Detection3D

Colours = NDArray[np.uint8]
_LEAST_SHARE: Final = 0.3
_BIGGER: Final[Mapping[str, bool]] = {
    "big": True,
    "large": True,
    "huge": True,
    "small": False,
    "little": False,
    "tiny": False,
}


class ColourRange(BaseModel):
    """A range of hue (degrees, may wrap past 360), saturation and value (0 to 1)."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    hue_deg: tuple[float, float] = (0.0, 360.0)
    saturation: tuple[float, float] = (0.0, 1.0)
    value: tuple[float, float] = (0.0, 1.0)

    def share(self, colours: Colours) -> float:
        """Share of colours (N, 3) RGB in the range."""
        import cv2  # who only asks which words there are does without

        hsv = cv2.cvtColor(colours.reshape(1, -1, 3), cv2.COLOR_RGB2HSV_FULL)[0].astype(np.float64)
        hue, saturation, value = hsv[:, 0] * (360 / 255), hsv[:, 1] / 255, hsv[:, 2] / 255
        low, high = self.hue_deg
        in_hue = (hue >= low) & (hue <= high) if low <= high else (hue >= low) | (hue <= high)
        in_saturation = (saturation >= self.saturation[0]) & (saturation <= self.saturation[1])
        in_value = (value >= self.value[0]) & (value <= self.value[1])
        return float(np.mean(in_hue & in_saturation & in_value))


@lru_cache(maxsize=1)
def colour_words() -> Mapping[str, ColourRange]:
    """The colour words. Raises pydantic.ValidationError when the file beside this module is malformed."""
    words = read_yaml(Path(__file__).with_name("colour_words.yaml")).data["attributes"]
    return TypeAdapter(dict[str, ColourRange]).validate_python(words)


def known_attributes() -> frozenset[str]:
    """The attribute words that can be judged."""
    return frozenset(colour_words()) | frozenset(_BIGGER)


def shows(detected: Detection3D, attribute: str) -> bool:
    """Returns whether an attribute fits. Raises KeyError for an unknown word."""
    word = attribute.lower()
    if word in _BIGGER:
        return _is_big(detected) is _BIGGER[word]
    return len(detected.colours) > 0 and colour_words()[word].share(detected.colours) > _LEAST_SHARE


def _is_big(detected: Detection3D) -> bool | None:
    """Returns whether its longest side is beyond the middle of what is usual in its class; None for what has none."""
    form = class_forms().get(detected.class_name)
    return None if form is None else max(detected.size_m) > math.sqrt(form.length_m[0] * form.length_m[1])
