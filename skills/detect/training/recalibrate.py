"""Shifts the scores of a detector's last network anew, so that 0.5 is the best threshold of each class.

    python -m skills.detect.training.recalibrate DIR/errand_detector.onnx --data PICTURES

For networks that no training wrote: means of several, or those that reckon with 8 bits. Needs no torch.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

import numpy as np
import onnx

from skills.detect.detector_file import load_model, regions_file, third_file
from skills.detect.network_file import ModelFileError
from skills.detect.training.command import exit_code_of
from skills.detect.training.labels import TrainingDataError
from skills.detect.training.onnx_files import facts_of, offsets_fact, offsets_in, write_sealed
from skills.detect.training.validate import CALIBRATED_BY, examination, offsets_by

__all__ = ["main", "recalibrate"]

_BIAS: Final = "network.scores.bias"


def recalibrate(file: Path, data: Path) -> Path:
    """Shift the scores of the last network beside a detector's `file`, in place; gives that network's file.

    By pictures of the data set `data` that were learnt from. Raises TrainingDataError for files that cannot be used,
    and for a detector of one network.
    """
    try:
        model = load_model(file)
    except ModelFileError as error:
        raise TrainingDataError(f"{error.file}: {error.message}", mend="name a detector's ONNX file") from error
    if model.second is None:
        raise TrainingDataError(f"{file}: has no second network beside it", mend="shift the first one's by training it")
    networks, last = (2, regions_file(file)) if model.third is None else (3, third_file(file))
    exam = examination(data, "train", model.class_names, CALIBRATED_BY)
    shift_scores(last, offsets_by(file, exam, networks=networks))
    return last


def shift_scores(file: Path, offsets: tuple[float, ...]) -> None:
    """Add offsets to the logits that a second or third network's file tells, whole or not at all.

    Raises TrainingDataError for a file without them.
    """
    network = onnx.load(file)
    bias = next((one for one in network.graph.initializer if one.name == _BIAS), None)
    if bias is None:
        raise TrainingDataError(f"{file}: has no scores to shift", mend="name files that errand dataset refine wrote")
    values = onnx.numpy_helper.to_array(bias)
    bias.CopyFrom(onnx.numpy_helper.from_array((values + np.array(offsets)).astype(values.dtype), _BIAS))
    facts = facts_of(network)
    before = offsets_in(facts, len(offsets))
    shifted = offsets_fact(old + new for old, new in zip(before, offsets, strict=True))
    write_sealed(network, file, {**facts, **shifted})


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Scores of which 0.5 is the best threshold.")
    parser.add_argument("file", type=Path, help="the first network's ONNX file")
    parser.add_argument("--data", type=Path, required=True, help="the data set's folder")
    given = parser.parse_args()
    return exit_code_of(lambda: recalibrate(given.file, given.data))


if __name__ == "__main__":
    raise SystemExit(main())
