"""Models of own objects in files, as `errand object import` writes them beside each object's simulation model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from skills.files.errors import InputError
from skills.robot import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

RECOGNITION_FILE: Final = "recognition.npz"
_AGAIN: Final = "make it again by `errand object import`"


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """Points (N, 3) in m on an object's surface, their outward normals (N, 3) and colours (N, 3) RGB.

    `rests` (K, 3, 3) are the rotations from the model's frame in which it rests on a level surface.
    """

    name: str
    points: FloatArray
    normals: FloatArray
    colours: NDArray[np.uint8]
    rests: FloatArray

    @cached_property
    def tree(self) -> cKDTree:
        """Search tree of the points."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def write(self, folder: Path) -> None:
        """Writes the model into a folder, from which `read_model` reads it."""
        small = {key: getattr(self, key).astype(np.float32) for key in ("points", "normals", "rests")}
        np.savez_compressed(folder / RECOGNITION_FILE, name=np.array(self.name), colours=self.colours, **small)


def read_model(folder: Path) -> ObjectModel:
    """Reads the model of an imported object. Raises InputError when there is none, or it is damaged."""
    file = folder / RECOGNITION_FILE
    try:
        with np.load(file, allow_pickle=False) as data:
            points, normals, rests = (data[key].astype(np.float64) for key in ("points", "normals", "rests"))
            model = ObjectModel(str(data["name"]), points, normals, data["colours"].astype(np.uint8), rests)
    except FileNotFoundError as error:
        raise InputError(
            f"the robot cannot recognise it: {RECOGNITION_FILE} is missing", hint=_AGAIN, file=folder
        ) from error
    except Exception as error:  # a damaged archive raises anything
        raise InputError("it is damaged", hint=_AGAIN, file=file) from error
    shapes = {points.shape, normals.shape, model.colours.shape}
    if shapes != {(len(points), 3)} or rests.shape[1:] != (3, 3) or len(points) * len(rests) == 0:
        raise InputError("it is damaged", hint=_AGAIN, file=file)
    return model
