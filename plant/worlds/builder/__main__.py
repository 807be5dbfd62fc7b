"""Writes the generated files of the world `flat`: `python -m plant.worlds.builder`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from plant.models.builder.mesh import Mesh, mtl_text, obj_text, palette_picture, write_text
from plant.models.builder.sdf import Model, model_sdf
from plant.pictures import save_png
from plant.worlds.builder.furniture import Piece
from plant.worlds.builder.maps import BANDS_M, Placement, pgm_bytes, rasterise, yaml_text
from plant.worlds.builder.materials import materials, pictures
from plant.worlds.builder.plan import Placed, load_plan
from plant.worlds.builder.shell import shell_collisions, shell_mesh

PACKAGE = "package://errand/worlds/flat/furniture"


def build(folder: Path) -> None:
    """Write meshes, models, directives and maps into a world's folder. The same source gives the same bytes."""
    palette, plan = materials(), load_plan()
    for name, picture in pictures().items():
        save_png(folder / "furniture" / name, picture, 9)
    save_png(folder / "furniture" / "palette.png", palette_picture(palette), 9)
    _write_model(
        folder, Model("shell", "shell.obj", shell_collisions(), comment="floor and walls"), shell_mesh(palette)
    )
    shapes = [Placement(shape, 0.0, 0.0, 0.0) for shape in shell_collisions()]
    for name, placed in plan.furniture.items():
        piece = Piece(placed.piece or name, palette, **(placed.model_extra or {}))
        _write_model(folder, Model(name, f"{name}.obj", piece.collisions), piece.mesh)
        shapes += [Placement(shape, *placed.at, placed.yaw_rad) for shape in piece.collisions]
    write_text(folder / "world.dmd.yaml", _directives(plan.furniture))
    (folder / "map").mkdir(parents=True, exist_ok=True)
    for name, band in BANDS_M.items():
        grid = rasterise(shapes, band, plan.outline_m)
        (folder / "map" / f"{name}.pgm").write_bytes(pgm_bytes(grid))
        write_text(folder / "map" / f"{name}.yaml", yaml_text(grid, f"{name}.pgm", band))


def _write_model(folder: Path, model: Model, mesh: Mesh) -> None:
    base = folder / "furniture" / model.name
    write_text(base.with_suffix(".sdf"), model_sdf(model))
    write_text(base.with_suffix(".obj"), obj_text(mesh, f"{model.name}.mtl"))
    write_text(base.with_suffix(".mtl"), mtl_text(mesh, "palette.png"))


def _directives(pieces: Mapping[str, Placed]) -> str:
    welds = [_weld("shell", 0.0, 0.0, 0.0), *(_weld(name, *p.at, p.yaw_rad) for name, p in pieces.items())]
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


if __name__ == "__main__":
    build(Path(__file__).resolve().parents[1] / "flat")
