"""Writes the object models that come with Errand: `python -m errand_train.models`."""

from __future__ import annotations

from pathlib import Path

from errand_make.mesh import mtl_text, obj_text, palette_picture, plain_colours, write_text
from errand_make.shapes import Model, model_sdf
from errand_train.models import objects
from errand_train.models.appearance import (
    Appearance,
    beer_appearance,
    coke_appearance,
    cube_appearance,
    hammer_appearance,
)
from errand_train.models.person import person, person_appearance
from errand_train.models.tray import tray, tray_appearance
from plant.models.catalogue import MODELS_FOLDER
from plant.scene_pictures import save_png


def build(folder: Path) -> None:
    """Writes every model into its own folder. The same source gives the same bytes."""
    models = (
        (objects.coke(), coke_appearance()),
        (objects.beer(), beer_appearance()),
        (objects.hammer(), hammer_appearance()),
        (objects.cube(), cube_appearance()),
        (person(), person_appearance()),
        (tray(), tray_appearance()),
    )
    for model, appearance in models:
        write_model(folder / model.name, model, appearance)


def write_model(folder: Path, model: Model, appearance: Appearance) -> None:
    """Writes SDF, OBJ, material file and pictures of one model."""
    write_text(folder / f"{model.name}.sdf", model_sdf(model))
    for file_name, mesh in {model.mesh: appearance.mesh, **appearance.parts}.items():
        write_text(folder / file_name, obj_text(mesh, f"{model.name}.mtl"))
    write_text(folder / f"{model.name}.mtl", mtl_text(appearance.mesh, "palette.png"))
    for name, picture in appearance.pictures.items():
        save_png(folder / name, picture, 9)
    if plain_colours(appearance.mesh.materials):
        save_png(folder / "palette.png", palette_picture(appearance.mesh.materials), 9)


if __name__ == "__main__":
    build(MODELS_FOLDER)
