"""Contact sheets of models: `python -m errand_train.dataset.objects.sheet FOLDER [FAMILY ...]`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from errand_make.objects.portrait import Ball, portrait
from errand_train.dataset.objects import CLASSES, DISTRACTORS, instance
from errand_train.dataset.objects.model import ObjectModel
from plant.scene_pictures import save_png
from skills.robot import Picture


def sheet(models: Sequence[ObjectModel], columns: int, cell: tuple[int, int] = (160, 160)) -> Picture:
    """Draws a grid of models, each filling its cell (width, height)."""
    cells = [_cell(model, cell) for model in models]
    blank = np.full((cell[1], cell[0], 3), 255, np.uint8)
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[k : k + columns], axis=1) for k in range(0, len(cells), columns)]
    return np.concatenate(rows, axis=0)


def _cell(model: ObjectModel, size: tuple[int, int]) -> Picture:
    points = model.surface.points
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    ball = Ball(middle, float(np.linalg.norm(points - middle, axis=1).max()))
    picture = portrait(model.obj_path, ball, model.size_m, size)
    cv2.putText(
        picture, f"{model.seed} {model.kind}", (3, size[1] - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.35, (20, 20, 20), 1
    )
    return np.asarray(picture, dtype=np.uint8)


def main(arguments: Sequence[str]) -> None:
    """Writes one sheet for each category, and one of all distractors."""
    folder, categories = Path(arguments[0]), arguments[1:] or [*CLASSES, "distractors"]
    for category in categories:
        if category == "distractors":
            models = [instance(name, k) for name in DISTRACTORS for k in range(2)]
        else:
            models = [instance(category, k) for k in range(48 if category in CLASSES else 8)]
        save_png(folder / f"{category}.png", sheet(models, 8))


if __name__ == "__main__":
    main(sys.argv[1:])
