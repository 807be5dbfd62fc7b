"""How far from their true middles things are said to be, from the camera at capture; prints JSON.

`python -m tests.benchmarks.position_error --scenes 40 --seed 2` takes true boxes, `--detector` the detector's own. Of
the things within 2 m that are at least 24 pixels long, 8 wide and 40 % visible; the middle is the bounding box's.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform

from executive.app.placed_robots import shared_detector
from skills.api import Detection, LocalisationEstimate
from skills.detection import box_overlap
from skills.perception.detection_3d import detections_3d
from tests.benchmarks.position_scenes import Shot, Truth, counts, load, shots

Boxes = Callable[[Shot], tuple[Detection, ...]]
HERE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)
SAME_BOX = 0.5
WHOLE, UNCUT = 0.8, 0.05


@dataclass(frozen=True)
class Miss:
    """How far off one thing was said to be (m), and how that fits the covariance; None where it got no place."""

    truth: Truth
    off_m: float | None
    mahalanobis2: float | None


def true_boxes(shot: Shot) -> tuple[Detection, ...]:
    """What a perfect detector would find."""
    return tuple(truth.detection for truth in shot.truths)


def detected_boxes(shot: Shot) -> tuple[Detection, ...]:
    """What the detector finds."""
    assert shot.image.colour is not None
    return shared_detector().detect([shot.image.colour])[0]


def misses(shot: Shot, boxes: Boxes) -> Iterator[Miss]:
    """Of each thing that counts and has a box of its class, how far off it is."""
    found = boxes(shot)
    X_OC = shot.image.frames.pose(shot.image.camera_frame)
    placed = {id(each.detection): each for each in detections_3d(shot.image, HERE, found, ())}
    for truth in filter(counts, shot.truths):
        box = next((each for each in found if _same(each, truth.detection)), None)
        if box is None:
            continue
        seen = placed.get(id(box))
        if seen is None:
            yield Miss(truth, None, None)
            continue
        off = seen.position_W - X_OC @ truth.p_CT
        yield Miss(truth, float(np.linalg.norm(off)), float(off @ np.linalg.solve(seen.covariance, off)))


def _same(found: Detection, truth: Detection) -> bool:
    return found.class_name == truth.class_name and box_overlap(found.box, truth.box) >= SAME_BOX


def summary(found: list[Miss]) -> dict[str, object]:
    """Quantiles (cm) of all, of those that the picture's edge does not cut, of those seen whole, and by class."""
    uncut = [each for each in found if each.truth.truncation < UNCUT]
    names = sorted({each.truth.detection.class_name for each in found})
    return {
        "all": _quantiles(found),
        "uncut": _quantiles(uncut),
        "whole": _quantiles([each for each in uncut if each.truth.visibility > WHOLE]),
        "by_class": {n: _quantiles([each for each in found if each.truth.detection.class_name == n]) for n in names},
    }


def _quantiles(found: list[Miss]) -> dict[str, float | int | None]:
    offs = [100.0 * each.off_m for each in found if each.off_m is not None]
    fits = [each.mahalanobis2 < 16.3 for each in found if each.mahalanobis2 is not None]
    if not offs:
        return {"things": len(found), "without_place": len(found)}
    median, p90, p95 = (round(float(value), 2) for value in np.percentile(offs, [50, 90, 95]))
    covered = round(float(np.mean(fits)), 3)
    return {
        "things": len(found),
        "without_place": len(found) - len(offs),
        "median_cm": median,
        "p90_cm": p90,
        "p95_cm": p95,
        "within_its_covariance": covered,
    }


def pictures(folder: Path | None, seed: int, scenes: int) -> Iterable[Shot]:
    """Pictures kept in a folder by `position_scenes`, or made now."""
    return shots(seed, scenes) if folder is None else (load(file) for file in sorted(folder.glob("*.npz")))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--folder", type=Path, help="pictures kept by position_scenes, in place of new ones")
    parser.add_argument("--detector", action="store_true", help="boxes of the detector in place of the true ones")
    args = parser.parse_args()
    boxes = detected_boxes if args.detector else true_boxes
    found = [each for shot in pictures(args.folder, args.seed, args.scenes) for each in misses(shot, boxes)]
    sys.stdout.write(json.dumps(summary(found), indent=1) + "\n")


if __name__ == "__main__":
    main()
