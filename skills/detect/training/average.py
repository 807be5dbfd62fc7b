"""The mean of the weights of networks that learnt from the same beginning, as an ONNX file: often better than each.

    python -m skills.detect.training.average FILE FILE... --out FILE

After Wortsman et al., "Model soups" (2022).
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import onnx

from skills.detect.detector_file import load_model, load_regions, load_third
from skills.detect.network_file import ModelFileError, Network
from skills.detect.training.command import exit_code_of
from skills.detect.training.labels import TrainingDataError
from skills.detect.training.onnx_files import (
    EIGHT_BITS,
    facts_of,
    in_full,
    learnt_weights,
    offsets_fact,
    offsets_in,
    write_sealed,
)

__all__ = ["average", "main"]

_ALIKE = ("format", "class_names", "first", "second")
_MEND = "name files that errand dataset train or refine wrote"


def average(files: Sequence[Path], out: Path) -> None:
    """Write the mean of networks of one kind that stand beside the same one before them; whole or not at all.

    One at least must reckon with floats, as what is written does. It tells what the first of those tells, but for the
    shifts of scores, which are the mean too; `recalibrate` makes better ones. Raises TrainingDataError.
    """
    told = [_told(file) for file in files]
    floats = next((k for k, network in enumerate(told) if EIGHT_BITS not in network.metadata), None)
    if floats is None:
        raise TrainingDataError(
            f"{files[0]}: reckons with 8 bits, and so do all others",
            mend="name one at least that errand dataset train or refine wrote",
        )
    models = [onnx.load(file) for file in files]
    made, weights = models[floats], [learnt_weights(model) for model in models]
    for file, network, found in zip(files, told, weights, strict=True):
        if not _alike(network, told[floats], found, weights[floats]):
            raise TrainingDataError(f"{file}: is another network than {files[floats]}", mend=_MEND)
    for one in made.graph.initializer:
        name = in_full(one.name)
        if name in weights[floats]:
            kind = onnx.numpy_helper.to_array(one).dtype
            mean = np.mean([found[name].astype(np.float64) for found in weights], axis=0)
            one.CopyFrom(onnx.numpy_helper.from_array(mean.astype(kind), one.name))
    shifts = np.mean([offsets_in(network.metadata, len(network.class_names)) for network in told], axis=0)
    write_sealed(made, out, {**facts_of(made), **offsets_fact(shifts)})


def _told(file: Path) -> Network:
    """What a file of any of the networks tells. Raises TrainingDataError."""
    for load in (load_regions, load_third):
        with contextlib.suppress(ModelFileError):
            return load(file)
    try:
        return load_model(file, networks=1).first
    except ModelFileError as error:
        raise TrainingDataError(f"{file}: {error.message}", mend=_MEND) from error


def _alike(one: Network, other: Network, weights: Mapping[str, np.ndarray], others: Mapping[str, np.ndarray]) -> bool:
    """Whether two networks take and tell the same, stand beside the same other one, and have weights of like shapes."""
    same = all(one.metadata.get(key) == other.metadata.get(key) for key in _ALIKE)
    return same and {n: w.shape for n, w in weights.items()} == {n: w.shape for n, w in others.items()}


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="The mean of networks' weights.")
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    return exit_code_of(lambda: average(given.files, given.out))


if __name__ == "__main__":
    raise SystemExit(main())
