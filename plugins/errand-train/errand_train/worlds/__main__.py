"""Writes the generated files of the worlds: `python -m errand_train.worlds [NAME ...]`."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from errand_make.mesh import Mesh, mtl_text, obj_text, palette_picture, write_text
from errand_make.shapes import Model, model_sdf
from errand_make.worlds.rooms import BANDS_M, pgm_bytes, yaml_text
from errand_train.worlds.furniture import Piece
from errand_train.worlds.grids import DRAWN, Placement, rasterise
from errand_train.worlds.materials import materials, pictures
from errand_train.worlds.plan import PLANS, Placed, Plan, load_plan
from errand_train.worlds.shell import shell_collisions, shell_mesh
from plant.scene_pictures import save_png
from plant.worlds.world import PACKAGE_NAME, ROBOTS, TRUTH, WORLDS_FOLDER


def build(plan: Plan, folder: Path, package: str, maps: str = TRUTH) -> None:
    """Writes meshes, models, directives and surveyed maps of a world. The same source gives the same bytes.

    `package` is the name of the folder in its files, as in `errand/worlds/flat`; `maps` is the folder of the grids.
    """
    palette = materials()
    shell = shell_mesh(plan, palette)
    _write_model(folder, Model("shell", "shell.obj", shell_collisions(plan), comment="floor and walls"), shell)
    shapes, meshes = [Placement(shape, 0.0, 0.0, 0.0) for shape in shell_collisions(plan)], [shell]
    for called, placed in plan.furniture.items():
        piece = Piece(placed.piece or called, palette, **(placed.model_extra or {}))
        _write_model(folder, Model(called, f"{called}.obj", piece.collisions), piece.mesh)
        shapes += [Placement(shape, *placed.at, placed.yaw_rad) for shape in piece.collisions]
        meshes.append(piece.mesh)
    _write_pictures(folder / "furniture", meshes)
    write_text(folder / "world.dmd.yaml", _directives(package, plan.furniture))
    for kind, band in BANDS_M.items():
        grid = rasterise(shapes, band, plan.outline_m)
        for name in sorted({maps, ROBOTS} if kind in DRAWN else {maps}):
            (folder / name).mkdir(parents=True, exist_ok=True)
            (folder / name / f"{kind}.pgm").write_bytes(pgm_bytes(grid))
            write_text(folder / name / f"{kind}.yaml", yaml_text(grid, f"{kind}.pgm", band))


def _write_pictures(folder: Path, meshes: Iterable[Mesh]) -> None:
    """The palette, and the textures that the meshes use."""
    used = {mesh.materials[material].texture for mesh in meshes for material, *_ in mesh.groups()}
    for name, picture in pictures().items():
        if name in used:
            save_png(folder / name, picture, 9)
    save_png(folder / "palette.png", palette_picture(materials()), 9)


def _write_model(folder: Path, model: Model, mesh: Mesh) -> None:
    base = folder / "furniture" / model.name
    write_text(base.with_suffix(".sdf"), model_sdf(model))
    write_text(base.with_suffix(".obj"), obj_text(mesh, f"{model.name}.mtl"))
    write_text(base.with_suffix(".mtl"), mtl_text(mesh, "palette.png"))


def _directives(package: str, pieces: Mapping[str, Placed]) -> str:
    folder = f"package://{package}/furniture"
    welds = [_weld(folder, "shell", 0.0, 0.0, 0.0), *(_weld(folder, k, *p.at, p.yaw_rad) for k, p in pieces.items())]
    return "# Made by `python -m errand_train.worlds`, don't edit.\ndirectives:\n" + "".join(welds)


def _weld(folder: str, name: str, x: float, y: float, yaw_rad: float) -> str:
    return f"""- add_model:
    name: {name}
    file: {folder}/{name}.sdf
- add_weld:
    parent: world
    child: {name}::{name}
    X_PC:
      translation: [{x:g}, {y:g}, 0]
      rotation: !Rpy {{deg: [0, 0, {math.degrees(yaw_rad):g}]}}
"""


if __name__ == "__main__":
    for world in sys.argv[1:] or PLANS:
        build(load_plan(world), WORLDS_FOLDER / world, f"{PACKAGE_NAME}/worlds/{world}")
