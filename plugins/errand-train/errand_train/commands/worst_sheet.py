"""Contact sheet of pictures with right, wrong and missed detections."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from errand_train.detector.scoring import Judged
from executive.app.report.pictures import FOUND_COLOUR, draw_box
from skills.robot import Picture

__all__ = ["Shown", "contact_sheet"]


TILE_PX: Final = (400, 300)
CAPTION_PX: Final = 18
COLUMNS: Final = 5
WRONG_COLOUR: Final = (240, 60, 50)
MISSED_COLOUR: Final = (250, 200, 30)


@dataclass(frozen=True)
class Shown:
    """A picture (H, W, 3) RGB with its name and its judged detections."""

    name: str
    picture: Picture
    judged: Judged


def contact_sheet(shown: Sequence[Shown]) -> Picture:
    """Draws the pictures in rows of five: green is right, red is wrong, yellow is missed."""
    tiles = [_tile(one) for one in shown]
    columns = min(COLUMNS, max(1, len(tiles)))
    rows = max(1, math.ceil(len(tiles) / columns))
    width, height = TILE_PX[0], TILE_PX[1] + CAPTION_PX
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for k, tile in enumerate(tiles):
        row, column = divmod(k, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = tile
    return sheet


def _tile(one: Shown) -> Picture:
    """One picture scaled to fit, its boxes, and its name below."""
    height, width = one.picture.shape[:2]
    scale = min(TILE_PX[0] / width, TILE_PX[1] / height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = np.asarray(cv2.resize(one.picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    for label in one.judged.missed:
        draw_box(small, _scaled(label.box, scale), label.class_name, MISSED_COLOUR)
    for found in one.judged.right:
        draw_box(small, _scaled(found.box, scale), f"{found.class_name} {found.score:.2f}", FOUND_COLOUR)
    for found in one.judged.wrong:
        draw_box(small, _scaled(found.box, scale), f"{found.class_name} {found.score:.2f}", WRONG_COLOUR)
    tile = np.full((TILE_PX[1] + CAPTION_PX, TILE_PX[0], 3), 255, dtype=np.uint8)
    tile[: size[1], : size[0]] = small
    place = (3, TILE_PX[1] + CAPTION_PX - 5)
    cv2.putText(tile, one.name[-55:], place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return tile


def _scaled(box: tuple[float, float, float, float], scale: float) -> tuple[float, float, float, float]:
    u0, v0, u1, v1 = (value * scale for value in box)
    return u0, v0, u1, v1
