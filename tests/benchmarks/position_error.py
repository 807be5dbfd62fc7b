"""How far from their true middles things are said to be, from the camera at capture; prints JSON.

    python -m tests.benchmarks.position_error [--scenes 10] [--seed 2] [--folder FOLDER] [--detector]

Boxes are the true ones, with `--detector` the detector's own. `--folder` stores the pictures of `position_scenes` for
further measurements: a folder that holds some is read. Counted are the things within 2 m that are at least 24 pixels
long, 8 wide and 40 % visible; the middle is the bounding box's.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
from pydrake.math import RigidTransform

from executive.app.prepare.placed_robots import shared_detector
from skills.api import LocalisationEstimate
from skills.detection import box_overlap
from skills.perception.detection_3d import detections_3d
from tests.benchmarks.harness import command, for_each, quantile, share
from tests.benchmarks.position_scenes import counts, shots, stored_shots

HERE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)
SAME_BOX, WHOLE, UNCUT = 0.5, 0.8, 0.05
COVERED = 16.3
"""Quantile of 99.9 % of chi squared with three degrees of freedom."""


def misses(shot, found):
    """Error of each thing that counts and has a box of its class (m), and how it fits the covariance."""
    X_OC = shot.image.frames.pose(shot.image.camera_frame)
    placed = {id(each.detection): each for each in detections_3d(shot.image, HERE, found, ())}
    for truth in filter(counts, shot.truths):
        box = next((each for each in found if _same(each, truth.detection)), None)
        seen, off_m, mahalanobis2 = placed.get(id(box)), None, 0.0
        if seen is not None:
            off = seen.position_W - X_OC @ truth.p_CT
            off_m, mahalanobis2 = float(np.linalg.norm(off)), float(off @ np.linalg.solve(seen.covariance, off))
        if box is not None:
            own = {"class_name": box.class_name, "off_m": off_m, "mahalanobis2": mahalanobis2}
            yield SimpleNamespace(truncation=truth.truncation, visibility=truth.visibility, **own)


def _same(found, truth):
    return found.class_name == truth.class_name and box_overlap(found.box, truth.box) >= SAME_BOX


def measure(scenes: int = 10, seed: int = 2, folder: Path | None = None, detector: bool = False):
    """Quantiles (cm) of all, of those that the picture's edge does not cut, of those seen whole, and by class."""
    found = []
    for shot in shots(seed, scenes) if folder is None else stored_shots(folder, seed, scenes):
        true = tuple(truth.detection for truth in shot.truths)
        found += misses(shot, shared_detector().detect([shot.image.colour])[0] if detector else true)
    uncut = [each for each in found if each.truncation < UNCUT]
    return {
        "all": _figures(found),
        "uncut": _figures(uncut),
        "whole": _figures([each for each in uncut if each.visibility > WHOLE]),
        "by_class": for_each("class_name", _figures)(found),
    }


def _figures(found):
    placed = [each for each in found if each.off_m is not None]
    offs_cm = [100.0 * each.off_m for each in placed]
    return {
        "things": len(found),
        "without_place": len(found) - len(placed),
        "median_cm": quantile(offs_cm),
        "p90_cm": quantile(offs_cm, 0.9),
        "p95_cm": quantile(offs_cm, 0.95),
        "within_its_covariance": share([each.mahalanobis2 < COVERED for each in placed]),
    }


if __name__ == "__main__":
    command(measure)
