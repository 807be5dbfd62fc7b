"""Pictures of many models at once, to look at: `python -m plant.dataset.objects.sheet FOLDER [FAMILY ...]`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from pydrake.geometry import (
    GeometryInstance,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    QueryObject,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
)
from pydrake.math import RigidTransform

from plant.dataset.objects import CLASSES, DISTRACTORS, instance
from plant.dataset.objects.model import ObjectModel
from plant.pictures import look_at, render_view, save_png
from plant.worlds.lights import lights
from skills.robot import Picture


def sheet(models: Sequence[ObjectModel], columns: int, cell: tuple[int, int] = (160, 160)) -> Picture:
    """A grid of pictures, each model filling its cell (width, height)."""
    cells = [_cell(model, cell) for model in models]
    blank = np.full((cell[1], cell[0], 3), 255, np.uint8)
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[k : k + columns], axis=1) for k in range(0, len(cells), columns)]
    return np.concatenate(rows, axis=0)


def _cell(model: ObjectModel, size: tuple[int, int]) -> Picture:
    scene = SceneGraph()
    params = RenderEngineVtkParams(default_clear_color=np.array([0.86, 0.87, 0.88]), lights=lights())
    scene.AddRenderer("vtk", MakeRenderEngineVtk(params))
    source = scene.RegisterSource("sheet")
    appearance = GeometryInstance(RigidTransform(), Mesh(str(model.obj_path), np.ones(3)), model.name)
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    appearance.set_perception_properties(properties)
    scene.RegisterAnchoredGeometry(source, appearance)
    points = model.surface.points
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    view = np.array([1.0, -0.75, 0.55]) if model.size_m[2] > 0.4 * max(model.size_m) else np.array([0.25, -0.6, 1.0])
    eye = middle + view / np.linalg.norm(view) * radius / np.sin(np.radians(15.0))
    context = scene.CreateDefaultContext()
    query = scene.get_query_output_port().Eval(context)
    assert isinstance(query, QueryObject)
    picture = render_view(query, look_at(eye, middle), size, fov_y_rad=float(np.radians(30.0)))
    cv2.putText(
        picture, f"{model.seed} {model.kind}", (3, size[1] - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.35, (20, 20, 20), 1
    )
    return np.asarray(picture, dtype=np.uint8)


def main(arguments: Sequence[str]) -> None:
    """Write one sheet for each category, and one of all distractors."""
    folder, categories = Path(arguments[0]), arguments[1:] or [*CLASSES, "distractors"]
    for category in categories:
        if category == "distractors":
            models = [instance(name, k) for name in DISTRACTORS for k in range(2)]
        else:
            models = [instance(category, k) for k in range(48 if category in CLASSES else 8)]
        save_png(folder / f"{category}.png", sheet(models, 8))


if __name__ == "__main__":
    main(sys.argv[1:])
