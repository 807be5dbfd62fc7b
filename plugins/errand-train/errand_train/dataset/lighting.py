"""Lighting of a scene: plain, with shadows, or physically based."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import LightParameter, RenderEngineVtkParams, Rgba

from errand_train.dataset.room import Room

PLAIN, SHADOWS, PHYSICAL = "plain", "shadows", "physical"
STYLES = (PLAIN, SHADOWS, PHYSICAL)
_PHYSICAL_GAIN = 2.5


@dataclass(frozen=True)
class Lighting:
    """Parameters of the renderer; the appearance comes from glTF (physical) or from OBJ."""

    style: str
    parameters: RenderEngineVtkParams

    @property
    def physical(self) -> bool:
        """Returns whether rendering is physically based."""
        return self.style == PHYSICAL


def random_lighting(rng: np.random.Generator, room: Room) -> Lighting:
    """Draws day, evening or lamp light: one to three lamps or the sun, and softer light from all sides."""
    style = str(rng.choice(STYLES, p=[0.45, 0.3, 0.25]))
    shadows = style == SHADOWS or (style == PHYSICAL and rng.random() < 0.5)
    gain = _PHYSICAL_GAIN if style == PHYSICAL else 1.0
    fill = _fill(rng, gain * float(rng.uniform(0.28, 0.6)))
    keys = [_key(rng, room, gain, spots=not shadows) for _ in range(int(rng.choice([1, 2, 3], p=[0.55, 0.33, 0.12])))]
    sky = rng.uniform(0.2, 1.0) * np.array([0.85, 0.92, 1.0])
    parameters = RenderEngineVtkParams(
        default_clear_color=np.clip(sky, 0, 1), lights=[*keys, *fill], cast_shadows=bool(shadows), shadow_map_size=1024
    )
    return Lighting(style, parameters)


def _warmth(rng: np.random.Generator) -> Rgba:
    """From candle to sky."""
    t = float(rng.normal(0, 0.5))
    red, blue = np.clip(1 + 0.18 * t, 0.7, 1.0), np.clip(1 - 0.22 * t, 0.6, 1.0)
    return Rgba(float(red), float(np.clip(1 - 0.05 * abs(t), 0.8, 1)), float(blue), 1.0)


def _key(rng: np.random.Generator, room: Room, gain: float, *, spots: bool) -> LightParameter:
    """The sun through an open top or window, or a lamp.

    A spot light that casts shadows makes the software renderer hang in about one scene of a thousand.
    """
    w, d, h = room.size_m
    strong = gain * float(rng.uniform(0.35, 0.95))
    if rng.random() < 0.45 or not room.has_ceiling:
        down = float(rng.uniform(0.3, 1.6))
        around = float(rng.uniform(0, 2 * np.pi))
        direction = np.array([np.cos(around), np.sin(around), -down])
        return LightParameter(
            type="directional", frame="world", direction=direction, intensity=strong, color=_warmth(rng)
        )
    place = np.array([rng.uniform(0.3, w - 0.3), rng.uniform(0.3, d - 0.3), rng.uniform(0.6, 0.95) * h])
    if rng.random() < 0.5 and spots:
        target = np.array([rng.uniform(0, w), rng.uniform(0, d), 0.0])
        return LightParameter(
            type="spot",
            frame="world",
            position=place,
            direction=target - place,
            cone_angle=float(rng.uniform(35, 75)),
            intensity=strong * 1.3,
            color=_warmth(rng),
        )
    fade = np.array([1.0, 0.0, float(rng.uniform(0.0, 0.15))])
    return LightParameter(
        type="point", frame="world", position=place, attenuation_values=fade, intensity=strong * 1.3, color=_warmth(rng)
    )


def _fill(rng: np.random.Generator, level: float) -> list[LightParameter]:
    """Light from three sides and from above or below, uneven. Every light more costs time in the renderer."""
    turn, beams = float(rng.uniform(0, np.pi)), []
    for k in range(3):
        angle = turn + k * 2 * np.pi / 3
        beams.append(np.array([np.cos(angle), np.sin(angle), -0.35]))
    beams.append(np.array([0.0, 0.05, 1.0 if rng.random() < 0.5 else -1.0]))
    return [
        LightParameter(
            type="directional",
            frame="world",
            direction=beam,
            intensity=level * float(rng.uniform(0.5, 1.4)),
            color=_warmth(rng),
        )
        for beam in beams
    ]
