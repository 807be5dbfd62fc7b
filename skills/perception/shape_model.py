"""Likelihood of each class given the shape of an object in a depth picture.

The features are metric: sizes, the silhouette's width at several heights, and width and height along the outline seen
from above. A neck narrower than the body means a bottle, a wide end a hammer. A network with one hidden layer, trained
on rendered clusters (`errand_train.detector.shape`), gives the probabilities of the classes; divided by their shares in
the training data they are likelihoods up to a factor. Classes share shapes: a shape alone seldom tells the class.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from skills.perception.fitting import SeenShape
from skills.robot import FloatArray

MODEL_FILE: Final = Path(__file__).with_name("detector") / "model" / "shapes.npz"
LEAST_LIKELIHOOD: Final = 0.02
"""Least probability that a shape leaves to a class."""
_LEVELS: Final = 10
"""Number of heights at which the silhouette's width is measured."""
_PARTS: Final = 8
"""Number of parts of the outline along its length."""
_FEWEST: Final = 5
"""Points that a level or part needs."""
_LEAST_M: Final = 0.005


def shape_features(p_W: FloatArray, above_m: FloatArray, shape: SeenShape, p_WC: FloatArray) -> FloatArray:
    """Features (33,) of an object by its points (N, 3), their heights (N,) above its surface, and its outline.

    The camera at p_WC (3,) has seen it. Logarithms of height, length, width (m), widest silhouette (m) and distance
    (m); roundness; elevation of the camera (rad); then, relative to the largest: width of the silhouette at ten
    heights, width and height of eight parts along the outline, its wider half first.
    """
    height_m = max(float(np.percentile(above_m, 99)), _LEAST_M)
    view = np.median(p_W[:, :2], axis=0) - p_WC[:2]
    off_m = max(float(np.linalg.norm(view)), 1e-6)
    across = p_W[:, :2] @ np.array([-view[1], view[0]]) / off_m
    levels = _spans(above_m / height_m, across, _LEVELS)
    offset = p_W[:, :2] - np.array(shape.centre)
    c, s = math.cos(shape.yaw_rad), math.sin(shape.yaw_rad)
    along = offset @ np.array([c, s])
    low, high = np.percentile(along, [1, 99])
    along = (along - low) / max(float(high - low), _LEAST_M)
    widths = _spans(along, offset @ np.array([-s, c]), _PARTS)
    tops = _tops(along, above_m, _PARTS)
    if widths[: _PARTS // 2].sum() < widths[_PARTS // 2 :].sum():
        widths, tops = widths[::-1], tops[::-1]
    widest_m = max(float(levels.max()), _LEAST_M)
    sizes = [height_m, max(shape.length_m, _LEAST_M), max(shape.width_m, _LEAST_M), widest_m, off_m]
    tilt_rad = math.atan2(p_WC[2] - float(np.median(p_W[:, 2] - above_m)), off_m)
    relative = (levels / widest_m, widths / max(float(widths.max()), _LEAST_M), tops / max(float(tops.max()), _LEAST_M))
    return np.concatenate([np.log(sizes), [float(shape.round), tilt_rad], *relative])


def _spans(at: FloatArray, values: FloatArray, count: int) -> FloatArray:
    """Extent of the values (N,) in each of `count` equal parts of 0 to 1, interpolated where points are few."""
    part = np.clip((at * count).astype(int), 0, count - 1)
    groups = [values[part == k] for k in range(count)]
    known = [k for k, group in enumerate(groups) if len(group) >= _FEWEST]
    if not known:
        return np.zeros(count)
    spans = [float(np.ptp(np.percentile(groups[k], [3, 97]))) for k in known]
    return np.asarray(np.interp(np.arange(count), known, spans))


def _tops(at: FloatArray, above_m: FloatArray, count: int) -> FloatArray:
    """Height of the top in each of `count` equal parts of 0 to 1; 0 where points are few."""
    part = np.clip((at * count).astype(int), 0, count - 1)
    groups = [above_m[part == k] for k in range(count)]
    return np.array([float(np.percentile(g, 95)) if len(g) >= _FEWEST else 0.0 for g in groups])


@dataclass(frozen=True, eq=False)
class ShapeModel:
    """Network with one hidden layer: features are standardised by `mean` and `scale` (F,).

    `hidden` (F + 1, H) and `output` (H + 1, C) are weights whose last row is the bias. `names` are the classes, with
    `thing` for objects of no class; `shares` (C,) are their shares in the training data.
    """

    names: tuple[str, ...]
    mean: FloatArray
    scale: FloatArray
    hidden: FloatArray
    output: FloatArray
    shares: FloatArray

    def likelihoods(self, features: FloatArray) -> Mapping[str, float]:
        """Likelihood of each class by the features (F,) of a shape, relative to that of a random object."""
        x = (features - self.mean) / self.scale
        logits = np.tanh(x @ self.hidden[:-1] + self.hidden[-1]) @ self.output[:-1] + self.output[-1]
        p = np.exp(logits - logits.max())
        p = np.maximum(p / p.sum(), LEAST_LIKELIHOOD)
        return MappingProxyType(dict(zip(self.names, (p / self.shares).tolist(), strict=True)))


@lru_cache(maxsize=1)
def shape_model() -> ShapeModel:
    """Loads the shape model. Raises OSError or ValueError when its file is missing or damaged."""
    with np.load(MODEL_FILE, allow_pickle=False) as data:
        arrays = (data[key].astype(np.float64) for key in ("mean", "scale", "hidden", "output", "shares"))
        return ShapeModel(tuple(map(str, data["names"])), *arrays)
