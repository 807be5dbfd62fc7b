"""What is written down while learning: the course of it, a picture of its curves, and where to go on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["Course", "draw_curves"]

_SIZE: Final = (360, 640)
_MARGIN: Final = 48
_COLOURS: Final = ((60, 60, 200), (200, 120, 0), (40, 150, 40), (160, 40, 160))


@dataclass
class Course:
    """Rows of figures by name, each with the share of the time (`progress`) at which they were taken."""

    steps: list[dict[str, float]] = field(default_factory=list)
    exams: list[dict[str, float]] = field(default_factory=list)

    def state(self) -> dict[str, Any]:
        """All of it as plain values."""
        return {"steps": self.steps, "exams": self.exams}

    @staticmethod
    def of(state: Mapping[str, Any]) -> Course:
        """From plain values."""
        return Course(list(state["steps"]), list(state["exams"]))


def draw_curves(course: Course, file: Path) -> None:
    """A PNG of two charts: losses while learning, and figures on pictures that are not learnt from."""
    charts = [
        _chart("losses", course.steps, ("scores", "boxes")),
        _chart("held-out pictures", course.exams, ("mAP50", "mAP50-95", "precision", "recall")),
    ]
    cv2.imwrite(str(file), np.concatenate(charts, axis=1))


def _chart(title: str, rows: Sequence[Mapping[str, float]], names: Sequence[str]) -> NDArray[np.uint8]:
    canvas = np.full((*_SIZE, 3), 255, dtype=np.uint8)
    values = [row[name] for row in rows for name in names if row.get(name) is not None]
    top = max([1e-6, *np.percentile(values, [99]).tolist()]) if values else 1.0
    _frame(canvas, title, top)
    for name, colour, k in zip(names, _COLOURS, range(len(names)), strict=False):
        points = [_place(row["progress"], row[name] / top) for row in rows if row.get(name) is not None]
        cv2.polylines(canvas, [np.array(points, dtype=np.int32).reshape(-1, 1, 2)], False, colour, 1, cv2.LINE_AA)
        _write(canvas, name, (_SIZE[1] - 140, 20 + 18 * k), colour)
    return canvas


def _frame(canvas: NDArray[np.uint8], title: str, top: float) -> None:
    cv2.rectangle(canvas, _place(0.0, 1.0), _place(1.0, 0.0), (120, 120, 120), 1)
    _write(canvas, title, (_MARGIN, 20), (0, 0, 0))
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        x, y = _place(0.0, share)
        cv2.line(canvas, (x, y), _place(1.0, share), (225, 225, 225), 1)
        _write(canvas, f"{share * top:.2f}", (4, y + 4), (0, 0, 0))


def _place(across: float, up: float) -> tuple[int, int]:
    height, width = _SIZE
    up = min(max(up, 0.0), 1.05)
    return int(_MARGIN + across * (width - 2 * _MARGIN)), int(height - _MARGIN - up * (height - 2 * _MARGIN))


def _write(canvas: NDArray[np.uint8], text: str, at: tuple[int, int], colour: tuple[int, int, int]) -> None:
    cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
