"""How good a network's file is, by the same detector and figures that will judge it later."""

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
from skills.detection import Detection
from skills.perception.detector.model_files import load_model
from skills.perception.detector.onnx_detector import DetectorOptions, OnnxDetector

LEAST_SCORE = 0.02
CALIBRATED_BY: Final = 3600
"""By how many pictures the shifts of scores are found."""


@dataclass(frozen=True)
class Examination:
    """Pictures of a data set that are not trained on, their labels, and the classes."""

    folder: Path
    pictures: Sequence[LabelledPicture]
    class_names: Sequence[str]


def examination(folder: Path, split: str, class_names: Sequence[str], most: int | None = None) -> Examination:
    """The pictures of `train` or `val`, or about `most` of them, evenly chosen. Raises TrainingDataError.

    Those of crowded scenes are left out, since in them more of what is seen is an object than elsewhere.
    """
    file = folder / f"{split}.json"
    try:
        found = pictures_of_coco(json.loads(file.read_text(encoding="utf-8")), class_names)
    except (OSError, ValueError) as error:
        raise TrainingDataError(f"{file}: cannot be used ({error})", hint="render the data set again") from error
    pictures = [one for one in found if not one.crowded]
    step = 1 if most is None else max(1, len(pictures) // most)
    return Examination(folder, pictures[::step], class_names)


def examine(model: Path, exam: Examination, *, networks: int) -> Score:
    """The figures of an ONNX file, and of those beside it, up to so many `networks`."""
    return score(exam.pictures, _found(model, exam, networks), exam.class_names)


def offsets_by(model: Path, exam: Examination, *, networks: int) -> tuple[float, ...]:
    """What to add to the logits of each class, by the pictures of an examination."""
    return score_offsets(exam.pictures, _found(model, exam, networks), exam.class_names)


def _found(model: Path, exam: Examination, networks: int) -> list[tuple[Detection, ...]]:
    detector = OnnxDetector(load_model(model, networks=networks), DetectorOptions(threshold=LEAST_SCORE))
    return [detector.detect([read_picture(exam.folder / picture.file)])[0] for picture in exam.pictures]
