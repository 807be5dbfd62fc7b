"""How a world is lit. Rooms have no ceiling and rendering casts no shadows: a few directions of light are enough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from pydrake.geometry import LightParameter, RenderEngineVtkParams, Rgba

SKY = (0.78, 0.87, 0.96)
_BEAMS = (
    ((0.92, 0.20, -0.30), 0.78),
    ((-0.92, 0.20, -0.30), 0.88),
    ((-0.20, 0.92, -0.30), 0.72),
    ((0.20, -0.92, -0.30), 0.82),
    ((0.0, 0.0, 1.0), 0.40),
)


@dataclass(frozen=True)
class Light:
    """How light differs from the usual day light.

    All beams are multiplied by `brightness` and have a `colour` (red, green, blue; 0 to 1). With a `sun` (direction in
    which its beam goes, world frame, and intensity), that one comes on top.
    """

    brightness: float = 1.0
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    sun: tuple[tuple[float, float, float], float] | None = None


DAY_LIGHT: Final = Light()
LIGHTS: Final[Mapping[str, Light]] = MappingProxyType(
    {
        "normal": DAY_LIGHT,
        "dim": Light(0.4),
        "bright": Light(1.5),
        "evening": Light(0.6, (1.0, 0.78, 0.55)),
        "low sun": Light(0.5, sun=((0.95, 0.0, -0.31), 1.6)),
    }
)
"""The lights that have names."""


def light_of(words: str) -> Light:
    """A light by its name, or by its brightness (0 to 5). Raises ValueError: it is neither."""
    if words in LIGHTS:
        return LIGHTS[words]
    brightness = float(words)
    if not 0.0 <= brightness <= 5.0:
        raise ValueError(f"brightness {words} is out of range")
    return Light(brightness)


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
