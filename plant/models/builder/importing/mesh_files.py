"""Reads mesh files of many formats: triangles with colours, pictures and texture coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from plant.models.builder.importing.collada import read_collada
from plant.models.builder.mesh import Colour
from plant.models.catalogue import ObjectImportError, objects_module
from plant.worlds.geometry_files import check_model
from skills.files.errors import InputError
from skills.files.outside import plain_file
from skills.files.picture_files import MOST_PIXELS
from skills.robot import FloatArray, Picture

MAX_BYTES: Final = 200_000_000
MOST_TRIANGLES: Final = 100_000
LARGEST_PICTURE_PX: Final = 1024
COLLADA: Final = ".dae"
Y_UP: Final = (".gltf", ".glb")
"""Formats that define y as up."""
MOST_COLOURS: Final = 64
"""More colours than this are rounded to few."""
GREY: Final[Colour] = (0.7, 0.7, 0.7)
_NO_MESHES: Final = frozenset({"zip", "tar.gz", "bz2", "tar.bz2", "stl_ascii", "dxf", "xyz"})
_NAMING_OTHERS: Final = (".obj", ".gltf")
_SHADES: Final = 5


@dataclass(frozen=True)
class Patch:
    """Triangles of one appearance: corners (T, 3, 3), texture coordinates (T, 3, 2), a colour or a picture."""

    triangles: FloatArray
    uvs: FloatArray
    colour: Colour = GREY
    picture: Picture | None = None

    def transform(self, R: FloatArray, p: FloatArray) -> Patch:
        """Returns the patch transformed by the (3, 3) matrix R, then moved by p."""
        return replace(self, triangles=self.triangles @ R.T + p)


def read_patches(path: Path) -> tuple[tuple[Patch, ...], str]:
    """Reads the triangles of a mesh file in its own axes, and the axis that is up; in metres if the format has a unit.

    Raises:
        ObjectImportError: the file is missing, too large or no mesh, is empty, or has too many triangles.
        ObjectsExtraMissingError: trimesh is not installed.
    """
    trimesh = objects_module("trimesh")
    suffix = path.suffix.lower()
    formats = sorted({*trimesh.available_formats(), COLLADA.removeprefix(".")} - _NO_MESHES)
    if suffix.removeprefix(".") not in formats:
        what = f"'{path.suffix}' is the ending of no mesh format" if path.suffix else "it has no ending"
        raise ObjectImportError(what, f"give one of {', '.join(formats)}")
    try:
        plain_file(path, most_bytes=MAX_BYTES, hint="check the path")
        if suffix in _NAMING_OTHERS:
            check_model(path, path.parent)
        if suffix == COLLADA:
            collada = read_collada(path)
            parts = ((triangles, GREY if colour is None else colour) for triangles, colour in collada.parts)
            patches = tuple(Patch(each, np.zeros((len(each), 3, 2)), colour) for each, colour in parts)
            up = collada.up
        else:
            patches, up = _with_trimesh(path, trimesh), "y" if suffix in Y_UP else "z"
    except InputError as error:
        what = error.message if error.file in (None, path) else f"{error.file.name}: {error.message}"
        raise ObjectImportError(what, error.hint) from error
    if not any(len(patch.triangles) for patch in patches):
        raise ObjectImportError("it is no mesh: there are no triangles in it", "give a file with a surface")
    if sum(len(patch.triangles) for patch in patches) > MOST_TRIANGLES:
        raise _too_many(sum(len(patch.triangles) for patch in patches))
    if len({patch.colour for patch in patches}) > MOST_COLOURS:
        patches = tuple(replace(patch, colour=_rounded(patch.colour)) for patch in patches)
    if not all(np.isfinite(patch.triangles).all() for patch in patches):
        raise ObjectImportError("some of its coordinates are not finite", "export it once more")
    return patches, up


def _with_trimesh(path: Path, trimesh: Any) -> tuple[Patch, ...]:
    """Reads the triangles of a file with trimesh. Raises ObjectImportError."""
    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        count = sum(len(part.faces) for part in parts)
        if count > MOST_TRIANGLES:
            raise _too_many(count)
        return tuple(patch for part in parts for patch in _patches(part))
    except ObjectImportError:
        raise
    except FileNotFoundError as error:
        raise ObjectImportError(
            "a file that it names is missing", "put it beside the mesh, or export as GLB"
        ) from error
    except Exception as error:  # readers of foreign formats raise anything
        raise ObjectImportError(
            f"it cannot be read as a mesh ({type(error).__name__})", "export it once more, for example as OBJ or GLB"
        ) from error


def _too_many(count: int) -> ObjectImportError:
    hint = "make it coarser, for example by Decimate in Blender or by MeshLab"
    return ObjectImportError(f"it has {count} triangles, and at most {MOST_TRIANGLES} are taken", hint)


def _patches(part: Any) -> Iterator[Patch]:
    """Patches of one mesh, one for each colour."""
    triangles = np.asarray(part.triangles, dtype=np.float64)
    if triangles.shape[1:] != (3, 3):
        raise ValueError(f"triangles of {triangles.shape[1:]} numbers")
    plain = np.zeros((len(triangles), 3, 2))
    visual = part.visual
    if visual.kind == "texture":
        picture = _picture(visual.material)
        uv = getattr(visual, "uv", None)
        if picture is None or uv is None:
            yield Patch(triangles, plain, _colour(visual.material.main_color))
        else:
            uvs = np.asarray(uv)[part.faces]
            uvs = np.asarray(uvs - np.floor(uvs.min(axis=1, keepdims=True) + 1e-6))  # begins within the first texture
            yield Patch(triangles, uvs, picture=picture)
    elif visual.kind in ("face", "vertex"):
        colours = np.asarray(visual.face_colors)[:, :3].astype(np.uint8)
        for colour, chosen in _by_colour(colours):
            yield Patch(triangles[chosen], plain[chosen], _colour(colour))
    else:
        yield Patch(triangles, plain)


def _picture(material: Any) -> Picture | None:
    """Picture of a material's colour, RGB, shrunk to `LARGEST_PICTURE_PX`; None without one."""
    found = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if found is None:
        return None
    if found.width * found.height > MOST_PIXELS:
        raise ObjectImportError(f"its picture has {found.width} x {found.height} pixels", "make the picture smaller")
    picture = np.asarray(found.convert("RGB"), dtype=np.uint8)
    shrink = LARGEST_PICTURE_PX / max(picture.shape[:2])
    if shrink < 1.0:
        picture = np.asarray(cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), np.uint8)
    return picture


def _colour(rgb: ArrayLike) -> Colour:
    r, g, b = (float(value) / 255.0 for value in np.asarray(rgb)[:3])
    return r, g, b


def _rounded(colour: Colour) -> Colour:
    """Rounds a colour to one of few."""
    r, g, b = (round(value * (_SHADES - 1)) / (_SHADES - 1) for value in colour)
    return r, g, b


def _by_colour(colours: NDArray[np.uint8]) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.bool_]]]:
    """Colours with the mask (T,) of their triangles; many colours are rounded to few."""
    if len(np.unique(colours, axis=0)) > MOST_COLOURS:
        step = 255 / (_SHADES - 1)
        colours = np.round(np.round(colours / step) * step).astype(np.uint8)
    unique, index = np.unique(colours, axis=0, return_inverse=True)
    for number, colour in enumerate(unique):
        yield colour, index.reshape(-1) == number
