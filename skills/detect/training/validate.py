"""How good a network's file is, by the same detector and figures that will judge it later."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detect.onnx_detector import DetectorOptions, load_detector
from skills.detect.scoring import Score, score
from skills.detect.scoring_labels import LabelledPicture, pictures_of_coco
from skills.detect.training.labels import TrainingDataError

__all__ = ["Examination", "examination", "examine"]

LEAST_SCORE = 0.02


@dataclass(frozen=True)
class Examination:
    """Pictures of a data set that are not learnt from, their labels, and the classes."""

    folder: Path
    pictures: Sequence[LabelledPicture]
    class_names: Sequence[str]


def examination(folder: Path, class_names: Sequence[str], most: int | None = None) -> Examination:
    """The pictures of `val.json`, or about `most` of them, evenly chosen. Raises TrainingDataError."""
    mend = "render the data set anew"
    try:
        pictures = pictures_of_coco(json.loads((folder / "val.json").read_text(encoding="utf-8")), class_names)
    except (OSError, ValueError) as error:
        raise TrainingDataError(f"{folder / 'val.json'}: cannot be used ({error})", mend=mend) from error
    step = 1 if most is None else max(1, len(pictures) // most)
    return Examination(folder, pictures[::step], class_names)


def examine(model: Path, exam: Examination) -> Score:
    """The figures of an ONNX file."""
    detector = load_detector(model, DetectorOptions(threshold=LEAST_SCORE))
    found = [detector.detect([_read(exam.folder / picture.file)])[0] for picture in exam.pictures]
    return score(exam.pictures, found, exam.class_names)


def _read(file: Path) -> NDArray[np.uint8]:
    picture = cv2.imread(str(file), cv2.IMREAD_COLOR_RGB)
    if picture is None:
        raise TrainingDataError(f"{file}: is no picture, or damaged", mend="render the data set anew")
    return np.asarray(picture, dtype=np.uint8)
