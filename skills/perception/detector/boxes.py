"""Boxes of the detector: the letterbox, crops from it, and non-maximum suppression to one detection per object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection
from skills.robot import Picture

WIDTH_PX: Final = 640
"""Width of the picture that the proposal network gets."""
HEIGHT_PX: Final = 480
"""Height of that picture."""
PADDING: Final = 114
"""Grey of what lies beyond a picture."""
_HALF_BELOW: Final = 0.7
"""Scale of a crop below which it is sampled from the halved picture, against aliasing."""

Boxes = NDArray[np.float32]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Letterbox:
    """Placement of a picture of width_px x height_px in the letterbox: from the upper left corner, scaled by scale_xy.

    Both scales differ only by the rounding to whole pixels. Boxes are (N, 4) rows of (u0, v0, u1, v1): edges in pixels,
    so that a whole picture is (0, 0, width, height).
    """

    width_px: int
    height_px: int

    @property
    def inside_px(self) -> tuple[int, int]:
        """Width and height of the region with the picture; the rest, at right or bottom, is padding."""
        scale = min(WIDTH_PX / self.width_px, HEIGHT_PX / self.height_px)
        return max(1, round(self.width_px * scale)), max(1, round(self.height_px * scale))

    @property
    def scale_xy(self) -> tuple[float, float]:
        """Letterbox pixels per pixel of the picture, across and down."""
        width, height = self.inside_px
        return width / self.width_px, height / self.height_px

    def to_picture(self, boxes: NDArray[np.floating]) -> Boxes:
        """Converts boxes from the letterbox to the picture's pixels, clipped to the picture."""
        found = np.asarray(boxes, dtype=np.float32).reshape(-1, 4) / np.array(self.scale_xy * 2, dtype=np.float32)
        limits = np.array([self.width_px, self.height_px] * 2, dtype=np.float32)
        return np.asarray(np.clip(found, 0.0, limits), dtype=np.float32)


def letterbox(picture: Picture) -> tuple[Picture, Letterbox]:
    """Scales a picture (H, W, 3) RGB or (H, W) grey, keeping its aspect ratio, and pads it to (480, 640, 3) RGB.

    Raises ValueError when the array is no such picture.
    """
    filled = np.empty((HEIGHT_PX, WIDTH_PX, 3), dtype=np.uint8)
    return filled, fill_letterbox(picture, filled)


def fill_letterbox(picture: Picture, into: Picture) -> Letterbox:
    """Writes a picture's letterbox `into` an array (480, 640, 3), such as one of a batch. Raises ValueError."""
    check_picture(picture)
    placed = Letterbox(width_px=picture.shape[1], height_px=picture.shape[0])
    width, height = placed.inside_px
    into[height:] = PADDING
    into[:height, width:] = PADDING
    resized = _resized(picture, width, height)
    into[:height, :width] = resized if resized.ndim == 3 else cv2.cvtColor(resized, cv2.COLOR_GRAY2RGB)
    return placed


def check_picture(picture: Picture) -> None:
    """Raises ValueError unless a picture is a non-empty array of uint8, (H, W, 3) or (H, W)."""
    if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8:
        raise ValueError(f"a picture is an array of uint8, not {getattr(picture, 'dtype', type(picture).__name__)}")
    if picture.ndim not in (2, 3) or (picture.ndim == 3 and picture.shape[2] != 3) or not picture.size:
        raise ValueError(f"a picture is (H, W, 3) or (H, W), not {picture.shape}")


def _resized(picture: Picture, width: int, height: int) -> Picture:
    """Averages pixels when scaling down, and interpolates when scaling up."""
    rows, columns = picture.shape[:2]
    if (columns, rows) == (width, height):
        return picture
    smaller = width < columns or height < rows
    scaled = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
    return np.asarray(scaled, dtype=np.uint8)


@dataclass(frozen=True)
class Scales:
    """A picture `full` (H, W, 3) and its `half`, from which small crops are sampled."""

    full: Picture
    half: Picture

    def warp(self, affine: NDArray[np.floating], size_px: tuple[int, int]) -> Picture:
        """Warps the picture by an affine map (2, 3) between pixel edges into (width, height), with padding."""
        picture, to_crop = self.full, affine.astype(np.float64)
        if np.sqrt(abs(np.linalg.det(to_crop[:, :2]))) < _HALF_BELOW:
            picture, to_crop = self.half, to_crop @ np.diag([2.0, 2.0, 1.0])
        return warp(picture, to_crop, size_px)


def warp(picture: Picture, affine: NDArray[np.floating], size_px: tuple[int, int]) -> Picture:
    """Warps a picture by an affine map (2, 3) between pixel edges into (width, height), with padding."""
    to_crop = affine.astype(np.float64)
    to_crop[:, 2] += to_crop[:, :2] @ (0.5, 0.5) - 0.5
    grey = (PADDING, PADDING, PADDING)
    crop = cv2.warpAffine(picture, to_crop, size_px, flags=cv2.INTER_LINEAR, borderValue=grey)
    return np.asarray(crop, dtype=np.uint8)


def halve(picture: Picture) -> Picture:
    """Scales a picture (H, W, 3) with even sides to half its size."""
    half = cv2.resize(picture, (picture.shape[1] // 2, picture.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half, dtype=np.uint8)


@dataclass(frozen=True)
class SuppressionOptions:
    """Overlaps (intersection over union) at which boxes are one object, and limits on their number.

    `same_class`: boxes of one class that overlap by more are one object. `other_class` and `sure_score`: boxes of two
    classes that overlap by more are one object when the better one has this score. `alternative`: boxes of other
    classes that overlap a detection by more are its alternatives. `most_candidates` and `most_kept`: how many boxes of
    a picture are considered, and how many of them become detections.
    """

    same_class: float = 0.45
    other_class: float = 0.6
    sure_score: float = 0.5
    alternative: float = 0.55
    most_candidates: int = 1000
    most_kept: int = 300


@dataclass(frozen=True)
class Candidates:
    """Boxes (N, 4) of (u0, v0, u1, v1), their scores (N,) and the indices (N,) of their classes, best first."""

    boxes: Floats
    scores: Floats
    classes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.scores)

    def at(self, rows: NDArray[np.int64]) -> Candidates:
        """Candidates at these rows."""
        return Candidates(self.boxes[rows], self.scores[rows], self.classes[rows])

    def from_score(self, threshold: float) -> Candidates:
        """Candidates with at least the threshold as score."""
        return self.at(np.flatnonzero(self.scores >= threshold))


def select_candidates(boxes: Floats, scores: Floats, threshold: float, most: int) -> Candidates:
    """Selects the `most` best pairs of box (A, 4) and class whose scores (A, K) reach the threshold.

    Omits boxes that are not finite or have no area. Equal scores keep their order.
    """
    rows, classes = np.nonzero(scores >= threshold)
    sound = are_sound(boxes[rows])
    rows, classes = rows[sound], classes[sound]
    values = scores[rows, classes]
    order = np.argsort(-values, kind="stable")[:most]
    return Candidates(boxes[rows[order]], values[order], classes[order].astype(np.int64))


def are_sound(boxes: Floats) -> NDArray[np.bool_]:
    """Mask of the boxes (N, 4) that are finite and have an area."""
    return np.asarray(np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] > boxes[:, :2]).all(axis=1))


def suppress(candidates: Candidates, options: SuppressionOptions) -> Candidates:
    """Removes the candidates that a better one represents: greedy non-maximum suppression."""
    shared = overlaps(candidates.boxes, candidates.boxes)
    same = candidates.classes[:, None] == candidates.classes[None, :]
    sure = (candidates.scores >= options.sure_score)[:, None]
    replaced = np.where(same, shared > options.same_class, sure & (shared > options.other_class))
    return candidates.at(_greedy_rows(replaced)[: options.most_kept])


def select_distinct(boxes: Floats, overlap: float) -> NDArray[np.int64]:
    """Selects the rows of boxes (N, 4), best first, that overlap no better selected one by more than `overlap`."""
    return _greedy_rows(overlaps(boxes, boxes) > overlap)


def _greedy_rows(replaced: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows kept when each kept row removes the later ones that it replaces (N, N)."""
    alive = np.ones(len(replaced), dtype=bool)
    for k in range(len(replaced)):
        if alive[k]:
            alive[k + 1 :] &= ~replaced[k, k + 1 :]
    return np.flatnonzero(alive)


def detections_from(
    candidates: Candidates, class_names: Sequence[str], threshold: float, options: SuppressionOptions
) -> tuple[Detection, ...]:
    """Detections in a picture: candidates from the threshold on after suppression, with their alternatives."""
    candidates = candidates.at(np.flatnonzero((candidates.boxes[:, 2:] > candidates.boxes[:, :2]).all(axis=1)))
    selected = suppress(candidates.from_score(threshold), options)
    others = alternative_scores(selected, candidates, options)
    rows = zip(selected.classes.tolist(), selected.scores.tolist(), selected.boxes.tolist(), others, strict=True)
    return tuple(
        Detection(class_names[which], score, (u0, v0, u1, v1), tuple((class_names[k], s) for k, s in other.items()))
        for which, score, (u0, v0, u1, v1), other in rows
    )


def alternative_scores(
    selected: Candidates, candidates: Candidates, options: SuppressionOptions
) -> list[dict[int, float]]:
    """For each selected candidate, the best score of each other class on the same object."""
    alike = overlaps(selected.boxes, candidates.boxes) > options.alternative
    alike &= selected.classes[:, None] != candidates.classes[None, :]
    alternatives: list[dict[int, float]] = [{} for _ in range(len(selected))]
    for row, column in np.argwhere(alike).tolist():
        alternatives[row].setdefault(int(candidates.classes[column]), float(candidates.scores[column]))
    return alternatives


def overlaps(first: Floats, second: Floats) -> Floats:
    """Intersection over union (N, M) of boxes (N, 4) with boxes (M, 4)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    areas, others = ((boxes[:, 2:] - boxes[:, :2]).prod(axis=1) for boxes in (first, second))
    return np.asarray(shared / (areas[:, None] + others[None, :] - shared), dtype=np.float32)
