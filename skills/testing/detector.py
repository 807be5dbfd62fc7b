"""A detector for the plain pictures of the scripted robot: each class has one colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection
from skills.testing.blocks import TABLE_CAN, Colour

_FEWEST_PIXELS = 6


@dataclass(frozen=True)
class PlainColours:
    """Detects an object of a class in every patch of exactly the class's colour; by default red cans are cokes."""

    colours: Mapping[str, Colour] = field(default_factory=lambda: MappingProxyType({"coke": TABLE_CAN.colour}))
    score: float = 0.9

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that have a colour."""
        return tuple(self.colours)

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """The patches in each picture, the largest first; grey pictures show none. Raises ValueError for no picture."""
        return [self._found(picture) for picture in pictures]

    def _found(self, picture: NDArray[np.uint8]) -> tuple[Detection, ...]:
        if picture.ndim not in (2, 3) or picture.dtype != np.uint8:
            raise ValueError(f"no picture: {picture.dtype} of shape {picture.shape}")
        if picture.ndim == 2:
            return ()
        found = [each for name, colour in self.colours.items() for each in self._patches(picture, name, colour)]
        return tuple(detection for _, detection in sorted(found, key=lambda entry: -entry[0]))

    def _patches(self, picture: NDArray[np.uint8], name: str, colour: Colour) -> list[tuple[int, Detection]]:
        mask = np.all(picture == np.array(colour, dtype=np.uint8), axis=2).astype(np.uint8)
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        rows = ((int(area), (float(x), float(y), float(x + w), float(y + h))) for x, y, w, h, area in stats[1:])
        return [(area, Detection(name, self.score, box)) for area, box in rows if area >= _FEWEST_PIXELS]
