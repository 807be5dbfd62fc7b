"""Where a network errs on the pictures that it learns from, so that it can look there more often.

After Shrivastava et al., "Training region-based object detectors with online hard example mining" (2016), and the
windows about false detections of Singh et al., "SNIPER" (2018).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.detect.onnx_detector import OnnxDetector
from skills.detect.scoring_matching import overlaps
from skills.detect.training.labels import Labels, LearningPicture
from skills.detect.training.store import PictureStore
from skills.detection import Detection

__all__ = ["HardPlace", "errors_in", "hard_places", "read_places", "write_places"]

Floats = NDArray[np.float64]
LEAST_BELIEVED: Final = 0.25
SURE: Final = 0.5
_ON_IT: Final = 0.5
_AT_ONCE: Final = 16


@dataclass(frozen=True)
class HardPlace:
    """A place in the picture of a number: its box as x0 y0 x1 y1 in pixels of the letterbox."""

    picture: int
    box: tuple[float, float, float, float]


def hard_places(
    detector: OnnxDetector, pictures: Sequence[LearningPicture], store: PictureStore
) -> tuple[HardPlace, ...]:
    """Where the detector misses a thing in the stored pictures, is unsure of it, or sees one where there is none."""
    places: list[HardPlace] = []
    for first in range(0, len(pictures), _AT_ONCE):
        several = range(first, min(first + _AT_ONCE, len(pictures)))
        found = detector.detect([store.full[k] for k in several])
        for k, seen in zip(several, found, strict=True):
            boxes = errors_in(pictures[k].labels, seen, detector.class_names)
            places += [HardPlace(k, (x0, y0, x1, y1)) for x0, y0, x1, y1 in boxes.tolist()]
    return tuple(places)


def errors_in(labels: Labels, found: Sequence[Detection], class_names: Sequence[str]) -> Floats:
    """Boxes (N, 4) of things that are not surely found, and of what is taken for a thing and is none."""
    things = np.array([np.concatenate([one.min(axis=0), one.max(axis=0)]) for one in labels.outlines]).reshape(-1, 4)
    boxes = np.array([one.box for one in found], dtype=np.float64).reshape(-1, 4)
    classes = np.array([class_names.index(one.class_name) for one in found], dtype=np.int64)
    scores = np.array([one.score for one in found], dtype=np.float64)
    shared = overlaps(boxes, things, np.zeros(len(things), dtype=bool))
    right = (shared >= _ON_IT) & (classes[:, None] == labels.classes[None, :])
    missed = ~labels.ignored & ~(right & (scores >= SURE)[:, None]).any(axis=0)
    excused = right | (overlaps(boxes, things, labels.ignored) >= _ON_IT) & labels.ignored[None, :]
    false = (scores >= LEAST_BELIEVED) & ~excused.any(axis=1)
    return np.concatenate([things[missed], boxes[false]])


def write_places(file: Path, places: Sequence[HardPlace]) -> None:
    """Write places so that `read_places` gives them back."""
    file.write_text(json.dumps([[place.picture, *place.box] for place in places]), encoding="utf-8")


def read_places(file: Path) -> tuple[HardPlace, ...]:
    """The places of a file; none where there is no such file."""
    if not file.is_file():
        return ()
    entries = json.loads(file.read_text(encoding="utf-8"))
    return tuple(HardPlace(int(picture), (x0, y0, x1, y1)) for picture, x0, y0, x1, y1 in entries)
