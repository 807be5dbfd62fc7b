"""The rooms of the manipulation benchmark: one place to take things from, one to put them on, set by a seed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from errand_train.worlds.__main__ import build
from errand_train.worlds.plan import Plan
from plant.diagram import OWN_PACKAGE
from plant.models.catalogue import read_imported
from plant.worlds.seeding import place_objects
from plant.worlds.world import World, WorldError, load_world

CLASSES: Final = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "cylinder", "cube")
SURFACES: Final = ("table", "shelf", "floor")
ROBOT, TARGET, LOOK_S = "Alice", "target", 0.1
TAKEN, SECOND, PERSON = "bench", "side table", "Robin"
_BACK_Y, _SECOND_X = 4.35, 0.13
_WIDTH_M, _BOARD_M, _BOARDS, _SHELF_DEPTH_M, _SHELF_M = 1.2, 0.025, 3, 0.36, 1.285
_SECOND_M: Final = (1.0, 0.7, 0.72)  # width, depth, height
_PERSON_RANGES: Final = {"distance_m": [1.4, 1.6], "bearing_rad": [-1.9, -1.2], "turned_rad": [-0.2, 0.2]}


def room(
    folder: Path,
    class_name: str,
    others: Sequence[str],
    surface: str,
    seed: int,
    model: Path | None = None,
    *,
    person: bool = False,
) -> World:
    """A room with an object called `target` of a class, and others, on a surface; its heights come from the seed.

    The target is one of the catalogue's, or the imported one in the folder `model`. The last of the `others` are left
    out where they do not fit. A `person` stands at the right of the start.
    """
    rng = np.random.default_rng([seed, SURFACES.index(surface)])
    middle_x, furniture = 2.5, dict[str, Any]()
    if surface == "table":
        height, depth = float(rng.uniform(0.40, 0.92)), float(rng.uniform(0.6, 0.8))
        furniture["bench"] = {
            "piece": "table", "at": [middle_x, _BACK_Y], "facing": "south", "width": _WIDTH_M, "depth": depth,
            "height": round(height, 3), "top": "wood_light", "leg": "dark_steel",
        }  # fmt: skip
        from_edge = (0.08, 0.25)
    elif surface == "shelf":
        board, depth = int(rng.integers(1, _BOARDS)), _SHELF_DEPTH_M
        height = board * (_SHELF_M - _BOARD_M) / _BOARDS + _BOARD_M
        furniture["bench"] = {
            "piece": "open_shelf", "at": [middle_x, _BACK_Y], "facing": "south", "width": _WIDTH_M, "depth": depth,
            "height": _SHELF_M, "boards": _BOARDS,
        }  # fmt: skip
        from_edge = (0.08, 0.20)
    else:
        height, depth, from_edge = 0.01, 0.9, (0.2, 0.7)
    width, second_depth, second_height = _SECOND_M
    furniture["second_table"] = {
        "piece": "table", "at": [_SECOND_X, 1.6], "facing": "east", "width": width, "depth": second_depth,
        "height": second_height, "top": "white", "leg": "charcoal",
    }  # fmt: skip
    front = _BACK_Y - depth
    plan = Plan.model_validate({
        "outline_m": [5.0, 4.5], "wall_height_m": 2.5, "door_width_m": 0.9, "door_height_m": 2.05,
        "rooms": [["room", [0.12, 0.12, 4.88, 4.38], "concrete", "wall_workshop"]],
        "walls": [[0, 0, 5.0, 0.12], [0, 4.38, 5.0, 4.5], [0, 0.12, 0.12, 4.38], [4.88, 0.12, 5.0, 4.38]],
        "doors": [], "hangings": [], "furniture": furniture,
    })  # fmt: skip
    build(plan, folder, OWN_PACKAGE, "map")
    left, right = middle_x - _WIDTH_M / 2 + 0.03, middle_x + _WIDTH_M / 2 - 0.03
    second = [_SECOND_X + second_depth, 1.6 - width / 2, 1.6 + width / 2]
    knowledge = {
        "robot": {"name": "Alice"},
        "start": {"x": 2.5, "y": 1.6, "yaw": 1.5708},
        "places": {"room": {"aliases": [], "pose": {"x": 2.5, "y": 1.6, "yaw": 1.5708},
                            "polygon": [[0.12, 0.12], [4.88, 0.12], [4.88, 4.38], [0.12, 4.38]]}},
        "surfaces": {
            TAKEN: {"place": "room", "aliases": [], "height": round(height, 3),
                    "polygon": [[left, front], [right, front], [right, _BACK_Y], [left, _BACK_Y]],
                    "viewpoints": [{"x": middle_x, "y": round(front - 0.92, 3), "yaw": 1.5708}]},
            SECOND: {"place": "room", "aliases": [], "height": second_height,
                     "polygon": [[_SECOND_X, second[1]], [second[0], second[1]], [second[0], second[2]],
                                 [_SECOND_X, second[2]]],
                     "viewpoints": [{"x": second[0] + 0.92, "y": 1.6, "yaw": 3.1416}]},
        },
        "things": {name: {"aliases": [], "categories": [], "usual": [TAKEN]} for name in CLASSES},
        "people": {PERSON: {"aliases": [], "at": "room"}} if person else {},
    }  # fmt: skip
    (folder / "knowledge.yaml").write_text(yaml.safe_dump(knowledge, sort_keys=False), encoding="utf-8")
    target = class_name if model is None else read_imported(model).name
    rules = {
        "imports": [] if model is None else [str(model.resolve())],
        "rules": {"from_edge_m": list(from_edge), "clear_m": 0.03, "rim_m": 0.0, "drop_m": 0.001},
        "fronts": {TAKEN: [[[middle_x - 0.35, front], [middle_x + 0.35, front]]]},
        "people": [{"name": PERSON, "model": "person", **_PERSON_RANGES}] if person else [],
    }
    for number in range(len(others), 0, -1):
        try:
            return _with_objects(folder, rules, target, others[:number], seed)
        except WorldError:
            continue
    return _with_objects(folder, rules, target, (), seed)


def _with_objects(folder: Path, rules: dict[str, Any], target: str, others: Sequence[str], seed: int) -> World:
    """The room of a folder with these objects. Raises WorldError when they do not fit."""
    models = [("target", target), *((f"other_{n}", each) for n, each in enumerate(others))]
    objects = [{"name": name, "model": model, "surfaces": [TAKEN]} for name, model in models]
    text = yaml.safe_dump({**rules, "objects": objects}, sort_keys=False)
    (folder / "objects.yaml").write_text(text, encoding="utf-8")
    world = load_world(str(folder))
    place_objects(world, seed)
    return world
