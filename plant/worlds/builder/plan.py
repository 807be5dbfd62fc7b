"""The flat's plan: rooms, walls and doors, in metres in the world frame (x east, y north)."""

from __future__ import annotations

from dataclasses import dataclass

WALL_HEIGHT_M = 2.5
DOOR_WIDTH_M = 0.9
DOOR_HEIGHT_M = 2.05
OUTLINE_M = (12.0, 9.0)


@dataclass(frozen=True)
class Rectangle:
    """An axis-aligned rectangle."""

    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True)
class Room:
    """A room: its free inside, and the materials of its floor and walls."""

    name: str
    inside: Rectangle
    floor: str
    wall: str


@dataclass(frozen=True)
class Wall:
    """A wall's footprint; it runs along its longer side."""

    footprint: Rectangle

    @property
    def along_x(self) -> bool:
        """True when the wall runs along x."""
        r = self.footprint
        return r.x1 - r.x0 > r.y1 - r.y0


@dataclass(frozen=True)
class Door:
    """An opening without a leaf, DOOR_WIDTH_M wide; (x, y) is its middle, in the middle of the wall."""

    name: str
    x: float
    y: float
    along_x: bool


@dataclass(frozen=True)
class Hanging:
    """Something flat on a wall: `side` of the room (n, e, s, w), position along it, centre height, width, height."""

    room: str
    side: str
    along: float
    z: float
    width: float
    height: float
    material: str
    frame: str | None = "skirting"


ROOMS = (
    Room("hall", Rectangle(0.12, 3.65, 7.40, 5.35), "oak_floor", "wall_hall"),
    Room("kitchen", Rectangle(6.30, 5.45, 11.88, 8.88), "kitchen_tiles", "wall_kitchen"),
    Room("living room", Rectangle(7.50, 0.12, 11.88, 5.35), "oak_floor", "wall_living_room"),
    Room("bedroom", Rectangle(0.12, 0.12, 4.00, 3.55), "dark_floor", "wall_bedroom"),
    Room("bathroom", Rectangle(4.00, 5.45, 6.20, 8.88), "bath_tiles", "wall_bathroom"),
    Room("workshop", Rectangle(0.12, 5.45, 3.90, 8.88), "concrete", "wall_workshop"),
    Room("office", Rectangle(4.10, 0.12, 7.40, 3.55), "oak_floor", "wall_office"),
)

WALLS = (
    Wall(Rectangle(0.0, 0.0, 12.0, 0.12)),
    Wall(Rectangle(0.0, 8.88, 12.0, 9.0)),
    Wall(Rectangle(0.0, 0.12, 0.12, 8.88)),
    Wall(Rectangle(11.88, 0.12, 12.0, 8.88)),
    Wall(Rectangle(0.12, 5.35, 11.88, 5.45)),
    Wall(Rectangle(0.12, 3.55, 7.40, 3.65)),
    Wall(Rectangle(7.40, 0.12, 7.50, 5.35)),
    Wall(Rectangle(4.00, 0.12, 4.10, 3.55)),
    Wall(Rectangle(3.90, 5.45, 4.00, 8.88)),
    Wall(Rectangle(6.20, 5.45, 6.30, 8.88)),
)

DOORS = (
    Door("hall-workshop", 2.90, 5.40, True),
    Door("hall-bathroom", 5.10, 5.40, True),
    Door("hall-kitchen", 6.85, 5.40, True),
    Door("kitchen-living room", 9.00, 5.40, True),
    Door("hall-bedroom", 3.30, 3.60, True),
    Door("hall-office", 5.60, 3.60, True),
    Door("hall-living room", 7.45, 4.50, False),
)

HANGINGS = (
    Hanging("hall", "w", 4.92, 1.02, 0.92, 2.04, "entrance_door"),
    Hanging("hall", "w", 4.05, 1.55, 0.50, 0.90, "mirror", "charcoal"),
    Hanging("hall", "n", 1.30, 1.50, 0.70, 0.50, "picture_a", None),
    Hanging("hall", "s", 1.60, 1.50, 0.70, 0.50, "picture_b", None),
    Hanging("hall", "s", 4.40, 1.50, 0.70, 0.50, "picture_a", None),
    Hanging("living room", "e", 1.20, 1.50, 1.50, 1.30, "window"),
    Hanging("living room", "s", 9.55, 1.60, 1.10, 0.75, "picture_b", None),
    Hanging("living room", "e", 2.85, 1.55, 0.90, 0.60, "picture_a", None),
    Hanging("living room", "n", 10.7, 1.55, 0.90, 0.60, "picture_b", None),
    Hanging("kitchen", "e", 6.50, 1.60, 1.20, 1.10, "window"),
    Hanging("kitchen", "s", 10.4, 1.60, 0.70, 0.50, "picture_a", None),
    Hanging("bedroom", "w", 1.35, 1.60, 0.90, 0.60, "picture_a", None),
    Hanging("bedroom", "s", 1.35, 1.60, 1.20, 1.10, "window"),
    Hanging("bathroom", "n", 5.10, 1.75, 0.80, 0.70, "window"),
    Hanging("workshop", "n", 1.80, 1.55, 2.00, 1.00, "pegboard", "charcoal"),
    Hanging("workshop", "w", 7.70, 1.60, 1.00, 0.90, "window"),
    Hanging("office", "s", 6.10, 1.60, 1.20, 1.10, "window"),
    Hanging("office", "e", 2.60, 1.55, 0.70, 0.50, "picture_b", None),
)


def room(name: str) -> Room:
    """A room by its name. Raises KeyError."""
    return {r.name: r for r in ROOMS}[name]


def openings(wall: Wall) -> list[tuple[float, float]]:
    """The door openings of a wall as intervals along it, in order."""
    r = wall.footprint
    inside = [d for d in DOORS if r.x0 <= d.x <= r.x1 and r.y0 <= d.y <= r.y1 and d.along_x == wall.along_x]
    middles = sorted(d.x if d.along_x else d.y for d in inside)
    return [(m - DOOR_WIDTH_M / 2, m + DOOR_WIDTH_M / 2) for m in middles]
