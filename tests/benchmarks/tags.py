"""How well AprilTags are found and placed in the pictures of a robot's own cameras, in the plant's flat.

`python -m tests.benchmarks.tags --camera hand --size 0.1 --distance 2.5 --tilt 45 --views 100 --seed 1` sets up plates
at random places of the flat. It takes pictures from that distance, with the face of the tag turned away from the line
of sight by that angle, anywhere in the middle of the picture, by the plant's light and noise. It prints the share that
is found, and the errors of position and rotation (median, 95 %).
"""

import tempfile
from pathlib import Path

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from errand_make.tags import write_plate
from plant.robots.spot.description import CAMERAS
from plant.sensors.camera_spec import load_cameras
from skills.perception.fiducials import find_tags
from tests.benchmarks.flat_scene import FlatScene
from tests.benchmarks.harness import command, quantile

VIEWS_OF_A_PLATE = 20
MOST_TAG = 586
TRIES = 1000
FRONT = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
"""Rotation of a tag that faces the camera upright."""
UPRIGHT = RotationMatrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""Rotation of an upright tag that looks along x."""


def sights(spec, size_m, distance_m, tilt_deg, views, seed):
    """Views of random tags, None where a tag is not found; the same for the same seed."""
    rng = np.random.default_rng([seed, 11])
    for first in range(0, views, VIEWS_OF_A_PLATE):
        tag, place = int(rng.integers(MOST_TAG + 1)), rng.uniform((8.0, 2.2, 0.7), (8.4, 3.6, 1.3))
        X_WT = RigidTransform(RotationMatrix.MakeZRotation(float(rng.uniform(-0.6, 0.6))) @ UPRIGHT, place)
        with tempfile.TemporaryDirectory(prefix="errand-tag-") as folder:
            flat = FlatScene([(write_plate(Path(folder), tag, size_m), X_WT)])
            for _ in range(min(VIEWS_OF_A_PLATE, views - first)):
                tried = (X_WT @ _seen_from(rng, spec, distance_m, tilt_deg).inverse() for _ in range(TRIES))
                X_WC = next(X for X in tried if _in_room(X.translation()))
                yield _judged(find_tags(flat.image(rng, spec, X_WC), {tag: size_m}), X_WT)


def _in_room(p_W):
    return bool(np.all(p_W > (7.7, 0.3, 0.3)) and np.all(p_W < (11.7, 5.1, 1.6)))


def _seen_from(rng, spec, distance_m, tilt_deg):
    """Pose X_CT of a tag at a random place in the middle of the picture, tilted in a random direction and turned."""
    lens, about = spec.intrinsics(), float(rng.uniform(0.0, 2.0 * np.pi))
    u, v = rng.uniform(0.2, 0.8, 2) * (lens.width, lens.height)
    ray = np.array([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0])
    ray /= np.linalg.norm(ray)
    aside = np.cross([0.0, 0.0, 1.0], ray)
    towards = RotationMatrix(AngleAxis(float(np.arcsin(np.linalg.norm(aside))), aside / np.linalg.norm(aside)))
    tilt = RotationMatrix(AngleAxis(np.radians(tilt_deg), np.array([np.cos(about), np.sin(about), 0.0])))
    turn = RotationMatrix.MakeZRotation(float(rng.uniform(0.0, 2.0 * np.pi)))
    return RigidTransform(towards @ tilt @ FRONT @ turn, distance_m * ray)


def _judged(found, X_WT):
    if not found:
        return None
    off = X_WT.inverse() @ found[0].X_OT
    angle = float(np.degrees(off.rotation().ToAngleAxis().angle()))
    sure = {"error_px": found[0].error_px, "ambiguity": found[0].ambiguity}
    return {"off_m": float(np.linalg.norm(off.translation())), "off_deg": angle, **sure}


def summary(seen):
    """Share found, and medians and 95th percentiles of the errors."""
    found = [each for each in seen if each is not None]
    figures = {"views": len(seen), "found": len(found) / len(seen)}
    for name in ("off_m", "off_deg", "error_px", "ambiguity"):
        values = [each[name] for each in found]
        figures |= {f"{name}_50": quantile(values, digits=4), f"{name}_95": quantile(values, 0.95, 4)}
    return figures


def measure(
    camera: str = "hand", size: float = 0.1, distance: float = 2.5, tilt: float = 45.0, views: int = 100, seed: int = 1
):
    seen = list(sights(load_cameras(CAMERAS)[camera], size, distance, tilt, views, seed))
    setting = {"camera": camera, "size_m": size, "distance_m": distance, "tilt_deg": tilt, "seed": seed}
    return {**setting, **summary(seen)}


if __name__ == "__main__":
    command(measure)
