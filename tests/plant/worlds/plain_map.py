"""A map_server grid, read without the code that is tested."""

from typing import Any

import cv2
import numpy as np
import yaml

FREE, UNKNOWN, OCCUPIED = 254, 205, 0


class Map:
    """Grid of a file of map_server."""

    def __init__(self, path):
        self.header: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        picture = cv2.imread(str(path.parent / self.header["image"]), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        self.cells = picture[::-1]

    def at(self, points):
        index = np.floor((points - self.header["origin"][:2]) / self.header["resolution"]).astype(int)
        return self.cells[index[..., 1], index[..., 0]]
