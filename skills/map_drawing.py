"""Drawing on maps: labels that overlap as little as possible, and a legend with a scale bar below the map.

Pictures are (H, W, 3) uint8 arrays; colours have the channel order of the picture.
"""

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from types import MappingProxyType
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.robot import FloatArray, Picture

Colour = tuple[int, int, int]
INK: Final[Colour] = (25, 25, 25)
PLATE: Final[Colour] = (255, 255, 255)
ZONE_COLOURS: Final[Mapping[str, Colour]] = MappingProxyType(
    {
        "keep_out": (200, 30, 40),
        "speed_limit": (214, 140, 0),
        "one_way": (0, 114, 178),
        "preferred": (0, 140, 100),
        "silent": (125, 91, 166),
    }
)
"""Colours of zones by kind: red, green, blue."""
_ZONE_SHARE: Final = 0.22
_HATCH_PX: Final = 14
_FONT: Final = cv2.FONT_HERSHEY_SIMPLEX
_PAD_PX: Final = 5
_STEP_PX: Final = 4.0
_SHIFTS: Final = (0.0, -1.0, 1.0, -2.0, 2.0, -3.5, 3.5)
_LENGTHS_M: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


class Names:
    """Writes labels on a picture, each near its point and clear of other labels, marks and `lines` (N, 2 each)."""

    def __init__(self, picture: Picture, lines: Iterable[FloatArray]) -> None:
        self._picture, self._lines = picture, np.vstack([np.zeros((0, 2)), *map(_dense, lines)])
        self._taken: list[NDArray[np.float64]] = []

    def keep_clear(self, centre: Sequence[float], radius_px: float) -> None:
        """Keeps labels off a mark, a disc in pixels."""
        self._taken.append(np.array([*np.subtract(centre, radius_px), *np.add(centre, radius_px)], dtype=np.float64))

    def write(self, name: str, centre: Sequence[float], *, ground: Colour = PLATE) -> None:
        """Writes a label as near to a pixel (column, row) as other labels and lines allow."""
        size = np.array(text_size(name, self._picture), dtype=np.float64) + 2 * _PAD_PX
        most = np.maximum(np.array(self._picture.shape[1::-1]) - size, 0.0)
        shifts = np.array([*product(_SHIFTS, _SHIFTS)]) * (0.6 * size[0], size[1])
        corners = np.clip(np.array(centre) + shifts - size / 2.0, 0.0, most)
        boxes = np.hstack([corners, corners + size])
        best = boxes[np.argmin(self._costs(boxes, np.array(centre), size[1]))]
        self._taken.append(best)
        label(self._picture, name, (round(best[0]) + _PAD_PX, round(best[3]) - _PAD_PX), ground=ground)

    def _costs(self, boxes: FloatArray, centre: FloatArray, height: float) -> FloatArray:
        """Costs of boxes (N, 4) for a label: the area that each covers, and its distance from the label's point."""
        low, high, taken = boxes[:, None, :2], boxes[:, None, 2:], np.reshape(self._taken, (-1, 4))
        overlaps = np.maximum(np.minimum(high, taken[:, 2:]) - np.maximum(low, taken[:, :2]), 0.0)
        on_lines = np.all((self._lines >= low) & (self._lines <= high), axis=2).sum(axis=1)
        away = np.linalg.norm((boxes[:, :2] + boxes[:, 2:]) / 2.0 - centre, axis=1)
        return np.asarray(100.0 * overlaps.prod(axis=2).sum(axis=1) + 0.3 * np.minimum(on_lines, 20) * height + away)


def _dense(line: FloatArray) -> FloatArray:
    """Resamples a polyline to points a few pixels apart."""
    if len(line) < 2:
        return line
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.arange(0.0, along[-1], _STEP_PX)
    return np.column_stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)])


def with_legend(picture: Picture, pixels_per_m: float, entries: Sequence[tuple[str, Colour]]) -> Picture:
    """Returns the picture with a strip below it: a scale bar of a round length, and the meaning of each colour."""
    width = picture.shape[1]
    line_h, gap = round(2.6 * text_size("X", picture)[1]) + 4, max(8, width // 60)
    length_m = max((step for step in _LENGTHS_M if step * pixels_per_m <= width / 4.0), default=_LENGTHS_M[0])
    bar = round(length_m * pixels_per_m)
    spots, x, row = [], gap + bar + text_size(f"{length_m:g} m", picture)[0] + 3 * gap, 0
    for text, _ in entries:
        wide = 2 * gap + text_size(text, picture)[0]
        if x + wide > width - gap and x > gap:
            x, row = gap, row + 1
        spots.append((x, round((row + 0.5) * line_h)))
        x += wide + 2 * gap
    strip = np.full((line_h * (row + 1) + 4, width, 3), 255, dtype=np.uint8)
    middle = line_h // 2
    for start, end in (
        ((gap, middle), (gap + bar, middle)),
        *(((x, middle - 6), (x, middle + 6)) for x in (gap, gap + bar)),
    ):
        cv2.line(strip, start, end, INK, 2, cv2.LINE_AA)
    _text(strip, f"{length_m:g} m", (2 * gap + bar, middle), picture)
    for (text, colour), (left, y) in zip(entries, spots, strict=True):
        cv2.rectangle(strip, (left, y - 4), (left + gap, y + 4), colour, cv2.FILLED)
        cv2.rectangle(strip, (left, y - 4), (left + gap, y + 4), INK, 1)
        _text(strip, text, (left + 2 * gap, y), picture)
    return np.asarray(np.vstack([picture, strip]), np.uint8)


def draw_zone(
    picture: Picture, outlines: Sequence[NDArray[np.int32]], kind: str, colour: Colour, ahead: float | None
) -> None:
    """Tints a zone within outlines (N x 2 pixels each); hatches a keep-out zone; draws an arrow to `ahead` (rad)."""
    inside = cv2.fillPoly(np.zeros(picture.shape[:2], np.uint8), list(outlines), 1).astype(bool)
    share = np.full(picture.shape[:2], _ZONE_SHARE)
    if kind == "keep_out":
        share[np.add(*np.indices(share.shape)) % _HATCH_PX < 2] = 0.8
    tinted = picture + share[..., None] * (np.array(colour) - picture)
    picture[inside] = tinted.astype(np.uint8)[inside]
    cv2.polylines(picture, list(outlines), True, colour, 2, cv2.LINE_AA)
    for outline in outlines if ahead is not None else ():
        middle = outline.mean(axis=0)
        step = 0.2 * np.ptp(outline, axis=0).max() * np.array([np.cos(ahead or 0.0), -np.sin(ahead or 0.0)])
        start, end = (np.round(middle + sign * step).astype(int).tolist() for sign in (-1, 1))
        cv2.arrowedLine(picture, start, end, colour, 3, cv2.LINE_AA, tipLength=0.25)


def _text(strip: Picture, text: str, left_middle: tuple[int, int], like: Picture) -> None:
    """Writes a text in the font size that suits the picture `like`."""
    origin = (left_middle[0], left_middle[1] + text_size("X", like)[1] // 2)
    cv2.putText(strip, drawable(text), origin, _FONT, _font_scale(like), INK, _stroke(like), cv2.LINE_AA)


def label(picture: Picture, text: str, origin: tuple[int, int], *, ground: Colour = PLATE) -> None:
    """Writes text on a filled box whose lower left corner is at a pixel; shifts the box to lie inside the picture."""
    (width, height), pad = text_size(text, picture), _PAD_PX
    x = int(np.clip(origin[0], pad, max(pad, picture.shape[1] - width - pad)))
    y = int(np.clip(origin[1], height + pad, max(height + pad, picture.shape[0] - 2 * pad)))
    cv2.rectangle(picture, (x - pad, y - height - pad), (x + width + pad, y + pad + 2), ground, cv2.FILLED, cv2.LINE_AA)
    cv2.putText(picture, drawable(text), (x, y), _FONT, _font_scale(picture), INK, _stroke(picture), cv2.LINE_AA)


def text_size(text: str, picture: Picture) -> tuple[int, int]:
    """Width and height (pixels) of a text in the font size that suits a picture."""
    (width, height), _ = cv2.getTextSize(drawable(text), _FONT, _font_scale(picture), _stroke(picture))
    return int(width), int(height)


def drawable(text: str) -> str:
    """Returns the text without accents, because OpenCV draws only ASCII letters."""
    return unicodedata.normalize("NFKD", text.replace("ß", "ss")).encode("ascii", "ignore").decode() or "?"


def _font_scale(picture: Picture) -> float:
    return float(np.clip(picture.shape[1] / 1600.0, 0.5, 1.2))


def _stroke(picture: Picture) -> int:
    return 2 if picture.shape[1] >= 1000 else 1
