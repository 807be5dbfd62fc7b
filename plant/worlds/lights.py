"""How a world is lit. Rooms have no ceiling and rendering casts no shadows: a few directions of light are enough."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import LightParameter, RenderEngineVtkParams, Rgba

from executive.words.variation import DAY_LIGHT, Light

SKY = (0.78, 0.87, 0.96)
_BEAMS = (
    ((0.92, 0.20, -0.30), 0.78),
    ((-0.92, 0.20, -0.30), 0.88),
    ((-0.20, 0.92, -0.30), 0.72),
    ((0.20, -0.92, -0.30), 0.82),
    ((0.0, 0.0, 1.0), 0.40),
)


def lights(light: Light = DAY_LIGHT) -> list[LightParameter]:
    """Day light through the open top, softer from the four sides and from the floor, as `light` changes it."""
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
    """Parameters of Drake's VTK renderer for cameras in a world."""
    sky = np.clip(np.array(SKY) * np.array(light.colour) * min(1.0, light.brightness), 0.0, 1.0)
    return RenderEngineVtkParams(default_clear_color=sky, lights=lights(light))
