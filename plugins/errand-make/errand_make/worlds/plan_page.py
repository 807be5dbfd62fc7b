"""Page with the plan of a world: a click tells the pose, and the command that adds a part there."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Final

import numpy as np

from errand_make.worlds.plan_picture import plan_view
from errand_make.worlds.wanted import Addition
from plant.scene_pictures import png_bytes
from plant.worlds.world import World
from skills.robot import Picture

_TEMPLATE: Final = Path(__file__).with_name("plan_page.html.template")
_KINDS: Final = (*(kind.value for kind in Addition), "zone", "start")
"""What the page adds."""


def plan_page(world: World, name: str, picture: Picture) -> str:
    """Returns the page as one HTML text, with the picture inside; `name` is the world in its commands."""
    view = plan_view(world)
    (x_zero, y_zero), *_ = view.pixels(np.zeros((1, 2))).tolist()
    data = {
        "name": world.name,
        "folder": name,
        "kinds": _KINDS,
        "picture": f"data:image/png;base64,{base64.b64encode(png_bytes(picture, 9)).decode()}",
        "size": [picture.shape[1], picture.shape[0]],
        "zero": [x_zero, y_zero],
        "scale": view.pixels_per_m,
        "rooms": world.rooms,
        "surfaces": {surface: top.polygon_W for surface, top in world.surfaces.items()},
    }
    text = json.dumps(data).replace("<", "\\u003c")
    return _TEMPLATE.read_text(encoding="utf-8").replace("__WORLD__", text)
