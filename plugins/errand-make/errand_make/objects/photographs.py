"""Imports photographs of an object without a mesh: a box of its size stands for its body, its views recognise it."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_make.objects.import_object import ImportOptions, ImportReports, import_content
from errand_make.objects.mesh_files import MeshContent, Patch
from errand_make.objects.solid import hull_of
from plant.models.catalogue import ImportedObject
from skills.inputs.errors import InputError, count_text
from skills.inputs.picture_files import read_pixels
from skills.perception.object_model import read_model, view_of

FEWEST, MOST = 4, 60
_LONGEST_PX, _SMALLEST_PX = 640, 48
"""Side to which larger photographs are reduced, and least length of the object in them."""
_BORDER, _MOST_UNLIKE = 0.03, 0.4
"""Width of the border as a part of the photograph's, and its least differing share that is still background."""
_DIFFERENT, _LIGHTNESS = 10.0, 0.5
"""Least difference in Lab from the background, and its weight of lightness, which a soft shadow changes."""
_PICTURES: Final = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".avif", ".heic", ".heif")
_MATTE: Final = "photograph the object before a sheet of one colour that it does not have"

Rgba = NDArray[np.uint8]


def import_photographs(
    photographs: Path, options: ImportOptions, folder: Path, reports: ImportReports, size_m: tuple[float, float, float]
) -> ImportedObject:
    """Writes the model of an object in a folder of photographs into an existing folder, and notes omissions.

    `size_m` are width, depth and height as the object stands. Raises as `import_object` does, and InputError when fewer
    than four photographs can be used, or there are too many.
    """
    options.check()
    crops, refused = _crops(photographs)
    for error in refused:
        reports.note(f"left out: {error}")
    corners = np.array(list(product(*((-0.5 * side, 0.5 * side) for side in size_m))))
    triangles = corners[hull_of(corners).simplices]
    box = MeshContent((Patch(triangles, np.zeros((*triangles.shape[:2], 2))),))
    made = import_content(box, options, folder, reports).model_copy(update={"photographs": len(crops)})
    replace(read_model(folder), views=np.array([view_of(crop) for crop in crops])).write(folder)
    made.write(folder)
    return made


def _crops(photographs: Path) -> tuple[list[Rgba], list[InputError]]:
    """The object in each photograph that can be used, and the errors of the others. Raises InputError."""
    files = sorted(file for file in photographs.iterdir() if file.suffix.lower() in _PICTURES)
    if not FEWEST <= len(files) <= MOST:
        hint = f"give {FEWEST} to {MOST} photographs from different sides, such as JPEG"
        raise InputError(f"it has {count_text(len(files), 'photograph')}", hint=hint, file=photographs)
    crops, refused = list[Rgba](), list[InputError]()
    for file in files:
        try:
            crops.append(cut_out(file))
        except InputError as error:
            refused.append(error)
    if len(crops) < FEWEST:
        what = f"of {len(files)} photographs {len(crops)} can be used"
        raise InputError(what, hint=f"at least {FEWEST} are needed", file=photographs, others=refused)
    return crops, refused


def cut_out(file: Path) -> Rgba:
    """The object of a photograph on transparent ground, cut to its bounds.

    The object is the opaque part, or else the largest part unlike the border. Raises InputError when the file cannot be
    read, the background is not plain, or the object is missing, too small or cut by the border.
    """
    bgr, pixels = read_pixels(file, flags=cv2.IMREAD_COLOR), read_pixels(file)
    alpha = pixels[..., 3] if pixels.shape == (*bgr.shape[:2], 4) else np.zeros(bgr.shape[:2])
    scale = min(1.0, _LONGEST_PX / max(bgr.shape[:2]))
    bgr, alpha = (cv2.resize(each, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) for each in (bgr, alpha))
    rgb = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)
    opaque = alpha > alpha.max() / 2
    mask = _largest(opaque if opaque.any() and not opaque.all() else _before_ground(rgb, file))
    left, top, width, height = cv2.boundingRect(mask)
    if not width:
        raise InputError("no object stands out from the background", hint=_MATTE, file=file)
    if min(left, top) == 0 or left + width == mask.shape[1] or top + height == len(mask):
        raise InputError("the border cuts the object", hint="photograph it whole, with ground around it", file=file)
    if max(width, height) < _SMALLEST_PX:
        hint = f"photograph it from nearer, at least {_SMALLEST_PX}"
        raise InputError(f"the object is only {max(width, height)} pixels large", hint=hint, file=file)
    return np.dstack([rgb, 255 * mask])[top : top + height, left : left + width]


def _before_ground(rgb: Rgba, file: Path) -> NDArray[np.bool_]:
    """Mask of the pixels unlike the border's colour, which may change evenly across. Raises InputError."""
    lab = cv2.cvtColor(rgb / np.float32(255.0), cv2.COLOR_RGB2LAB) * np.array([_LIGHTNESS, 1.0, 1.0], np.float32)
    v, u = np.mgrid[-1 : 1 : len(rgb) * 1j, -1 : 1 : len(rgb[0]) * 1j]
    at, border = np.dstack([np.ones_like(u), u, v]), np.maximum(np.abs(u), np.abs(v)) > 1.0 - 2.0 * _BORDER
    off = np.linalg.norm(lab - np.median(lab[border], axis=0), axis=2)
    for _ in range(2):
        near = border & (off < max(_DIFFERENT, 2.0 * float(np.median(off[border]))))
        off = np.linalg.norm(lab - at @ np.linalg.lstsq(at[near], lab[near], rcond=None)[0], axis=2)
    if np.mean(off[border] > _DIFFERENT) > _MOST_UNLIKE:
        raise InputError("the background is not plain", hint=_MATTE, file=file)
    return np.asarray(off > max(_DIFFERENT, 4.0 * float(np.median(off[near]))))


def _largest(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The largest connected part of a mask, without threads, and with its holes of the background's colour."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    outlines, _ = cv2.findContours(opened, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    chosen = sorted(outlines, key=cv2.contourArea)[-1:]
    return np.asarray(cv2.drawContours(np.zeros_like(opened), chosen, -1, 1, cv2.FILLED))
