"""Contact sheet of a data set, with boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from plant.scene_pictures import save_png
from skills.robot import Picture

COLUMNS, ROWS = 8, 6
CELL_PX = (240, 180)
_COUNTED, _IGNORED = (60, 230, 60), (60, 60, 240)


def contact_sheet(folder: Path, shots: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Writes a grid of pictures spread over the data set: counted labels in green, ignored ones in red."""
    count = min(COLUMNS * ROWS, len(shots))
    chosen = [shots[k] for k in np.linspace(0, len(shots) - 1, count).astype(int)]
    cells = [_cell(folder, shot) for shot in chosen]
    cells += [np.full((CELL_PX[1], CELL_PX[0], 3), 255, np.uint8)] * (-len(cells) % COLUMNS)
    rows = [np.concatenate(cells[k : k + COLUMNS], axis=1) for k in range(0, len(cells), COLUMNS)]
    save_png(path, np.ascontiguousarray(np.concatenate(rows, axis=0)[..., ::-1]))


def _cell(folder: Path, shot: Mapping[str, Any]) -> Picture:
    image = shot["image"]
    data = np.frombuffer((folder / image["file_name"]).read_bytes(), np.uint8)
    picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if picture is None:
        raise OSError(f"{folder / image['file_name']}: is no picture")
    small = cv2.resize(picture, CELL_PX, interpolation=cv2.INTER_AREA)
    scale = CELL_PX[0] / image["width"], CELL_PX[1] / image["height"]
    for label in shot["annotations"]:
        x, y, w, h = label["bbox"]
        colour = _IGNORED if label["ignore"] else _COUNTED
        low, high = (int(x * scale[0]), int(y * scale[1])), (int((x + w) * scale[0]), int((y + h) * scale[1]))
        cv2.rectangle(small, low, high, colour, 1)
        name = label["instance"].rsplit("_", 1)[0]
        cv2.putText(small, name, (low[0], max(8, low[1] - 2)), cv2.FONT_HERSHEY_SIMPLEX, 0.3, colour, 1, cv2.LINE_AA)
    return np.asarray(small, dtype=np.uint8)
