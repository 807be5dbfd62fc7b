"""Contents of the networks' ONNX files, and their writer. Needs no torch."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray

from skills.perception.detector.model_files import seal

QUANTISED: Final = "eight_bits"
"""Metadata entry of a file with a quantised network."""
OFFSETS: Final = "score_offsets"
"""Metadata entry with the offsets of each class's logits."""
_SEAL: Final = "sha256"
_TRAINED: Final = "network."
_SCALE: Final = "_scale"
_ZERO_POINT: Final = "_zero_point"
_QUANTISED: Final = "_quantized"
_SHORT: Final = ".short"


def write_sealed(model: onnx.ModelProto, file: Path, facts: Mapping[str, str]) -> None:
    """Writes a model's file with facts as its metadata; whole or not at all."""
    del model.metadata_props[:]
    for key, value in facts.items():
        model.metadata_props.add(key=key, value=value)
    fresh = file.with_name(f".{file.name}.new")
    fresh.write_bytes(seal(model.SerializeToString(deterministic=True)))
    fresh.replace(file)


def offsets_fact(offsets: Iterable[float]) -> dict[str, str]:
    """Metadata entry for the offsets of each class's logits."""
    return {OFFSETS: json.dumps([round(float(value), 4) for value in offsets])}


def offsets_in(facts: Mapping[str, str], classes: int) -> list[float]:
    """Offsets in the metadata; zeros without an entry."""
    return [float(value) for value in json.loads(facts[OFFSETS])] if OFFSETS in facts else [0.0] * classes


def facts_of(model: onnx.ModelProto) -> dict[str, str]:
    """Metadata of a model file without the seal."""
    return {entry.key: entry.value for entry in model.metadata_props if entry.key != _SEAL}


def trained_weights(model: onnx.ModelProto) -> dict[str, NDArray[np.floating]]:
    """Trained weights of a network by their names; 8-bit weights are dequantised.

    Names of weights of 16 bits, which the files of the repository have, end in `.short`.
    """
    kept = {one.name.removesuffix(_SHORT): onnx.numpy_helper.to_array(one) for one in model.graph.initializer}
    whole = {name.removesuffix(_QUANTISED): name for name in kept if name.endswith(_QUANTISED)}
    plain = (name for name in kept if not name.endswith((_SCALE, _ZERO_POINT, _QUANTISED)))
    trained = {name: kept[name] for name in plain} | {name: _dequantised(kept, name) for name in whole}
    return {name: values for name, values in trained.items() if name.startswith(_TRAINED)}


def _dequantised(kept: Mapping[str, NDArray[Any]], name: str) -> NDArray[np.floating]:
    """The weights (out, ...) of which each output's are whole numbers in steps of its own."""
    steps = kept[f"{name}{_QUANTISED}"].astype(np.float32)
    per_output = (-1, *[1] * (steps.ndim - 1))
    zero, scale = (kept[f"{name}{kind}"].astype(np.float32).reshape(per_output) for kind in (_ZERO_POINT, _SCALE))
    return np.asarray((steps - zero) * scale)
