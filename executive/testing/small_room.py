"""The small room as a world: what is known of it, and a folder from which a plant builds it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import cv2
import numpy as np
import yaml

from executive.mission.knowledge import Knowledge
from skills.testing.blocks import ROOM, Block, grid_of

TABLE = "table"
TABLE_HEIGHT_M = 0.75
TABLE_OUTLINE = [[1.2, -0.6], [1.8, -0.6], [1.8, 0.6], [1.2, 0.6]]
_OUTLINE = [[-2.0, -2.5], [4.0, -2.5], [4.0, 2.5], [-2.0, 2.5]]
_FLOOR = Block(-2.1, -2.6, 4.1, 2.6, -0.1, 0.0, (150, 140, 130))
_BANDS = {"scan": (0.7, 1.3), "keepout": (0.05, 1.0)}
_RESOLUTION_M = 0.025


def write_small_room(folder: Path, *, can: bool = True) -> Path:
    """Write the world into `folder`; that folder. Its only object is a can on the table, whose place the seed sets."""
    (folder / "map").mkdir(parents=True, exist_ok=True)
    (folder / "room.sdf").write_text(_sdf([_FLOOR, *ROOM]), encoding="utf-8")
    _write_yaml(folder / "world.dmd.yaml", _directives(folder / "room.sdf"))
    _write_yaml(folder / "knowledge.yaml", _knowledge())
    _write_yaml(folder / "objects.yaml", _objects(can))
    for name, band_m in _BANDS.items():
        _write_map(folder / "map", name, band_m)
    return folder


def room_knowledge() -> Knowledge:
    """What the robot is told of the room."""
    return Knowledge.model_validate(_knowledge())


def _write_yaml(path: Path, data: Mapping[str, Any]) -> None:
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")


def _directives(model: Path) -> dict[str, Any]:
    return {
        "directives": [
            {"add_model": {"name": "room", "file": model.resolve().as_uri()}},
            {"add_weld": {"parent": "world", "child": "room::room"}},
        ]
    }


def _knowledge() -> dict[str, Any]:
    surface = {
        "place": "room",
        "height": TABLE_HEIGHT_M,
        "polygon": TABLE_OUTLINE,
        "viewpoints": [{"x": 0.2, "y": 0.0, "yaw": 0.0}],
    }
    return {
        "robot": {"name": "Alice"},
        "start": {"x": -0.5, "y": 0.0, "yaw": 0.0},
        "dock": {"x": -1.2, "y": -1.6, "yaw": 0.0},
        "places": {"room": {"pose": {"x": 0.0, "y": 0.0, "yaw": 0.0}, "polygon": _OUTLINE}},
        "surfaces": {TABLE: surface},
        "things": {"coke": {"categories": ["drink"], "aliases": ["can"], "usual": [TABLE]}},
    }


def _objects(can: bool) -> dict[str, Any]:
    return {
        "rules": {"from_edge_m": [0.10, 0.20], "clear_m": 0.12, "rim_m": 0.03, "drop_m": 0.001},
        "fronts": {TABLE: [[[1.2, -0.4], [1.2, 0.4]]]},
        "objects": [{"name": "coke", "model": "coke", "surfaces": [TABLE]}] if can else [],
    }


def _write_map(folder: Path, name: str, band_m: tuple[float, float]) -> None:
    grid = grid_of(ROOM, band_m, _RESOLUTION_M)
    cells = np.where(grid.occupied, 0, 254).astype(np.uint8)
    cv2.imwrite(str(folder / f"{name}.pgm"), cells[::-1])
    facts = {
        "image": f"{name}.pgm",
        "mode": "trinary",
        "resolution": _RESOLUTION_M,
        "origin": [round(grid.origin_m[0], 6), round(grid.origin_m[1], 6), 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        "height_band_m": list(band_m),
    }
    _write_yaml(folder / f"{name}.yaml", facts)


def _sdf(blocks: list[Block]) -> str:
    """One fixed model of all blocks."""
    shapes = "\n".join(_shapes(number, block) for number, block in enumerate(blocks))
    model = f'<model name="room"><link name="room">\n{shapes}\n</link></model>'
    return f'<?xml version="1.0"?>\n<sdf version="1.9">{model}</sdf>\n'


def _shapes(number: int, block: Block) -> str:
    x, y, z = (0.5 * (block.x0 + block.x1), 0.5 * (block.y0 + block.y1), 0.5 * (block.z0 + block.z1))
    size = f"{block.x1 - block.x0:.6g} {block.y1 - block.y0:.6g} {block.z1 - block.z0:.6g}"
    pose = f"<pose>{x:.6g} {y:.6g} {z:.6g} 0 0 0</pose>"
    box = f"<geometry><box><size>{size}</size></box></geometry>"
    colour = " ".join(f"{channel / 255:.3f}" for channel in block.colour)
    looks = f"<material><diffuse>{colour} 1</diffuse></material>"
    name = quoteattr(f"block_{number}")
    return f"<visual name={name}>{pose}{box}{looks}</visual><collision name={name}>{pose}{box}</collision>"
