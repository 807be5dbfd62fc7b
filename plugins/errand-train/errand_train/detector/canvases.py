"""Training canvases: windows on pictures at about the scale of the detector, or mosaics of four.

Windows about objects rather than whole pictures, after Singh et al., "SNIPER" (2018): most of a picture of a room holds
nothing to be found, and training on windows costs a quarter of the time. Four in one after Bochkovskiy et al.,
"YOLOv4" (2020).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from errand_train.detector.labels import Labels, TrainingPicture
from errand_train.detector.photometry import change_photometry
from errand_train.detector.placing import Cell, Targets, join_targets, place_labels, similarity_map
from errand_train.detector.store import PictureStore
from skills.perception.detector.boxes import HEIGHT_PX, PADDING, WIDTH_PX

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]
_FITS: Final = 0.9
_RIGHT_ANGLE: Final = np.pi / 2


@dataclass(frozen=True)
class CanvasOptions:
    """Size of a canvas in pixels, and options of its content.

    `mosaic` is the share of mosaics of four pictures, `focused` the share of windows about an object where there is
    one. Scales are drawn log-uniformly. `changed` is the share of canvases with changed light and colours. `whole` uses
    whole pictures, rotated and scaled only a little.
    """

    width_px: int = 320
    height_px: int = 256
    mosaic: float = 0.5
    focused: float = 0.8
    scales: tuple[float, float] = (0.5, 1.5)
    changed: float = 1.0
    whole: bool = False


@dataclass(frozen=True)
class Canvas:
    """A picture (H, W, 3) and its targets."""

    picture: Picture
    targets: Targets


@dataclass(frozen=True)
class CanvasMaker:
    """Maker of canvases from stored pictures. Equal random sources give equal canvases."""

    pictures: Sequence[TrainingPicture]
    store: PictureStore

    def make(self, index: int, options: CanvasOptions, random: np.random.Generator) -> Canvas:
        """Makes a canvas of the picture `index`, perhaps beside three others."""
        canvas = np.full((options.height_px, options.width_px, 3), PADDING, dtype=np.uint8)
        several = random.random() < options.mosaic
        cells = _four(options, random) if several else [Cell(0, 0, options.width_px, options.height_px)]
        others = random.integers(0, len(self.pictures), len(cells) - 1).tolist()
        parts = [self._fill(canvas, cell, k, options, random) for cell, k in zip(cells, [index, *others], strict=True)]
        if random.random() < options.changed:
            canvas = change_photometry(canvas, random)
        return Canvas(canvas, join_targets(parts))

    def _fill(
        self, canvas: Picture, cell: Cell, index: int, options: CanvasOptions, random: np.random.Generator
    ) -> Targets:
        """Draws one picture into a cell; its labels there."""
        labels = self.pictures[index].labels
        choose = _whole if options.whole else _window
        affine = choose(labels, cell, options, random)
        _warp(self.store, index, affine, canvas, cell)
        return place_labels(labels, affine, cell)


def _four(options: CanvasOptions, random: np.random.Generator) -> list[Cell]:
    """Four cells that meet at a random point near the middle."""
    width, height = options.width_px, options.height_px
    x, y = int(width * random.uniform(0.35, 0.65)), int(height * random.uniform(0.35, 0.65))
    return [Cell(0, 0, x, y), Cell(x, 0, width, y), Cell(0, y, x, height), Cell(x, y, width, height)]


def _window(labels: Labels, cell: Cell, options: CanvasOptions, random: np.random.Generator) -> Floats:
    """A window about an object, or anywhere, at a random scale at which the object mostly fits."""
    scale = float(np.exp(random.uniform(*np.log(options.scales))))
    item = _chosen(labels, options, random)
    if item is None:
        focus = _somewhere(random)
    else:
        low, high = item.min(axis=0), item.max(axis=0)
        focus = (low + high) / 2
        if random.random() < 0.8:
            fitting = _FITS * min(cell.size) / float(max(high - low))
            scale = min(scale, fitting * random.uniform(0.5, 1.0))
    reach = np.array(cell.size) * 0.3
    to = (cell.middle + random.uniform(-reach, reach)).astype(np.float32)
    flipped = bool(random.random() < 0.5)
    return similarity_map(focus, to, angle_rad=_turn(random), scale=scale, flipped=flipped)


def _somewhere(random: np.random.Generator) -> Floats:
    """A point of a picture, not quite at its edges."""
    size = np.array([WIDTH_PX, HEIGHT_PX])
    return (size * random.uniform(0.2, 0.8, 2)).astype(np.float32)


def _chosen(labels: Labels, options: CanvasOptions, random: np.random.Generator) -> Floats | None:
    """The outline of some object that counts."""
    counting = np.flatnonzero(~labels.ignored)
    if not len(counting) or random.random() >= options.focused:
        return None
    return labels.outlines[int(random.choice(counting))]


def _turn(random: np.random.Generator) -> float:
    """An angle: mostly about upright, sometimes by a right angle or two, as the body's cameras sit, or any."""
    kind = random.random()
    if kind < 0.05:
        return float(random.uniform(-np.pi, np.pi))
    quarter = 0.0 if kind < 0.85 else float(random.integers(1, 4)) * _RIGHT_ANGLE
    return quarter + float(random.normal(0.0, 0.15))


def _whole(_labels: Labels, cell: Cell, options: CanvasOptions, random: np.random.Generator) -> Floats:
    """The whole picture at about the size of the cell, hardly turned."""
    focus = np.array([WIDTH_PX / 2, HEIGHT_PX / 2], dtype=np.float32)
    fit = min(cell.size[0] / WIDTH_PX, cell.size[1] / HEIGHT_PX)
    scale = fit * float(np.exp(random.uniform(*np.log(options.scales))))
    reach = np.array(cell.size) * 0.1
    upright = random.random() < 0.8
    angle = float(random.normal(0.0, 0.05)) + (0.0 if upright else float(random.integers(0, 4)) * _RIGHT_ANGLE)
    flipped = bool(random.random() < 0.5)
    to = (cell.middle + random.uniform(-reach, reach)).astype(np.float32)
    return similarity_map(focus, to, angle_rad=angle, scale=scale, flipped=flipped)


def _warp(store: PictureStore, index: int, affine: Floats, canvas: Picture, cell: Cell) -> None:
    """Draws a stored picture into a cell of the canvas under an affine map of pixel edges."""
    local = affine.astype(np.float64)
    local[:, 2] -= (cell.x0, cell.y0)
    canvas[cell.y0 : cell.y1, cell.x0 : cell.x1] = store.scales(index).warp(local, cell.size)
