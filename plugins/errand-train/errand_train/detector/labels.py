"""Labelled rendered pictures (COCO); the outline of each object gives its box after a rotation of the picture."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_train.detector.coco import CocoFile, CocoImage, CocoLabel, coco_file
from skills.perception.detector.boxes import Letterbox

Floats = NDArray[np.float32]
LEAST_SEEN: Final = 0.25
_MOST_CORNERS: Final = 24


class TrainingDataError(ValueError):
    """A data set cannot be trained on; the message says where and why, `hint` what to do."""

    def __init__(self, message: str, *, hint: str) -> None:
        self.message, self.hint = message, hint
        super().__init__(f"{message}; {hint}")


@dataclass(frozen=True)
class Labels:
    """Objects of one picture: convex outlines (K, 2) in pixels, class indices (N,), visibilities, and more.

    `seen` (N,) is the visible share of the whole object; `ignored` (N,) marks objects that are neither targets nor
    background.
    """

    outlines: tuple[Floats, ...]
    classes: NDArray[np.int64]
    seen: Floats
    ignored: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.outlines)


@dataclass(frozen=True)
class TrainingPicture:
    """File of a picture and its labels, in pixels of the letterbox."""

    file: Path
    labels: Labels


def category_names(folder: Path) -> tuple[str, ...]:
    """Names of the classes in the order of their ids. Raises TrainingDataError."""
    return tuple(one.name for one in sorted(_file(folder, "train").categories, key=lambda one: int(one.id)))


def read_split(folder: Path, split: str) -> tuple[TrainingPicture, ...]:
    """Reads all pictures of `train` or `val`. Raises TrainingDataError."""
    return tuple(_picture(folder, image, labels) for image, labels in _file(folder, split).by_picture())


def digest_of(folder: Path) -> str:
    """Short digest of the manifest and the training labels of a data set."""
    made = hashlib.sha256()
    for name in ("dataset.json", "train.json"):
        path = folder / name
        made.update(path.read_bytes() if path.is_file() else b"")
    return made.hexdigest()[:16]


def _file(folder: Path, split: str) -> CocoFile:
    path, hint = folder / f"{split}.json", "make one: errand dataset render --out DIR --images 8000"
    try:
        return coco_file(json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise TrainingDataError(f"{path}: there is no such data set ({error.strerror})", hint=hint) from error
    except (ValueError, RecursionError) as error:
        raise TrainingDataError(f"{path}: is damaged ({error})", hint=hint) from error


def _picture(folder: Path, image: CocoImage, labels: Sequence[CocoLabel]) -> TrainingPicture:
    file = folder / image.file_name
    if image.size_px is None:
        raise TrainingDataError(f"{file}: the data set does not tell its size", hint="render it again")
    scale = np.array(Letterbox(*image.size_px).scale_xy, dtype=np.float32)
    found = Labels(
        outlines=tuple(outline_of(label) * scale for label in labels),
        classes=np.array([int(label.category_id) - 1 for label in labels], dtype=np.int64),
        seen=np.array([1.0 if label.seen is None else label.seen for label in labels], dtype=np.float32),
        ignored=np.array([label.ignore for label in labels], dtype=bool),
    )
    return TrainingPicture(file, found)


def outline_of(label: CocoLabel) -> Floats:
    """Convex outline (K, 2) of a label's mask, or of its box where it has no mask of run lengths."""
    x, y, width, height = label.bbox
    corners = np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]], dtype=np.float32)
    lengths = label.segmentation
    if not isinstance(lengths, Mapping) or not isinstance(lengths.get("counts"), list):
        return corners
    points = _run_ends(lengths)
    hull = cv2.convexHull(points).reshape(-1, 2).astype(np.float32)
    return hull if len(hull) <= _MOST_CORNERS else _simplified(hull)


def _run_ends(lengths: Mapping[str, Any]) -> Floats:
    """Corners (N, 2) of the first and last pixel of every run in a column."""
    height = int(lengths["size"][0])
    edges = np.cumsum(np.asarray(lengths["counts"], dtype=np.int64))
    starts, ends = edges[0:-1:2], edges[1::2]
    starts = starts[: len(ends)]
    whole = (ends - 1) // height > starts // height
    tops = np.where(whole, 0, starts % height)
    bottoms = np.where(whole, height, (ends - 1) % height + 1)
    left, right = starts // height, (ends - 1) // height + 1
    pairs = [(left, tops), (left, bottoms), (right, tops), (right, bottoms)]
    return np.concatenate([np.stack(pair, axis=1) for pair in pairs]).astype(np.float32)


def _simplified(hull: Floats) -> Floats:
    """Every few corners of a hull, and always those on its box."""
    keep = set(np.linspace(0, len(hull) - 1, _MOST_CORNERS - 4).round().astype(int).tolist())
    keep |= {int(hull[:, axis].argmin()) for axis in (0, 1)} | {int(hull[:, axis].argmax()) for axis in (0, 1)}
    return np.asarray(hull[sorted(keep)], dtype=np.float32)
