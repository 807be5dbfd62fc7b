"""A generated model: its files, class, mass and form."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from errand_make.mesh import Mesh, mtl_text, obj_text, palette_picture, plain_colours, write_text
from errand_make.shapes import Model, model_sdf
from errand_train.dataset.objects.draft import Finished
from errand_train.models.gltf import gltf_text
from plant.scene_pictures import save_png
from skills.robot import FloatArray

HELD_OUT_EVERY = 4
MODEL_FACTS = "model.json"
"""File with the data of a model in its folder."""


def held_out(number: int) -> bool:
    """Returns whether an instance, texture or layout of this number is held out from training: every fourth."""
    return number % HELD_OUT_EVERY == HELD_OUT_EVERY - 1


@dataclass(frozen=True)
class Surface:
    """Triangles of a model: corner points (N, 3) in metres and their indices (T, 3)."""

    points: FloatArray
    faces: NDArray[np.int64]


@dataclass(frozen=True)
class ObjectModel:
    """One instance of a category. `folder` holds its SDF, OBJ, glTF and pictures.

    `class_id` is 0 for a distractor; `kind` is the form within the category ("claw"), `colour` its main colour.
    The model's frame has its origin in the centre of the bounding box, a person's on the floor; `size_m` is that box.
    """

    folder: Path
    category: str
    seed: int
    class_id: int
    kind: str
    colour: str
    mass_kg: float
    com_m: tuple[float, float, float]
    size_m: tuple[float, float, float]

    @property
    def name(self) -> str:
        """Category and number, such as `hammer_017`."""
        return f"{self.category}_{self.seed:03d}"

    @property
    def path(self) -> Path:
        """Path of the SDF file."""
        return self.folder / f"{self.category}.sdf"

    @property
    def obj_path(self) -> Path:
        """Path of the visual geometry as OBJ, for rendering with plain shading."""
        return self.folder / f"{self.category}.obj"

    @property
    def gltf_path(self) -> Path:
        """Path of the visual geometry as glTF, for rendering with physical shading."""
        return self.folder / f"{self.category}.gltf"

    @property
    def held_out(self) -> bool:
        """Returns whether the instance is held out from training."""
        return held_out(self.seed)

    @cached_property
    def surface(self) -> Surface:
        """Triangles of the model."""
        with np.load(self.folder / "surface.npz") as data:
            return Surface(data["points"].astype(np.float64), data["faces"].astype(np.int64))


def write_model(folder: Path, model: ObjectModel, made: Finished) -> None:
    """Writes all files of a model into a folder."""
    sdf = Model(
        model.category, model.obj_path.name, made.collisions, made.mass, comment=f"{model.kind} {model.category}"
    )
    write_text(folder / model.path.name, model_sdf(sdf))
    write_text(folder / model.obj_path.name, obj_text(made.mesh, f"{model.category}.mtl"))
    write_text(folder / f"{model.category}.mtl", mtl_text(made.mesh, "palette.png"))
    write_text(folder / model.gltf_path.name, gltf_text(made.mesh))
    for name, picture in made.pictures.items():
        save_png(folder / name, picture)
    if plain_colours(made.mesh.materials):
        save_png(folder / "palette.png", palette_picture(made.mesh.materials))
    surface = surface_of(made.mesh)
    np.savez_compressed(
        folder / "surface.npz", points=surface.points.astype(np.float32), faces=surface.faces.astype(np.int32)
    )
    facts = {name: value for name, value in asdict(model).items() if name != "folder"}
    write_text(folder / MODEL_FACTS, json.dumps(facts, indent=1) + "\n")


def read_model(folder: Path) -> ObjectModel:
    """Reads a model that `write_model` has written."""
    facts = json.loads((folder / MODEL_FACTS).read_text(encoding="utf-8"))
    facts["com_m"], facts["size_m"] = tuple(facts["com_m"]), tuple(facts["size_m"])
    return ObjectModel(folder=folder, **facts)


def surface_of(mesh: Mesh) -> Surface:
    """Triangles of a mesh with equal points merged (to 0.01 mm)."""
    corners = np.concatenate([points for _, points, _, _ in mesh.groups()])
    points, order = np.unique(np.round(corners, 5), axis=0, return_inverse=True)
    return Surface(points, order.reshape(-1, 3))
