"""Exact localiser, costmap and detector for the scripted robot in its world of blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.api import LocalisationEstimate
from skills.detection import Detection, Detector
from skills.robot import Pose2D, Robot, Scan
from skills.testing.blocks import TABLE_CAN, Block, Colour, block_array, distances_from

OPEN_M = 9.0
_COVARIANCE = np.eye(3) * 1e-4


class KnownPlace:
    """Localiser that knows where odometry started and trusts it. Implements `skills.api.SearchingLocaliser` too.

    Set `localised` to False to simulate a lost robot. The stamp is that of the last odometry.
    """

    def __init__(self, start: Pose2D | None = None) -> None:
        self.localised = True
        self._X_WO, self._stamp_s = (start or Pose2D(0.0, 0.0, 0.0)).transform(), 0.0

    def estimate(self) -> LocalisationEstimate:
        """Latest estimate."""
        return LocalisationEstimate(self._stamp_s, self._X_WO, _COVARIANCE, self.localised)

    def update(self, robot: Robot) -> None:
        """Reads the odometry's stamp."""
        self._stamp_s = robot.odometry().stamp_s

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> LocalisationEstimate | None:
        """Returns the true pose, as a search of the whole map would."""
        return LocalisationEstimate(scan.stamp_s, self._X_WO, _COVARIANCE, True)

    def accept(self, estimate: LocalisationEstimate) -> None:
        """Marks the robot as localised; the estimate itself is exact already."""
        self._X_WO, self.localised = estimate.X_WO, True


class BlockCostmap:
    """Costmap of the blocks that the body could touch (heights 0.05 to 1.0 m). Implements `skills.api.Costmap`."""

    def __init__(self, blocks: Sequence[Block] = ()) -> None:
        self._blocks = block_array([block for block in blocks if block.z0 < 1.0 and block.z1 > 0.05])

    def clearance_m(self, points_W: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance from each point (x, y) to the nearest block (m); negative inside a block."""
        if not len(self._blocks):
            return np.full(len(points_W), OPEN_M)
        return distances_from(self._blocks, np.ascontiguousarray(points_W, dtype=np.float64))

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Does nothing: the blocks are known."""

    def add_points(self, points_W: NDArray[np.float64], stamp_s: float) -> None:
        """Does nothing: the blocks are known."""

    def clear_obstacles(self, within_W: NDArray[np.float64] | None = None) -> int:
        """Clears nothing, since there are no other obstacles, and returns 0."""
        return 0


_FEWEST_PIXELS = 6


@dataclass(frozen=True)
class PlainColours(Detector):
    """Detector that finds an object in every patch of exactly its class's colour; by default red cans are cokes."""

    colours: Mapping[str, Colour] = field(default_factory=lambda: MappingProxyType({"coke": TABLE_CAN.colour}))
    score: float = 0.9

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes that have a colour."""
        return tuple(self.colours)

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """Detects the patches in each picture, largest first; none in a grey one. Raises ValueError for no picture."""
        return [self._found(picture) for picture in pictures]

    def _found(self, picture: NDArray[np.uint8]) -> tuple[Detection, ...]:
        if picture.ndim not in (2, 3) or picture.dtype != np.uint8:
            raise ValueError(f"no picture: {picture.dtype} of shape {picture.shape}")
        if picture.ndim == 2:
            return ()
        found = [each for name, colour in self.colours.items() for each in self._patches(picture, name, colour)]
        return tuple(detection for _, detection in sorted(found, key=lambda entry: -entry[0]))

    def _patches(self, picture: NDArray[np.uint8], name: str, colour: Colour) -> list[tuple[int, Detection]]:
        mask = np.all(picture == np.array(colour, dtype=np.uint8), axis=2).astype(np.uint8)
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        rows = ((int(area), (float(x), float(y), float(x + w), float(y + h))) for x, y, w, h, area in stats[1:])
        return [(area, Detection(name, self.score, box)) for area, box in rows if area >= _FEWEST_PIXELS]
