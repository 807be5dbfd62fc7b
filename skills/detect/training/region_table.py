"""What a network takes for things in the pictures that are learnt from, and what is really there."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.detect.detector_file import DetectorModel
from skills.detect.regions import RegionOptions, Regions, regions_of
from skills.detect.scales import Scales
from skills.detect.scoring_matching import overlaps
from skills.detect.training.labels import Labels
from skills.detect.training.looks import seen_by_first, seen_by_second
from skills.detect.training.surroundings import SurroundingsWriter

__all__ = ["NEAR", "Look", "RegionTable", "first_look", "second_look", "table_of"]

NEAR: Final = 0.3
_WITHIN_IGNORED: Final = 0.6
_LOOKED_AT: Final = RegionOptions(least_score=0.01, most=20)
_SEEN: Final = RegionOptions(least_score=0.015, same=0.9, most=20)

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class RegionTable:
    """R regions: picture's number (R,), box (R, 4) in the letterbox, logits (R, K), and the thing there.

    `classes` (R,) are those of the things with which regions share NEAR or more, or -1; `wanted` (R, 4) are the things'
    boxes, and the region's own where there is no thing.
    """

    pictures: NDArray[np.int64]
    boxes: Floats
    logits: Floats
    wanted: Floats
    classes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pictures)

    def save(self, file: Path) -> None:
        """Write it; whole or not at all."""
        fresh = file.with_name(f".{file.name}.new.npz")
        np.savez(fresh, **vars(self))
        fresh.replace(file)

    @staticmethod
    def read(file: Path) -> RegionTable:
        """Read what was written."""
        with np.load(file) as kept:
            return RegionTable(**{name: kept[name] for name in RegionTable.__dataclass_fields__})


Look = Callable[[Scales], Regions]
"""Where a network sees something in a picture in the letterbox, and what."""


def first_look(model: DetectorModel, scales: Scales) -> Regions:
    """The places that the first network finds."""
    return regions_of(*seen_by_first(model, scales), _LOOKED_AT)


def second_look(model: DetectorModel, scales: Scales) -> Regions:
    """What the second network makes of them. Raises ValueError where there is none."""
    return regions_of(*seen_by_second(model, scales), _SEEN)


def table_of(look: Look, pictures: Iterable[tuple[Scales, Labels]], kept: SurroundingsWriter) -> RegionTable:
    """The regions of all pictures, of which what is about them is kept. Those on what is to be ignored are left out."""
    tables: list[RegionTable] = []
    for number, (scales, labels) in enumerate(pictures):
        tables.append(_rows(look(scales), number, labels))
        kept.add(scales, tables[-1].boxes)
    names = RegionTable.__dataclass_fields__
    return RegionTable(**{name: np.concatenate([vars(table)[name] for table in tables]) for name in names})


def _rows(regions: Regions, number: int, labels: Labels) -> RegionTable:
    """The regions of one picture."""
    things = label_boxes(labels)
    boxes, none, all_of_them = regions.boxes.astype(np.float64), np.zeros(len(labels), bool), np.ones(len(labels), bool)
    shared, inside = (overlaps(boxes, things.astype(np.float64), crowd) for crowd in (none, all_of_them))
    left_out = ((shared >= NEAR) | (inside >= _WITHIN_IGNORED)) & labels.ignored[None, :]
    counting = np.where(labels.ignored[None, :], 0.0, shared)
    best = counting.max(axis=1, initial=0.0)
    near = best >= NEAR
    kept = near | ~left_out.any(axis=1)
    wanted, classes = regions.boxes.copy(), np.full(len(regions), -1)
    if near.any():
        chosen = counting.argmax(axis=1)[near]
        wanted[near], classes[near] = things[chosen], labels.classes[chosen]
    return RegionTable(
        np.full(int(kept.sum()), number), regions.boxes[kept], regions.logits[kept], wanted[kept], classes[kept]
    )


def label_boxes(labels: Labels) -> Floats:
    """The boxes (N, 4) of labels' outlines."""
    boxes = [np.concatenate([outline.min(axis=0), outline.max(axis=0)]) for outline in labels.outlines]
    return np.array(boxes, dtype=np.float32).reshape(-1, 4)
