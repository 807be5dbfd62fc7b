"""How a world is lit. Rooms have no ceiling and rendering casts no shadows: a few directions of light are enough."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import LightParameter, RenderEngineVtkParams

SKY = (0.78, 0.87, 0.96)
_BEAMS = (
    ((0.92, 0.20, -0.30), 0.78),
    ((-0.92, 0.20, -0.30), 0.88),
    ((-0.20, 0.92, -0.30), 0.72),
    ((0.20, -0.92, -0.30), 0.82),
    ((0.0, 0.0, 1.0), 0.40),
)


def lights() -> list[LightParameter]:
    """Day light through the open top, softer from the four sides and from the floor."""
    return [
        LightParameter(type="directional", frame="world", direction=np.array(direction), intensity=intensity)
        for direction, intensity in _BEAMS
    ]


def render_parameters() -> RenderEngineVtkParams:
    """Parameters of Drake's VTK renderer for cameras in a world."""
    return RenderEngineVtkParams(default_clear_color=np.array(SKY), lights=lights())
