"""Where the flat's furniture stands: (x, y) of the middle of each back on the floor, and the way that it faces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from plant.models.builder.mesh import Material
from plant.worlds.builder import furniture as f
from plant.worlds.builder.piece import Piece

FACING_YAW_RAD = {"south": 0.0, "east": math.pi / 2, "north": math.pi, "west": -math.pi / 2}


@dataclass(frozen=True)
class Placed:
    """A piece in the world; `facing` is where its front looks."""

    name: str
    piece: Piece
    x: float
    y: float
    facing: str

    @property
    def yaw_rad(self) -> float:
        """Turn of the piece's frame about the vertical."""
        return FACING_YAW_RAD[self.facing]


def layout(m: Mapping[str, Material]) -> list[Placed]:
    """All furniture of the flat, room by room."""
    return [*_kitchen(m), *_living_room(m), *_workshop(m), *_sleeping(m), *_rest(m)]


def _kitchen(m: Mapping[str, Material]) -> list[Placed]:
    return [
        Placed("kitchen_counter", f.counter(m, width=4.10, sink_x=0.50, hob_x=1.15), 9.00, 8.88, "south"),
        Placed("wall_cupboards", f.wall_cupboards(m, width=4.10, low=1.50, high=2.15, depth=0.35), 9.00, 8.88, "south"),
        Placed("microwave", f.microwave(m), 10.76, 8.88, "south"),
        Placed("pantry", f.tall_unit(m, size=(0.60, 0.60, 2.15), body="white", grid=(1, 2)), 6.62, 8.88, "south"),
        Placed("fridge", f.tall_unit(m, size=(0.66, 0.66, 1.80), body="light_grey", grid=(1, 2)), 11.44, 8.88, "south"),
        Placed(
            "kitchen_table",
            f.table(m, size=(1.10, 0.80, 0.75), top="white", leg="wood_grey", thick=0.06),
            11.85,
            6.50,
            "west",
        ),
        Placed("kitchen_chair_1", f.chair(m), 11.45, 7.32, "south"),
        Placed("kitchen_chair_2", f.chair(m), 11.45, 5.68, "north"),
    ]


def _living_room(m: Mapping[str, Material]) -> list[Placed]:
    coffee = f.table(m, size=(1.10, 0.60, 0.45), top="wood_dark", leg="charcoal")
    board = f.cabinet(m, size=(1.30, 0.45, 0.80), body="white", top="wood_grey", grid=(3, 1))
    return [
        Placed("sofa", f.sofa(m, width=2.10, cloth="cloth_grey"), 9.55, 0.16, "north"),
        Placed("coffee_table", coffee, 9.55, 1.45, "north"),
        Placed("rug", f.rug(m, width=2.60, depth=2.00), 9.55, 0.85, "north"),
        Placed("television", f.television(m), 7.52, 1.40, "east"),
        Placed("sideboard", board, 11.86, 2.85, "west"),
        Placed("living_plant", f.plant(m, height=1.40, seed=1), 11.58, 0.17, "north"),
        Placed("floor_lamp", f.floor_lamp(m), 8.10, 0.16, "north"),
        Placed("dock_mat", f.mat(m, width=1.20, depth=0.60), 11.22, 5.25, "south"),
    ]


def _workshop(m: Mapping[str, Material]) -> list[Placed]:
    return [
        Placed("workbench", f.workbench(m, width=2.40), 1.80, 8.88, "south"),
        Placed("tool_trolley", f.trolley(m), 0.13, 6.55, "east"),
        Placed("storage_rack", f.rack(m, width=1.20), 3.89, 7.75, "west"),
    ]


def _sleeping(m: Mapping[str, Material]) -> list[Placed]:
    stand = f.cabinet(m, size=(0.45, 0.45, 0.50), body="wood_dark", top="wood_dark", grid=(1, 2))
    dresser = f.cabinet(m, size=(0.90, 0.45, 0.80), body="white", top="wood_grey", grid=(1, 3))
    return [
        Placed("bed", f.bed(m), 0.13, 1.35, "east"),
        Placed("night_stand", stand, 0.13, 2.72, "east"),
        Placed("dresser", dresser, 2.75, 0.13, "north"),
        Placed("wardrobe", f.tall_unit(m, size=(1.50, 0.60, 2.10), body="wood_light", grid=(3, 1)), 3.99, 0.92, "west"),
    ]


def _rest(m: Mapping[str, Material]) -> list[Placed]:
    console = f.table(m, size=(0.60, 0.32, 0.85), top="wood_dark", leg="charcoal", thick=0.04)
    cabinet = f.cabinet(m, size=(0.80, 0.40, 0.80), body="wood_grey", top="white", grid=(2, 1))
    return [
        Placed("bathtub", f.bathtub(m, width=2.18), 5.10, 8.87, "south"),
        Placed("toilet", f.toilet(m), 4.01, 7.65, "east"),
        Placed("washbasin", f.washbasin(m), 6.19, 7.62, "west"),
        Placed("bathroom_cabinet", cabinet, 4.01, 6.35, "east"),
        Placed("laundry_basket", f.basket(m), 6.18, 6.95, "west"),
        Placed("hall_console", console, 0.13, 4.05, "east"),
        Placed("desk", f.desk(m), 6.10, 0.13, "north"),
        Placed("office_chair", f.office_chair(m), 6.45, 1.30, "south"),
        Placed("bookshelf", f.bookshelf(m, width=1.40, height=1.90, boards=5), 4.11, 1.60, "east"),
        Placed("armchair", f.sofa(m, width=0.85, cloth="cloth_sand", depth=0.80), 7.38, 2.30, "west"),
        Placed("office_plant", f.plant(m, height=1.20, seed=2), 7.15, 3.52, "south"),
    ]
