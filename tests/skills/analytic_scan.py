"""LiDAR scans of upright cylinders and a wall, computed."""

import numpy as np
from pydrake.math import RigidTransform

from skills.robot import Scan

ELEVATIONS = np.radians(np.arange(-15.0, 16.0, 2.0))
AZIMUTHS = np.radians(np.arange(-180.0, 180.0, 0.5))


def scan_of(discs=(), wall_x=None, height_m=0.52):
    """A scan with upright cylinders (x, y, radius) in the body frame and perhaps a wall across at x."""
    X_BL, X_OB = RigidTransform([-0.2, 0.0, 0.4]), RigidTransform([0.0, 0.0, height_m])
    nearest = np.full(len(AZIMUTHS), np.inf)
    heading = np.stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS)], axis=-1)
    for x, y, radius in discs:
        centre = np.array([x + 0.2, y])
        along = heading @ centre
        root = radius**2 - (centre @ centre - along**2)
        hit = np.where((root > 0) & (along > 0), along - np.sqrt(np.maximum(root, 0)), np.inf)
        nearest = np.minimum(nearest, hit)
    if wall_x is not None:
        with np.errstate(divide="ignore"):
            hit = (wall_x + 0.2) / heading[:, 0]
        nearest = np.minimum(nearest, np.where((hit > 0) & (hit < 8), hit, np.inf))
    ranges = nearest[None, :] / np.cos(ELEVATIONS)[:, None]
    ranges = np.where(np.isfinite(ranges), ranges, np.nan).astype(np.float32)
    return Scan(1.0, ranges, ELEVATIONS, AZIMUTHS, X_BL, X_OB)
