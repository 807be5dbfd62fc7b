"""What is in networks' ONNX files, and how they are written. Needs no torch."""

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
"""What a file has among its metadata when its network is quantised."""
OFFSETS: Final = "score_offsets"
"""What it tells there of what was added to the logits of each class."""
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
    """What a file tells of what was added to the logits of each class."""
    return {OFFSETS: json.dumps([round(float(value), 4) for value in offsets])}


def offsets_in(facts: Mapping[str, str], classes: int) -> list[float]:
    """What a file tells of it; zeros, where nothing was added."""
    return [float(value) for value in json.loads(facts[OFFSETS])] if OFFSETS in facts else [0.0] * classes


def facts_of(model: onnx.ModelProto) -> dict[str, str]:
    """What a model's file tells, but for what sealing adds."""
    return {entry.key: entry.value for entry in model.metadata_props if entry.key != _SEAL}


def trained_weights(model: onnx.ModelProto) -> dict[str, NDArray[np.floating]]:
    """What a network has trained, by the names that weights have in it; those of 8 bits as what they stand for.

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
