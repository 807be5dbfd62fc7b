"""Models of imported objects, as `errand object import` writes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from skills.inputs.errors import InputError
from skills.robot import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

RECOGNITION_FILE: Final = "recognition.npz"
_AGAIN: Final = "make it again by `errand object import`"
VIEW_SIDE: Final = 24
"""Side of a view, in pixels."""


def view_of(rgba: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """View (24, 24, 4) of an object from its cut-out (H, W, 4): scaled to fit, centred."""
    import cv2

    scale, opacity = VIEW_SIDE / max(rgba.shape[:2]), rgba[..., 3:] / np.float32(255.0)
    wide, high = (max(1, round(side * scale)) for side in (rgba.shape[1], rgba.shape[0]))
    premultiplied = np.dstack([rgba[..., :3] * opacity, 255.0 * opacity])
    small: FloatArray = np.asarray(cv2.resize(premultiplied, (wide, high), interpolation=cv2.INTER_AREA), np.float64)
    small[..., :3] /= np.maximum(small[..., 3:] / 255.0, 1e-3)
    view, left, top = _no_views(1)[0], (VIEW_SIDE - wide) // 2, (VIEW_SIDE - high) // 2
    view[top : top + high, left : left + wide] = np.clip(np.round(small), 0, 255)
    return np.asarray(view)


def _no_views(count: int = 0) -> NDArray[np.uint8]:
    return np.zeros((count, VIEW_SIDE, VIEW_SIDE, 4), np.uint8)


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """Points (N, 3) in m on an object's surface, their outward normals (N, 3) and colours (N, 3) RGB.

    `rests` (K, 3, 3) are the rotations from the model's frame at which it rests on a level surface. A model made from
    photographs has `views` (V, 24, 24, 4) as `view_of` makes them, and its points are those of its bounding box.
    """

    name: str
    points: FloatArray
    normals: FloatArray
    colours: NDArray[np.uint8]
    rests: FloatArray
    views: NDArray[np.uint8] = field(default_factory=_no_views)

    @cached_property
    def tree(self) -> cKDTree:
        """k-d tree of the points."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def write(self, folder: Path) -> None:
        """Writes the model into a folder, from which `read_model` reads it."""
        small = {key: getattr(self, key).astype(np.float32) for key in ("points", "normals", "rests")}
        small |= {"colours": self.colours, "views": self.views}
        np.savez_compressed(folder / RECOGNITION_FILE, name=np.array(self.name), **small)


def read_model(folder: Path) -> ObjectModel:
    """Reads the model of an imported object. Raises InputError when the file is missing or damaged."""
    file = folder / RECOGNITION_FILE
    try:
        with np.load(file, allow_pickle=False) as data:
            points, normals, rests = (data[key].astype(np.float64) for key in ("points", "normals", "rests"))
            colours, views = (np.asarray(each, np.uint8) for each in (data["colours"], data.get("views", _no_views())))
            model = ObjectModel(str(data["name"]), points, normals, colours, rests, views)
    except FileNotFoundError as error:
        what = f"the robot cannot recognise it: {RECOGNITION_FILE} is missing"
        raise InputError(what, hint=_AGAIN, file=folder) from error
    except Exception as error:  # a damaged archive raises anything
        raise InputError("it is damaged", hint=_AGAIN, file=file) from error
    shapes = {points.shape, normals.shape, model.colours.shape}
    wrong = shapes != {(len(points), 3)} or rests.shape[1:] != (3, 3) or views.shape[1:] != _no_views().shape[1:]
    if wrong or len(points) * len(rests) == 0:
        raise InputError("it is damaged", hint=_AGAIN, file=file)
    return model
