"""Writes the generated files of the world `flat`: `python -m plant.worlds.builder`."""

from __future__ import annotations

import math
from pathlib import Path

from plant.models.builder.mesh import Mesh, mtl_text, obj_text, palette_picture, write_text
from plant.models.builder.pictures import write_png
from plant.models.builder.sdf import Model, model_sdf
from plant.worlds.builder.layout import Placed, layout
from plant.worlds.builder.maps import Placement, pgm_bytes, rasterise, yaml_text
from plant.worlds.builder.materials import materials, pictures
from plant.worlds.builder.plan import OUTLINE_M
from plant.worlds.builder.shell import shell_collisions, shell_mesh

BANDS_M = {"scan": (0.70, 1.30), "keepout": (0.05, 1.00)}
PACKAGE = "package://errand/worlds/flat/furniture"


def build(folder: Path) -> None:
    """Write meshes, models, directives and maps into a world's folder. The same source gives the same bytes."""
    palette, pieces = materials(), layout(materials())
    for name, picture in pictures().items():
        write_png(folder / "furniture" / name, picture)
    write_png(folder / "furniture" / "palette.png", palette_picture(palette))
    _write_model(
        folder, Model("shell", "shell.obj", shell_collisions(), comment="floor and walls"), shell_mesh(palette)
    )
    for placed in pieces:
        _write_model(folder, Model(placed.name, f"{placed.name}.obj", placed.piece.collisions), placed.piece.mesh)
    write_text(folder / "world.dmd.yaml", _directives(pieces))
    _write_maps(folder, pieces)


def _write_model(folder: Path, model: Model, mesh: Mesh) -> None:
    base = folder / "furniture" / model.name
    write_text(base.with_suffix(".sdf"), model_sdf(model))
    write_text(base.with_suffix(".obj"), obj_text(mesh, f"{model.name}.mtl"))
    write_text(base.with_suffix(".mtl"), mtl_text(mesh, "palette.png"))


def _directives(pieces: list[Placed]) -> str:
    welds = [_weld("shell", 0.0, 0.0, 0.0), *(_weld(p.name, p.x, p.y, p.yaw_rad) for p in pieces)]
    return "# Made by `python -m plant.worlds.builder`, don't edit.\ndirectives:\n" + "".join(welds)


def _weld(name: str, x: float, y: float, yaw_rad: float) -> str:
    return f"""- add_model:
    name: {name}
    file: {PACKAGE}/{name}.sdf
- add_weld:
    parent: world
    child: {name}::{name}
    X_PC:
      translation: [{x:g}, {y:g}, 0]
      rotation: !Rpy {{deg: [0, 0, {math.degrees(yaw_rad):g}]}}
"""


def _write_maps(folder: Path, pieces: list[Placed]) -> None:
    shapes = [Placement(shape, 0.0, 0.0, 0.0) for shape in shell_collisions()]
    shapes += [Placement(shape, p.x, p.y, p.yaw_rad) for p in pieces for shape in p.piece.collisions]
    (folder / "map").mkdir(parents=True, exist_ok=True)
    for name, band in BANDS_M.items():
        grid = rasterise(shapes, band, OUTLINE_M)
        (folder / "map" / f"{name}.pgm").write_bytes(pgm_bytes(grid))
        write_text(folder / "map" / f"{name}.yaml", yaml_text(grid, f"{name}.pgm", band))


if __name__ == "__main__":
    build(Path(__file__).resolve().parents[1] / "flat")
