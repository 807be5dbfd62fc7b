"""Portraits of models: a visual mesh that fills a picture."""

from dataclasses import dataclass
from pathlib import Path

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

from plant.rendering import lights
from plant.scene_pictures import look_at, render_view
from skills.robot import FloatArray, Picture

GROUND = (0.86, 0.87, 0.88)
FOV_Y_RAD = float(np.radians(30.0))
_FLAT = 0.4


@dataclass(frozen=True)
class Ball:
    """Ball that encloses a model, in the model's frame: centre (3,) and radius (m)."""

    middle: FloatArray
    radius_m: float


def portrait(mesh: Path, ball: Ball, size_m: tuple[float, float, float], size_px: tuple[int, int]) -> Picture:
    """Renders a visual mesh so that it fills a picture (width, height); a flat one is seen more from above."""
    scene = SceneGraph()
    parameters = RenderEngineVtkParams(default_clear_color=np.array(GROUND), lights=lights())
    scene.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
    appearance = GeometryInstance(RigidTransform(), Mesh(str(mesh), np.ones(3)), mesh.stem)
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(1))
    appearance.set_perception_properties(properties)
    scene.RegisterAnchoredGeometry(scene.RegisterSource("portrait"), appearance)
    view = np.array([1.0, -0.75, 0.55]) if size_m[2] > _FLAT * max(size_m) else np.array([0.25, -0.6, 1.0])
    eye = ball.middle + view / np.linalg.norm(view) * ball.radius_m / np.sin(FOV_Y_RAD / 2.0)
    query = scene.get_query_output_port().Eval(scene.CreateDefaultContext())
    assert isinstance(query, QueryObject)
    return render_view(query, look_at(eye, ball.middle), size_px, fov_y_rad=FOV_Y_RAD)
