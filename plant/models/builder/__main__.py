"""Writes the object models: `python -m plant.models.builder`."""

from __future__ import annotations

from pathlib import Path

from plant.models.builder import objects
from plant.models.builder.looks import Looks, beer_looks, coke_looks, cube_looks, hammer_looks
from plant.models.builder.mesh import mtl_text, obj_text, palette_picture, plain_colours, write_text
from plant.models.builder.person import person, person_looks
from plant.models.builder.pictures import write_png
from plant.models.builder.sdf import Model, model_sdf


def build(folder: Path) -> None:
    """Write every model into its own folder. The same source gives the same bytes."""
    models = (
        (objects.coke(), coke_looks()),
        (objects.beer(), beer_looks()),
        (objects.hammer(), hammer_looks()),
        (objects.cube(), cube_looks()),
        (person(), person_looks()),
    )
    for model, looks in models:
        write_model(folder / model.name, model, looks)


def write_model(folder: Path, model: Model, looks: Looks) -> None:
    """Write SDF, OBJ, material file and pictures of one model."""
    write_text(folder / f"{model.name}.sdf", model_sdf(model))
    write_text(folder / f"{model.name}.obj", obj_text(looks.mesh, f"{model.name}.mtl"))
    write_text(folder / f"{model.name}.mtl", mtl_text(looks.mesh, "palette.png"))
    for name, picture in looks.pictures.items():
        write_png(folder / name, picture)
    if plain_colours(looks.mesh.materials):
        write_png(folder / "palette.png", palette_picture(looks.mesh.materials))


if __name__ == "__main__":
    build(Path(__file__).resolve().parents[1])
