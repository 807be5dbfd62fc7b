"""AprilTags of family 36h11: files to print, plates for worlds, and plates on imported models.

The plate of a tag has a white margin of `MARGIN` cells around the black square, for the detection.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from errand_make.errors import ObjectImportError
from errand_make.mesh import Material, Mesh, mtl_text, obj_text, write_text
from errand_make.shapes import Model, model_sdf, number
from plant.models.catalogue import read_imported
from plant.scene_pictures import save_png
from skills.robot import Picture

CELLS: Final = 8
"""Cells along the side of a tag's black square."""
MARGIN: Final = 1
SIDES: Final = {"front": (1, 0, 0), "back": (-1, 0, 0), "left": (0, 1, 0), "right": (0, -1, 0), "top": (0, 0, 1)}
"""Sides of a model as it rests: x ahead, y left, z up."""
_TEXTURE_PX = 16
_PLATE: Final = (CELLS + 2 * MARGIN) / CELLS
_BACK_M, _PROUD_M = 0.002, 0.0005


def tag_picture(tag: int, cell_px: int) -> Picture:
    """Picture (H, W) of a tag with its margin."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    square = cv2.aruco.generateImageMarker(family, tag, CELLS * cell_px)
    return np.asarray(np.pad(square, MARGIN * cell_px, constant_values=255), dtype=np.uint8)


def tag_svg(tag: int, size_m: float) -> str:
    """Returns a tag as SVG, whose print has the right size."""
    cell_mm, cells = 1000.0 * size_m / CELLS, CELLS + 2 * MARGIN
    black = np.argwhere(tag_picture(tag, 1) == 0)
    squares = "".join(f"M{x} {y}h1v1h-1z" for y, x in black)
    side = f"{cell_mm * cells:g}mm"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{side}" height="{side}" viewBox="0 0 {cells} {cells}">\n'
        f"<title>AprilTag 36h11, {tag}, {1000 * size_m:g} mm</title>\n"
        f'<rect width="{cells}" height="{cells}" fill="white"/>\n'
        f'<path shape-rendering="crispEdges" d="{squares}"/>\n</svg>\n'
    )


def write_plate(folder: Path, tag: int, size_m: float) -> Path:
    """Writes the model of a plate into a folder, to be welded into a world: z out of its face, y up."""
    name = f"tag_{tag}"
    _write_mesh(folder, tag, size_m)
    write_text(folder / f"{name}.sdf", model_sdf(Model(name, f"{name}.obj", [], maker="`errand object tag`")))
    return folder / f"{name}.sdf"


def stick_on(folder: Path, tag: int, size_m: float, side: str) -> None:
    """Puts the plate of a tag on a side of the imported model in a folder.

    Raises ObjectImportError when the tag is there already, or wider than this side; InputError without a model.
    """
    model, outward = read_imported(folder), SIDES.get(side)
    if outward is None:
        raise ObjectImportError(f"there is no side {side[:20]!r}", "give front, back, left, right or top")
    sdf = folder / f"{model.name}.sdf"
    text, visual = sdf.read_text(encoding="utf-8"), f'<visual name="tag_{tag}_{side}">'
    if visual in text:
        raise ObjectImportError(f"the {side} of {model.name} has tag {tag} already", "name another --side")
    widths = [size for size, axis in zip(model.size_m, outward, strict=True) if axis == 0]
    if _PLATE * size_m > min(widths):
        most_m = min(widths) / _PLATE
        raise ObjectImportError(f"tag {tag} is wider than the {side} of {model.name}", f"--size {most_m:.3g} at most")
    p = [axis * (0.5 * size + _PROUD_M) for size, axis in zip(model.size_m, outward, strict=True)]
    x, y, z = outward
    rpy = (0.0, 0.0, 0.0) if z else (0.5 * math.pi, 0.0, math.atan2(y, x) + 0.5 * math.pi)
    pose = " ".join(number(float(value)) for value in (*p, *rpy))
    plate = f"""      {visual}
        <pose>{pose}</pose>
        <geometry><mesh><uri>tag_{tag}.obj</uri></mesh></geometry>
      </visual>
"""
    _write_mesh(folder, tag, size_m)
    write_text(sdf, text.replace("    </link>", f"{plate}    </link>", 1))


def _write_mesh(folder: Path, tag: int, size_m: float) -> None:
    """Writes the thin box of a plate with the tag on its face, which is in the plane z = 0."""
    name, h = f"tag_{tag}", 0.5 * _PLATE * size_m
    mesh = Mesh({"face": Material(texture=f"{name}.png"), "back": Material(texture="white.png")})
    mesh.add_box("back", (-h, -h, -_BACK_M), (h, h, 0.0), faces={"+z": "face"})
    write_text(folder / f"{name}.obj", obj_text(mesh, f"{name}.mtl", places=6))
    write_text(folder / f"{name}.mtl", mtl_text(mesh, "white.png"))
    save_png(folder / f"{name}.png", np.repeat(tag_picture(tag, _TEXTURE_PX)[..., None], 3, axis=2))
    save_png(folder / "white.png", np.full((4, 4, 3), 255, np.uint8))
