"""The plan of a world: rooms, walls, doors, hangings and furniture, read from `NAME.yaml`."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Final, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict

from skills.inputs.yaml_source import read_yaml

Rectangle = tuple[float, float, float, float]
"""(x0, y0, x1, y1)"""
PLANS: Final = ("flat", "lab", "shop")
_FACING_YAW_RAD = {"south": 0.0, "east": math.pi / 2, "north": math.pi, "west": -math.pi / 2}


class Room(NamedTuple):
    """A room: its inner rectangle, and the materials of its floor and walls."""

    name: str
    inside: Rectangle
    floor: str
    wall: str


class Door(NamedTuple):
    """An opening without a leaf; (x, y) is its middle, in the middle of the wall.

    A width of its own overrides the plan's. A door that is open to the top of the wall has no frame.
    """

    name: str
    x: float
    y: float
    along_x: bool
    own_width_m: float | None = None
    open: bool = False


class Hanging(NamedTuple):
    """A flat object on a wall: `side` of the room, position along it, centre height, width, height."""

    room: str
    side: Literal["n", "e", "s", "w"]
    along: float
    z: float
    width: float
    height: float
    material: str
    frame: str | None


class Placed(BaseModel):
    """A piece of furniture in the world; `piece` is its kind unless its name is; other keys are parameters."""

    model_config = ConfigDict(frozen=True, extra="allow")

    piece: str = ""
    at: tuple[float, float]
    facing: Literal["south", "east", "north", "west"]

    @property
    def yaw_rad(self) -> float:
        """Yaw of the piece's frame in the world (rad)."""
        return _FACING_YAW_RAD[self.facing]


class Plan(BaseModel):
    """A plan as its file holds it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    outline_m: tuple[float, float]
    wall_height_m: float
    door_width_m: float
    door_height_m: float
    rooms: tuple[Room, ...]
    walls: tuple[Rectangle, ...]
    doors: tuple[Door, ...]
    hangings: tuple[Hanging, ...]
    furniture: dict[str, Placed]

    def width_m(self, door: Door) -> float:
        """Clear width of a door (m)."""
        return self.door_width_m if door.own_width_m is None else door.own_width_m


@cache
def load_plan(name: str) -> Plan:
    """Loads the plan of one of `PLANS`."""
    return Plan.model_validate(read_yaml(Path(__file__).with_name(f"{name}.yaml")).data)
