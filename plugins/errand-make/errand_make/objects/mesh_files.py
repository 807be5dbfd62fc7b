"""Reads mesh files of many formats: triangles with colours, pictures and texture coordinates."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final
from xml.etree import ElementTree

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from errand_make.errors import ObjectImportError, library
from errand_make.mesh import Colour
from errand_make.objects.collada import read_collada
from plant.worlds.geometry_files import check_model
from skills.inputs.errors import InputError, listing
from skills.inputs.outside import is_file, native_stderr_dropped, plain_file
from skills.inputs.picture_files import MOST_PIXELS, read_pixels
from skills.robot import FloatArray, Picture

MAX_BYTES: Final = 200_000_000
MOST_TRIANGLES: Final = 100_000
LARGEST_PICTURE_PX: Final = 1024
COLLADA, THREE_MF, GLTF, OBJ, STL = ".dae", ".3mf", ".gltf", ".obj", ".stl"
FORMATS: Final = (OBJ, STL, ".ply", ".off", GLTF, ".glb", COLLADA, THREE_MF)
Y_UP: Final = (GLTF, ".glb")
"""Formats that define y as up."""
UNITS_M: Final[Mapping[str, float]] = MappingProxyType(
    {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
)
"""Units of 3MF, in metres."""
MOST_COLOURS: Final = 64
"""More colours than this are rounded to few."""
GREY: Final[Colour] = (0.7, 0.7, 0.7)
_NAMING_OTHERS: Final = (OBJ, GLTF, COLLADA)
_STL_HEAD, _STL_TRIANGLE = 84, 50
"""Bytes of a binary STL before its triangles, and of each; the head ends in their number."""
_AGAIN: Final = "export it once more, for example as GLB"
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


@dataclass(frozen=True)
class MeshContent:
    """Content of a mesh file in its own axes: patches, the axis that is up, and remarks on files that are missing.

    The patches are in metres if the file has a unit.
    """

    patches: tuple[Patch, ...]
    up: str = "z"
    notes: tuple[str, ...] = ()

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return sum(len(patch.triangles) for patch in self.patches)


def read_mesh(path: Path, most: int = MOST_TRIANGLES) -> MeshContent:
    """Reads the triangles of a mesh file, at most so many.

    Raises:
        ObjectImportError: the file is missing, too large or no mesh, is empty, or has too many triangles.
        LibraryMissingError: trimesh, or the library that it needs for the format, is not installed.
    """
    library("trimesh")
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        what = f"files *{path.suffix[:20]} are not read" if path.suffix else "its name has no ending"
        raise ObjectImportError(what, f"export it as one of {', '.join(each.removeprefix('.') for each in FORMATS)}")
    try:
        content = _read(path, suffix, most)
    except InputError as error:
        place = "" if error.file in (None, path) else f"{error.file.name}: "
        place += "" if error.line is None else f"line {error.line}: "
        raise ObjectImportError(f"{place}{error.message}", error.hint) from error
    if not content.triangles:
        raise ObjectImportError("it is no mesh: there are no triangles in it", "give a file with a surface")
    if content.triangles > most:
        raise _too_many(content.triangles, most)
    if not all(np.isfinite(patch.triangles).all() for patch in content.patches):
        raise ObjectImportError("some of its coordinates are not finite", "export it once more")
    if len({patch.colour for patch in content.patches}) > MOST_COLOURS:
        rounded = tuple(replace(patch, colour=_rounded(patch.colour)) for patch in content.patches)
        return replace(content, patches=rounded)
    return content


def _read(path: Path, suffix: str, most: int) -> MeshContent:
    """Reads a file of a known format. Raises InputError and ObjectImportError."""
    lacking = list[str]()
    plain_file(path, most_bytes=MAX_BYTES, hint="check the path")
    if path.stat().st_size == 0:
        raise ObjectImportError("it is empty", "export it once more")
    if suffix in _NAMING_OTHERS:
        check_model(path, path.parent, lacking)
    if suffix == GLTF and (buffers := [name for name in lacking if name.lower().endswith(".bin")]):
        raise ObjectImportError(f"{buffers[0]}, which it names, is missing", "put it beside the mesh, or export as GLB")
    if suffix == STL:
        _refuse_cut_off(path)
    up = "y" if suffix in Y_UP else "z"
    if suffix == COLLADA:
        patches, up = _of_collada(path)
    else:
        scale = _unit_of_3mf(path) if suffix == THREE_MF else 1.0
        patches = tuple(patch.transform(scale * np.eye(3), np.zeros(3)) for patch in _with_trimesh(path, most))
    be = "is" if len(lacking) == 1 else "are"
    note = f"{listing(lacking)}, which it names, {be} missing, so it is grey there; put the files beside the mesh"
    return MeshContent(patches, up, (note,) if lacking else ())


def _refuse_cut_off(path: Path) -> None:
    """Refuses a binary STL file that ends before its last triangle. Raises ObjectImportError."""
    with path.open("rb") as stream:
        head = stream.read(_STL_HEAD)
    count = int.from_bytes(head[-4:], "little")
    found = max(path.stat().st_size - _STL_HEAD, 0) // _STL_TRIANGLE
    if b"\0" in head and found < count:
        raise ObjectImportError(f"it is cut off: {found} of {count} triangles are there", "copy or export it once more")


def _of_collada(path: Path) -> tuple[tuple[Patch, ...], str]:
    """Patches of a COLLADA file, in metres, and the axis that is up. Raises ObjectImportError and InputError."""
    content = read_collada(path)
    pictures = {name: _picture_file(path, name) for name in {part.picture for part in content.parts} if name}
    return tuple(
        Patch(part.triangles, _near_zero(part.uvs), GREY if part.colour is None else part.colour, picture)
        for part in content.parts
        for picture in [pictures.get(part.picture or "")]
    ), content.up


def _picture_file(path: Path, name: str) -> Picture | None:
    """Picture that a mesh file names, RGB; None if there is no such file. Raises InputError."""
    file = path.parent / name
    return _shrunk(np.asarray(read_pixels(file, flags=cv2.IMREAD_COLOR)[..., ::-1])) if is_file(file) else None


def _unit_of_3mf(path: Path) -> float:
    """Metres of one unit of a 3MF file. Raises ObjectImportError."""
    for name in ("networkx", "lxml"):
        library(name)
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(each.file_size for each in archive.infolist()) > MAX_BYTES:
                raise ObjectImportError("it is too large when it is unpacked", "make it coarser")
            model = next((each for each in archive.namelist() if each.lower().endswith("3d/3dmodel.model")), None)
            if model is None:
                raise ObjectImportError("it is no 3MF file: it has no 3D/3dmodel.model", _AGAIN)
            with archive.open(model) as stream:
                _, root = next(ElementTree.iterparse(stream, events=("start",)))
    except (zipfile.BadZipFile, ElementTree.ParseError, StopIteration, OSError, NotImplementedError) as error:
        raise ObjectImportError("it is no 3MF file, or a damaged one", _AGAIN) from error
    unit = root.get("unit", "millimeter")
    if unit not in UNITS_M:
        raise ObjectImportError(f"its unit is {unit[:20]!r}", f"3MF has {', '.join(UNITS_M)}")
    return UNITS_M[unit]


def _with_trimesh(path: Path, most: int) -> tuple[Patch, ...]:
    """Reads the triangles of a file with trimesh. Raises ObjectImportError."""
    trimesh = library("trimesh")
    try:
        with native_stderr_dropped():
            scene = trimesh.load_scene(path, process=False)
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        count = sum(len(part.faces) for part in parts)
        if count > most:
            raise _too_many(count, most)
        return tuple(patch for part in parts for patch in _patches(part))
    except ObjectImportError:
        raise
    except Exception as error:  # readers of foreign formats raise anything
        raise ObjectImportError(f"it is damaged ({type(error).__name__})", _AGAIN) from error


def _too_many(count: int, most: int) -> ObjectImportError:
    hint = "make it coarser, for example by Decimate in Blender or by MeshLab"
    return ObjectImportError(f"it has {count} triangles, and at most {most} are taken", hint)


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
            yield Patch(triangles, _near_zero(np.asarray(uv)[part.faces]), picture=picture)
    elif visual.kind in ("face", "vertex"):
        colours = np.asarray(visual.face_colors)[:, :3].astype(np.uint8)
        for colour, chosen in _by_colour(colours):
            yield Patch(triangles[chosen], plain[chosen], _colour(colour))
    else:
        yield Patch(triangles, plain)


def _near_zero(uvs: FloatArray) -> FloatArray:
    """Moves texture coordinates (T, 3, 2) by whole textures, so that each triangle begins within the first."""
    return np.asarray(uvs - np.floor(uvs.min(axis=1, keepdims=True) + 1e-6))


def _picture(material: Any) -> Picture | None:
    """Picture of a material's colour, RGB; None without one."""
    found = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if found is None:
        return None
    if found.width * found.height > MOST_PIXELS:
        raise ObjectImportError(f"its picture has {found.width} x {found.height} pixels", "make the picture smaller")
    return _shrunk(np.asarray(found.convert("RGB"), dtype=np.uint8))


def _shrunk(picture: Picture) -> Picture:
    """Shrinks a picture to `LARGEST_PICTURE_PX`."""
    shrink = LARGEST_PICTURE_PX / max(picture.shape[:2])
    if shrink < 1.0:
        return np.asarray(cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), np.uint8)
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
