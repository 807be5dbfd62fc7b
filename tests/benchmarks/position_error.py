"""How far from their true middles things are said to be, from the camera at capture; prints JSON.

    python -m tests.benchmarks.position_error [--scenes 10] [--seed 2] [--folder FOLDER] [--detector]

Boxes are the true ones, with `--detector` the detector's own. `--folder` stores the pictures of `position_scenes` for
further measurements: a folder that holds some is read. Counted are the things within 2 m that are at least 24 pixels
long, 8 wide and 40 % visible; the middle is the bounding box's.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform

from executive.app.placed_robots import shared_detector
from skills.api import Detection, LocalisationEstimate
from skills.detection import box_overlap
from skills.perception.detection_3d import detections_3d
from tests.benchmarks.harness import command, quantile, share
from tests.benchmarks.position_scenes import Shot, Truth, counts, shots, stored_shots

HERE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)
SAME_BOX, WHOLE, UNCUT = 0.5, 0.8, 0.05
COVERED = 16.3
"""Quantile of 99.9 % of chi squared with three degrees of freedom."""


@dataclass(frozen=True)
class Miss:
    """Error of one thing's position (m), and how that fits the covariance; None where it got no place."""

    truth: Truth
    off_m: float | None = None
    mahalanobis2: float = 0.0


def misses(shot: Shot, found: Sequence[Detection]) -> Iterator[Miss]:
    """Error of each thing that counts and has a box of its class."""
    X_OC = shot.image.frames.pose(shot.image.camera_frame)
    placed = {id(each.detection): each for each in detections_3d(shot.image, HERE, found, ())}
    for truth in filter(counts, shot.truths):
        box = next((each for each in found if _same(each, truth.detection)), None)
        seen = placed.get(id(box))
        if seen is not None:
            off = seen.position_W - X_OC @ truth.p_CT
            yield Miss(truth, float(np.linalg.norm(off)), float(off @ np.linalg.solve(seen.covariance, off)))
        elif box is not None:
            yield Miss(truth)


def _same(found: Detection, truth: Detection) -> bool:
    return found.class_name == truth.class_name and box_overlap(found.box, truth.box) >= SAME_BOX


def measure(scenes: int = 10, seed: int = 2, folder: Path | None = None, detector: bool = False) -> dict[str, object]:
    """Quantiles (cm) of all, of those that the picture's edge does not cut, of those seen whole, and by class."""
    found = list[Miss]()
    for shot in shots(seed, scenes) if folder is None else stored_shots(folder, seed, scenes):
        true = tuple(truth.detection for truth in shot.truths)
        found += misses(shot, shared_detector().detect([shot.image.colour])[0] if detector else true)
    uncut = [each for each in found if each.truth.truncation < UNCUT]
    names = sorted({each.truth.detection.class_name for each in found})
    return {
        "all": _figures(found),
        "uncut": _figures(uncut),
        "whole": _figures([each for each in uncut if each.truth.visibility > WHOLE]),
        "by_class": {n: _figures([each for each in found if each.truth.detection.class_name == n]) for n in names},
    }


def _figures(found: Sequence[Miss]) -> dict[str, object]:
    placed = [each for each in found if each.off_m is not None]
    offs_cm = [100.0 * each.off_m for each in placed if each.off_m is not None]
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
