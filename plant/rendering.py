"""Rendering for the cameras: the scene at any positions of the plant, and the lights of a world."""

import os
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import LightParameter, MakeRenderEngineVtk, QueryObject, RenderEngineVtkParams, Rgba, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Diagram

from executive.words.variation import DAY_LIGHT, Light

RENDERER = "vtk"
MESA_THREADS: Final = "LP_NUM_THREADS"
"""Environment variable of Mesa's software renderer: the number of its threads."""


class Scene:
    """Renders a Diagram at any positions, in a context of its own.

    The renderer exists only in this context: in the stepped context it would follow every step, at a third of the time.
    """

    def __init__(
        self,
        diagram: Diagram,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        parameters: RenderEngineVtkParams | None = None,
    ) -> None:
        """`parameters` set light and sky; the renderer's name is `RENDERER`."""
        self._plant = plant
        self._root_context = diagram.CreateDefaultContext()
        self._context = plant.GetMyMutableContextFromRoot(self._root_context)
        self._geometry_context = scene_graph.GetMyMutableContextFromRoot(self._root_context)
        self._query_port = scene_graph.get_query_output_port()
        self._scene_graph, self._parameters = scene_graph, parameters or RenderEngineVtkParams()
        self._rendering = False

    def query_at(self, positions: NDArray[np.float64]) -> QueryObject:
        """Returns the scene with the plant at `positions`; it is valid until the next call.

        The first call creates the renderer, which loads all meshes. Without a graphics card it draws in the calling
        thread, unless the environment says otherwise: for small pictures, other threads cost as much as the drawing.
        """
        if not self._rendering:
            self._rendering = True
            os.environ.setdefault(MESA_THREADS, "0")
            self._scene_graph.AddRenderer(self._geometry_context, RENDERER, MakeRenderEngineVtk(self._parameters))
        self._plant.SetPositions(self._context, positions)
        query = self._query_port.Eval(self._geometry_context)
        assert isinstance(query, QueryObject)
        return query


SKY = (0.78, 0.87, 0.96)
_BEAMS = (
    ((0.92, 0.20, -0.30), 0.78),
    ((-0.92, 0.20, -0.30), 0.88),
    ((-0.20, 0.92, -0.30), 0.72),
    ((0.20, -0.92, -0.30), 0.82),
    ((0.0, 0.0, 1.0), 0.40),
)


def lights(light: Light = DAY_LIGHT) -> list[LightParameter]:
    """Directional lights of a world: daylight from above, softer from the sides and the floor, scaled by `light`.

    Rooms have no ceiling and rendering casts no shadows, so a few directions are enough.
    """
    beams = [(direction, intensity * light.brightness) for direction, intensity in _BEAMS]
    return [
        LightParameter(
            type="directional",
            frame="world",
            direction=np.array(direction),
            intensity=intensity,
            color=Rgba(*light.colour),
        )
        for direction, intensity in (*beams, *(() if light.sun is None else (light.sun,)))
    ]


def render_parameters(light: Light = DAY_LIGHT) -> RenderEngineVtkParams:
    """Parameters of Drake's VTK renderer: the lights of a world and the colour of its sky."""
    sky = np.clip(np.array(SKY) * np.array(light.colour) * min(1.0, light.brightness), 0.0, 1.0)
    return RenderEngineVtkParams(default_clear_color=sky, lights=lights(light))
