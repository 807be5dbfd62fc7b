"""Validation of a network's file by the detector and the figures of the evaluation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from errand_train.detector.calibrate import score_offsets
from errand_train.detector.labels import TrainingDataError
from errand_train.detector.scoring import Score, score
from errand_train.detector.scoring_labels import LabelledPicture, pictures_of_coco
from errand_train.detector.store import read_picture
from skills.api import Detection
from skills.perception.detector.model_files import load_model
from skills.perception.detector.onnx_detector import DetectorOptions, OnnxDetector

LEAST_SCORE = 0.02
CALIBRATED_BY: Final = 3600
"""Number of pictures that calibrate the scores."""


@dataclass(frozen=True)
class Examination:
    """Held-out pictures of a data set, their labels, and the classes."""

    folder: Path
    pictures: Sequence[LabelledPicture]
    class_names: Sequence[str]


def examination(folder: Path, split: str, class_names: Sequence[str], most: int | None = None) -> Examination:
    """Reads the pictures of `train` or `val`, or about `most` of them, evenly chosen. Raises TrainingDataError.

    Leaves out crowded scenes, since there a detection is more often an object than elsewhere.
    """
    file = folder / f"{split}.json"
    try:
        found = pictures_of_coco(json.loads(file.read_text(encoding="utf-8")), class_names).pictures
    except (OSError, ValueError, RecursionError) as error:
        raise TrainingDataError(f"{file}: cannot be used ({error})", hint="render the data set again") from error
    pictures = [one for one in found if not one.crowded]
    step = 1 if most is None else max(1, len(pictures) // most)
    return Examination(folder, pictures[::step], class_names)


def examine(model: Path, exam: Examination, *, networks: int) -> Score:
    """Evaluates an ONNX file, and those beside it, up to so many `networks`."""
    return score(exam.pictures, _found(model, exam, networks), exam.class_names)


def offsets_by(model: Path, exam: Examination, *, networks: int) -> tuple[float, ...]:
    """Offsets of each class's logits that the pictures of an examination calibrate."""
    return score_offsets(exam.pictures, _found(model, exam, networks), exam.class_names)


def _found(model: Path, exam: Examination, networks: int) -> list[tuple[Detection, ...]]:
    detector = OnnxDetector(load_model(model, networks=networks), DetectorOptions(threshold=LEAST_SCORE))
    return [detector.detect([read_picture(exam.folder / picture.file)])[0] for picture in exam.pictures]
