"""The small room of skill tests: its knowledge (`small_room.yaml`), and the world folder for the plant."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import cv2
import yaml

from executive.words.knowledge import Knowledge
from skills.files.yaml_source import read_yaml
from skills.testing.blocks import ROOM, Block, grid_of

_FLOOR = Block(-2.1, -2.6, 4.1, 2.6, -0.1, 0.0, (150, 140, 130))
_BANDS = {"scan": (0.7, 1.3), "keepout": (0.05, 1.0)}
_RESOLUTION_M = 0.025


def write_small_room(folder: Path, *, can: bool = True) -> Path:
    """Writes the world into `folder` and returns it. Its only object is a can on the table, placed by the seed."""
    (folder / "map").mkdir(parents=True, exist_ok=True)
    (folder / "room.sdf").write_text(_sdf([_FLOOR, *ROOM]), encoding="utf-8")
    model = {"add_model": {"name": "room", "file": (folder / "room.sdf").resolve().as_uri()}}
    weld = {"add_weld": {"parent": "world", "child": "room::room"}}
    _write_yaml(folder / "world.dmd.yaml", {"directives": [model, weld]})
    _write_yaml(folder / "knowledge.yaml", _facts()["knowledge"])
    objects = _facts()["objects"]
    _write_yaml(folder / "objects.yaml", objects if can else {**objects, "objects": []})
    for name, band_m in _BANDS.items():
        _write_map(folder / "map", name, band_m)
    return folder


def room_knowledge() -> Knowledge:
    """Returns the knowledge of the small room."""
    return Knowledge.model_validate(_facts()["knowledge"])


def _write_yaml(path: Path, data: Mapping[str, Any]) -> None:
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")


@cache
def _facts() -> dict[str, Any]:
    """Reads the knowledge and the objects of the room."""
    facts: dict[str, Any] = read_yaml(Path(__file__).with_suffix(".yaml")).data
    return facts


def _write_map(folder: Path, name: str, band_m: tuple[float, float]) -> None:
    grid = grid_of(ROOM, band_m, _RESOLUTION_M)
    grey = grid.grey(free=254, unknown=205, occupied=0)
    cv2.imwrite(str(folder / f"{name}.pgm"), grey[::-1])
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
    """Returns an SDF file with one fixed model of all blocks."""
    shapes = "\n".join(_shapes(number, block) for number, block in enumerate(blocks))
    model = f'<model name="room"><link name="room">\n{shapes}\n</link></model>'
    return f'<?xml version="1.0"?>\n<sdf version="1.9">{model}</sdf>\n'


def _shapes(number: int, block: Block) -> str:
    x, y, z = (0.5 * (block.x0 + block.x1), 0.5 * (block.y0 + block.y1), 0.5 * (block.z0 + block.z1))
    size = f"{block.x1 - block.x0:.6g} {block.y1 - block.y0:.6g} {block.z1 - block.z0:.6g}"
    pose = f"<pose>{x:.6g} {y:.6g} {z:.6g} 0 0 0</pose>"
    box = f"<geometry><box><size>{size}</size></box></geometry>"
    colour = " ".join(f"{channel / 255:.3f}" for channel in block.colour)
    material = f"<material><diffuse>{colour} 1</diffuse></material>"
    name = quoteattr(f"block_{number}")
    return f"<visual name={name}>{pose}{box}{material}</visual><collision name={name}>{pose}{box}</collision>"
