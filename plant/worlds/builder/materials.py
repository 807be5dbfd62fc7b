"""What the flat's surfaces look like: textured materials, plain colours, and the pictures behind them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from plant.models.builder.mesh import Material
from plant.models.builder.pictures import cloth, noise, speckle, to_picture, wood
from skills.robot import FloatArray, Picture

TEXTURE_PX = 384


def materials() -> dict[str, Material]:
    """All materials of the world by name; texture files stand in `textures/`."""
    textured = {
        "oak_floor": Material(texture="oak_floor.png", tile_m=(1.6, 1.6)),
        "dark_floor": Material((0.72, 0.60, 0.52), "oak_floor.png", (1.6, 1.6)),
        "kitchen_tiles": Material(texture="floor_tiles.png", tile_m=(1.2, 1.2)),
        "bath_tiles": Material((0.80, 0.86, 0.90), "floor_tiles.png", (0.8, 0.8)),
        "wall_tiles": Material(texture="wall_tiles.png", tile_m=(0.8, 0.8)),
        "concrete": Material((0.74, 0.74, 0.73), "plaster.png", (2.5, 2.5)),
        "worktop": Material((0.46, 0.47, 0.49), "stone.png", (0.6, 0.6)),
        "bench_top": Material((0.58, 0.60, 0.60), "stone.png", (0.8, 0.8)),
        "wood_light": Material(texture="wood_light.png", tile_m=(0.9, 0.9)),
        "wood_dark": Material((0.50, 0.42, 0.38), "wood_light.png", (0.9, 0.9)),
        "wood_grey": Material((0.80, 0.84, 0.90), "wood_light.png", (0.9, 0.9)),
        "cloth_grey": Material((0.46, 0.49, 0.53), "cloth.png", (0.5, 0.5)),
        "cloth_sand": Material((0.78, 0.73, 0.66), "cloth.png", (0.5, 0.5)),
        "cloth_white": Material((0.95, 0.95, 0.94), "cloth.png", (0.5, 0.5)),
        "cloth_slate": Material((0.36, 0.42, 0.47), "cloth.png", (0.5, 0.5)),
        "rug": Material(texture="rug.png"),
        "books": Material(texture="books.png", tile_m=(0.8, 0.35)),
        "pegboard": Material(texture="pegboard.png"),
        "window": Material(texture="window.png"),
        "entrance_door": Material(texture="entrance_door.png"),
        "picture_a": Material(texture="picture_a.png"),
        "picture_b": Material(texture="picture_b.png"),
    }
    walls = {
        "wall_hall": (0.93, 0.91, 0.86),
        "wall_kitchen": (0.95, 0.93, 0.87),
        "wall_living_room": (0.86, 0.89, 0.87),
        "wall_bedroom": (0.84, 0.87, 0.92),
        "wall_bathroom": (0.93, 0.95, 0.96),
        "wall_workshop": (0.86, 0.86, 0.83),
        "wall_office": (0.92, 0.88, 0.84),
        "wall_outside": (0.80, 0.79, 0.76),
    }
    plastered = {name: Material(colour, "plaster.png", (2.5, 2.5)) for name, colour in walls.items()}
    return {**textured, **plastered, **{name: Material(colour) for name, colour in COLOURS.items()}}


COLOURS = {
    "white": (0.88, 0.88, 0.87),
    "cream": (0.90, 0.87, 0.80),
    "skirting": (0.96, 0.96, 0.95),
    "cap": (0.55, 0.55, 0.54),
    "gap": (0.30, 0.30, 0.30),
    "black": (0.06, 0.06, 0.07),
    "charcoal": (0.20, 0.21, 0.22),
    "steel": (0.70, 0.72, 0.74),
    "dark_steel": (0.36, 0.38, 0.40),
    "grey": (0.62, 0.63, 0.64),
    "light_grey": (0.78, 0.79, 0.80),
    "porcelain": (0.97, 0.97, 0.96),
    "water": (0.80, 0.87, 0.90),
    "screen": (0.05, 0.07, 0.10),
    "mirror": (0.75, 0.82, 0.86),
    "pot": (0.55, 0.52, 0.50),
    "soil": (0.20, 0.16, 0.13),
    "leaf": (0.36, 0.47, 0.27),
    "leaf_dark": (0.27, 0.38, 0.22),
    "lamp": (0.98, 0.93, 0.80),
    "sill": (0.66, 0.64, 0.61),
    "pillow": (0.86, 0.84, 0.80),
    "teal": (0.37, 0.50, 0.52),
    "carton": (0.66, 0.56, 0.44),
    "tray": (0.72, 0.73, 0.74),
    "trolley": (0.42, 0.45, 0.48),
    "ground": (0.48, 0.50, 0.47),
    "dock": (0.22, 0.23, 0.24),
    "dock_line": (0.85, 0.80, 0.45),
    "ring": (0.30, 0.30, 0.31),
}


def pictures(seed: int = 7) -> dict[str, Picture]:
    """All texture pictures by file name."""
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
