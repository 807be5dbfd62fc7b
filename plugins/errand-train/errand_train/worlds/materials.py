"""Appearance of surfaces: the materials in `materials.yaml`, and their textures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from errand_make.mesh import Material
from errand_train.models.pictures import cloth, noise, speckle, to_picture, wood
from skills.inputs.yaml_source import read_yaml
from skills.robot import FloatArray, Picture

TEXTURE_PX = 384


@cache
def materials() -> Mapping[str, Material]:
    """Materials of the worlds by name."""
    return TypeAdapter(dict[str, Material]).validate_python(read_yaml(Path(__file__).with_name("materials.yaml")).data)


def pictures(seed: int = 7) -> dict[str, Picture]:
    """Draws all textures by file name."""
    makers: dict[str, Callable[[np.random.Generator], FloatArray]] = {
        "oak_floor.png": _planks,
        "floor_tiles.png": lambda rng: _tiles(rng, 3, (0.88, 0.87, 0.84), (0.66, 0.65, 0.63)),
        "wall_tiles.png": lambda rng: _tiles(rng, 4, (0.94, 0.95, 0.95), (0.80, 0.81, 0.81)),
        "plaster.png": lambda rng: speckle(rng, (256, 256), (0.96, 0.96, 0.96), 0.020),
        "stone.png": lambda rng: speckle(rng, (256, 256), (0.92, 0.92, 0.92), 0.07),
        "wood_light.png": lambda rng: wood(rng, (256, 256), (0.84, 0.77, 0.67), 0.07),
        "cloth.png": lambda rng: cloth(rng, (192, 192), (0.95, 0.95, 0.95)),
        "rug.png": _rug,
        "books.png": _books,
        "pegboard.png": _pegboard,
        "window.png": _window,
        "entrance_door.png": _entrance_door,
        "picture_a.png": lambda rng: _abstract(rng, ((0.85, 0.82, 0.76), (0.50, 0.58, 0.60), (0.72, 0.62, 0.52))),
        "picture_b.png": lambda rng: _abstract(rng, ((0.80, 0.84, 0.86), (0.42, 0.46, 0.52), (0.80, 0.74, 0.60))),
    }
    return {
        name: to_picture(make(np.random.default_rng([seed, index])))
        for index, (name, make) in enumerate(sorted(makers.items()))
    }


def _planks(rng: np.random.Generator) -> FloatArray:
    """Eight rows of oak planks with staggered joints."""
    rows, height, width = 8, TEXTURE_PX // 8, TEXTURE_PX
    image = np.zeros((TEXTURE_PX, width, 3))
    for row in range(rows):
        plank = wood(rng, (4 * height, width), (0.70, 0.58, 0.45), 0.05)[:height]
        joint = int(rng.integers(width))
        tone = 1 + 0.045 * rng.standard_normal(2)
        plank *= np.where(np.arange(width) < joint, tone[0], tone[1])[None, :, None]
        plank[:, joint : joint + 2] *= 0.72
        plank[-1:] *= 0.72
        image[row * height : (row + 1) * height] = plank
    return image


def _tiles(
    rng: np.random.Generator, count: int, colour: tuple[float, float, float], grout: tuple[float, float, float]
) -> FloatArray:
    """`count` by `count` glazed tiles with grout between them."""
    size = 288
    edge = size // count
    tone = 1 + 0.02 * rng.standard_normal((count, count))
    image = speckle(rng, (size, size), colour, 0.012) * tone.repeat(edge, 0).repeat(edge, 1)[..., None]
    lines = np.arange(size) % edge < 2
    image[lines, :] = grout
    image[:, lines] = grout
    return image


def _rug(rng: np.random.Generator) -> FloatArray:
    """A rug with a border and soft stripes."""
    shape = (256, 320)
    image = cloth(rng, shape, (0.72, 0.70, 0.66), 0.10)
    rows, columns = np.indices(shape)
    border = np.minimum.reduce([rows, columns, shape[0] - 1 - rows, shape[1] - 1 - columns])
    image[(border > 12) & (border < 22)] *= np.array([0.62, 0.68, 0.74])
    image[(border > 30) & ((columns // 20) % 2 == 0)] *= np.array([0.90, 0.92, 0.95])
    return image


def _books(rng: np.random.Generator) -> FloatArray:
    """One shelf board full of books, in muted colours."""
    height, width = 160, 366
    image = np.full((height, width, 3), 0.16)
    x = 2
    while x < width - 26:
        thick, tall = int(rng.integers(9, 24)), int(rng.integers(96, 146))
        grey = rng.uniform(0.30, 0.80)
        colour = np.clip(grey + rng.uniform(-0.10, 0.10, 3), 0, 1)
        image[height - tall :, x : x + thick] = colour * (1 + 0.04 * rng.standard_normal((tall, 1, 1)))
        image[height - tall :, x : x + 1] *= 0.6
        image[height - tall + 14 : height - tall + 20, x + 2 : x + thick - 2] = np.clip(colour * 1.35, 0, 1)
        x += thick + int(rng.integers(0, 3))
    return image


def _pegboard(rng: np.random.Generator) -> FloatArray:
    """A perforated board with the outlines of tools."""
    height, width = 200, 400
    image = speckle(rng, (height, width), (0.80, 0.80, 0.77), 0.02)
    rows, columns = np.indices((height, width))
    image[((rows % 10) < 2) & ((columns % 10) < 2)] = 0.45
    for x in range(30, 380, 38):
        length, wide = int(rng.integers(70, 130)), int(rng.integers(4, 9))
        image[40 : 40 + length, x : x + wide] = 0.32
        image[40 + length : 40 + length + 40, x - 3 : x + wide + 3] = rng.uniform(0.35, 0.55)
        image[34:46, x - 8 : x + wide + 8] = 0.38
    return image


def _window(rng: np.random.Generator) -> FloatArray:
    """A bright window: frame, mullion, sky above hazy trees."""
    height, width = 224, 256
    rows = np.linspace(0, 1, height)[:, None, None]
    image = (1 - rows) * np.array([0.74, 0.86, 0.98]) + rows * np.array([0.93, 0.96, 0.99]) + np.zeros((1, width, 1))
    trees = 0.68 + 0.06 * noise(rng, (1, width), (1, 14))[0]
    hazy = np.linspace(0, 1, height)[:, None] > trees[None, :]
    image[hazy] = np.array([0.62, 0.70, 0.64]) * (1 + 0.05 * noise(rng, (height, width), (3, 3)))[hazy][:, None]
    for line in (slice(0, 12), slice(-12, None)):
        image[line] = 0.95
        image[:, line] = 0.95
    image[:, width // 2 - 6 : width // 2 + 6] = 0.95
    return np.asarray(image)


def _entrance_door(rng: np.random.Generator) -> FloatArray:
    """A panelled door with a handle."""
    height, width = 300, 135
    image = wood(rng, (height, width), (0.62, 0.60, 0.57), 0.04)
    for top, bottom in ((24, 130), (156, 276)):
        image[top:bottom, 22:113] *= 0.90
        image[top + 5 : bottom - 5, 27:108] *= 1.07
    image[142:148, 108:126] = 0.80
    return image


def _abstract(rng: np.random.Generator, colours: tuple[tuple[float, float, float], ...]) -> FloatArray:
    """A framed abstract picture of soft fields."""
    shape = (128, 176)
    field = noise(rng, shape, (18, 30))
    bands = np.digitize(field, [-0.5, 0.6])
    image = np.array(colours)[bands] * (1 + 0.03 * noise(rng, shape, (1, 1)))[..., None]
    rows, columns = np.indices(shape)
    border = np.minimum.reduce([rows, columns, shape[0] - 1 - rows, shape[1] - 1 - columns])
    image[border < 18] = 0.95
    image[border < 6] = 0.15
    return np.asarray(image)
