"""Compares exported detectors in Errand with the runtimes from which they come.

    python -m tests.benchmarks.exported_detectors MODELS PICTURES

MODELS holds pairs of NAME.onnx and NAME.json; the JSON has `pictures`, by file name the rows [class, score, u0, v0, u1,
v1] of the network's own runtime, its `threshold`, and the `options` of a stack file that the export needs. A row is
found when the other side has a box of its class within 1 pixel with a score within 0.01. A row that is not is counted

- at the edge, when its score lies within 0.01 of the threshold: the other side may have just left it out;
- tied, when the other side has a box of its class with a score within 0.01 that overlaps it by more than half, so that
  rounding decides which of both suppresses the other, or a box which only such a tie let in;
- else as missing, of the runtime's rows, or as extra, of ours.

Boxes without area in the picture are left out. The exit status is 0 when no network has missing or extra rows.
"""

import json
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from errand_make.detectors.exported import ExportedNetwork, load_exported
from executive.app.report.pictures import read_picture
from skills.perception.detector.boxes import overlaps

MOST_PX, MOST_SCORE, TIE_OVERLAP = 1.0, 0.01, 0.5


@dataclass(frozen=True)
class Rows:
    """Detections in a picture: names (N,), scores (N,) and boxes (N, 4)."""

    names: np.ndarray
    scores: np.ndarray
    boxes: np.ndarray

    @classmethod
    def of(cls, rows):
        rows = [row for row in rows if row[4] > row[2] and row[5] > row[3]]
        values = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 5)
        return cls(np.array([row[0] for row in rows], dtype=str), values[:, 0], values[:, 1:])


@dataclass
class Comparison:
    """Numbers of rows by kind, and the largest differences of box and score among the rows that are found."""

    counts: Counter = field(default_factory=Counter)
    box_px: float = 0.0
    score: float = 0.0

    @property
    def equal(self):
        return self.counts["found"] > 0 and not self.counts["missing"] and not self.counts["extra"]

    def add(self, theirs, ours, threshold):
        """Adds a picture."""
        px = np.abs(theirs.boxes[:, None] - ours.boxes[None]).max(axis=2, initial=0.0)
        score = np.abs(theirs.scores[:, None] - ours.scores[None])
        same = theirs.names[:, None] == ours.names[None]
        fits = same & (px <= MOST_PX) & (score <= MOST_SCORE)
        for row in np.flatnonzero(fits.any(axis=1)):
            best = np.where(fits[row], np.maximum(px[row] / MOST_PX, score[row] / MOST_SCORE), np.inf).argmin()
            self.box_px, self.score = max(self.box_px, px[row, best]), max(self.score, score[row, best])
        close = same & (overlaps(theirs.boxes, ours.boxes) > TIE_OVERLAP)
        lone = [~fits.any(axis=1), ~fits.any(axis=0)]
        tied = [
            lone[0] & (close & (score <= MOST_SCORE)).any(axis=1),
            lone[1] & (close & (score <= MOST_SCORE)).any(axis=0),
        ]
        tied = [
            tied[0] | (lone[0] & (close & tied[1]).any(axis=1)),
            tied[1] | (lone[1] & (close & tied[0][:, None]).any(axis=0)),
        ]
        for side, title in enumerate(("missing", "extra")):
            edge = lone[side] & ((theirs, ours)[side].scores <= threshold + MOST_SCORE)
            self.counts["edge"] += int(edge.sum())
            self.counts["tied"] += int((tied[side] & ~edge).sum())
            self.counts[title] += int((lone[side] & ~edge & ~tied[side]).sum())
        self.counts["found"] += int((~lone[0]).sum())
        self.counts["theirs"] += len(theirs.scores)
        self.counts["ours"] += len(ours.scores)


def compare(file: Path, pictures: Path) -> Comparison:
    reference = json.loads(file.with_suffix(".json").read_text())
    options = TypeAdapter(ExportedNetwork).validate_python({"file": file, **reference["options"]})
    detector = load_exported(options, reference["threshold"], every=True)
    result = Comparison()
    for name, rows in reference["pictures"].items():
        found = detector.detect([read_picture(pictures / name)])[0]
        ours = Rows.of([(one.class_name, one.score, *one.box) for one in found])
        result.add(Rows.of(rows), ours, reference["threshold"])
    return result


def main(models: Path, pictures: Path) -> bool:
    kinds = ("theirs", "ours", "found", "edge", "tied", "missing", "extra")
    print(f"{'network':20s}", *(f"{kind:>7s}" for kind in kinds), "  box, px   score")
    results = []
    for file in sorted(models.glob("*.json")):
        one = compare(file.with_suffix(".onnx"), pictures)
        counts = (f"{one.counts[kind]:7d}" for kind in kinds)
        print(f"{file.stem:20s}", *counts, f"{one.box_px:9.3f} {one.score:7.4f}", flush=True)
        results.append(one)
    return bool(results) and all(one.equal for one in results)


if __name__ == "__main__":
    sys.exit(0 if main(Path(sys.argv[1]), Path(sys.argv[2])) else 1)
