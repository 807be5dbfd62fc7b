"""Quantisation of networks to INT8, which runs over twice as fast on processor cores.

    python -m errand_train.detector.quantisation DIR/errand_detector.onnx --data PICTURES --out FOLDER

Weights have 8 bits in the file, those of each output in steps of their own; training can go on from them. What passes
between layers gets its range from some pictures that were trained on. The first convolution, which sees the picture
(with a separable one right after it), and the last ones, which tell scores and boxes, stay as they are. After Jacob et
al., "Quantization and Training of Neural Networks for Efficient Integer-Arithmetic-Only Inference" (2018). Needs no
torch.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process

from errand_train.detector.labels import TrainingDataError
from errand_train.detector.onnx_files import QUANTISED, facts_of, write_sealed
from errand_train.detector.proposal_table import propose, refine_proposals
from errand_train.detector.store import read_picture
from errand_train.detector.validate import examination
from skills.perception.detector.boxes import Scales, halve, letterbox
from skills.perception.detector.model_files import ModelFileError, Network, classifier_file, load_model, refinement_file
from skills.perception.detector.onnx_detector import (
    CLASSIFIER_PROPOSALS,
    ProposalOptions,
    Proposals,
    crop_inputs,
    select_proposals,
)

_MEASURED_BY: Final = 160
_CROPS_AT_ONCE: Final = 8
_AT_ONCE: Final = 8
_KINDS: Final = ("Conv", "Relu", "Clip", "Concat", "MaxPool", "Resize", "Add")

Given = Mapping[str, NDArray[Any]]


def quantise_detector(file: Path, data: Path, out: Path) -> Path:
    """Quantises the networks of a detector into a folder; returns the proposal network's file.

    Quantised networks stay unchanged. Ranges are measured on training pictures of the data set `data`. Raises
    TrainingDataError for unusable files, or when there is nothing to do.
    """
    try:
        model = load_model(file)
    except ModelFileError as error:
        raise TrainingDataError(f"{error.file}: {error.message}", hint="name a detector's ONNX file") from error
    if QUANTISED in (model.classifier or model.refinement or model.proposal).metadata:
        raise TrainingDataError(
            f"{file}: is quantised already", hint="name a file that errand dataset train or refine wrote"
        )
    made = out / file.name
    if made.exists() and made.samefile(file):
        raise TrainingDataError(f"{file}: would be written over", hint="name another folder with --out")
    exam = examination(data, "train", model.class_names, _MEASURED_BY)
    pictures = [letterbox(read_picture(exam.folder / picture.file))[0] for picture in exam.pictures]
    out.mkdir(parents=True, exist_ok=True)
    scales = [Scales(picture, halve(picture)) for picture in pictures]
    networks: tuple[tuple[Path, Network | None, Callable[[], Sequence[Given]]], ...] = (
        (file, model.proposal, lambda: [{"images": picture[None]} for picture in pictures]),
        (
            refinement_file(file),
            model.refinement,
            lambda: _crops(lambda one: select_proposals(*propose(model, one), ProposalOptions()), scales),
        ),
        (
            classifier_file(file),
            model.classifier,
            lambda: _crops(lambda one: select_proposals(*refine_proposals(model, one), CLASSIFIER_PROPOSALS), scales),
        ),
    )
    belongs: dict[str, str] = {}
    for name, (source, network, given) in zip(("first", "second", "third"), networks, strict=True):
        if network is not None:
            target = out / source.name
            if QUANTISED in network.metadata:
                kept = onnx.load(source)
                write_sealed(kept, target, {**facts_of(kept), **belongs})
            else:
                write_quantised(source, given(), target, belongs)
            belongs = {name: hashlib.sha256(target.read_bytes()).hexdigest()}
    return made


def quantise(model: onnx.ModelProto, given: Sequence[Given]) -> onnx.ModelProto:
    """Quantises a network, with ranges measured on `given` inputs, all of as many rows."""
    plain, count = onnx.ModelProto.FromString(model.SerializeToString()), len(given)
    for number, node in enumerate(plain.graph.node):
        node.name = f"n{number}"
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        shaped, made = Path(folder) / "shaped.onnx", Path(folder) / "made.onnx"
        quant_pre_process(plain, shaped, skip_optimization=True, skip_symbolic_shape=True)
        quantize_static(
            shaped,
            made,
            _Given(given if count < _AT_ONCE else given[: count - count % _AT_ONCE]),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=list(_KINDS),
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            nodes_to_quantize=_between_convolutions(plain.graph),
            calibrate_method=CalibrationMethod.Entropy,
            extra_options={"QuantizeBias": False, "CalibStridedMinMax": min(_AT_ONCE, count)},
        )
        found = onnx.load(made)
    del found.graph.value_info[:]
    found.producer_name, found.producer_version = "errand", ""
    return found


class _Given(CalibrationDataReader):
    """Calibration inputs, a range at a time, so that memory holds only some activations."""

    def __init__(self, given: Sequence[Given]) -> None:
        self._given = given
        self.set_range(0, len(given))

    def __len__(self) -> int:
        return len(self._given)

    def set_range(self, start_index: int, end_index: int) -> None:
        """Sets the range of inputs that `get_next` returns."""
        self._left = iter(self._given[start_index:end_index])

    def get_next(self) -> dict[str, NDArray[Any]] | None:
        """Next input; None after the last."""
        following = next(self._left, None)
        return None if following is None else dict(following)


def _between_convolutions(graph: onnx.GraphProto) -> list[str]:
    """Names of the nodes between convolutions.

    Nodes before the first convolution open the network; there are several where the second convolution is depthwise: in
    8 bits the classifier network lost precision there, presumably in channels much weaker than others.
    """
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    separate = len(convolutions) > 2 and any(one.name == "group" and one.i > 1 for one in convolutions[1].attribute)
    before = _reached(graph, convolutions, upstream=True)
    after = _reached(graph, convolutions[2 if separate else 0 :], upstream=False)
    return [node.name for node in graph.node if node.op_type in _KINDS and node.name in before & after]


def _reached(graph: onnx.GraphProto, nodes: Sequence[onnx.NodeProto], *, upstream: bool) -> set[str]:
    """Names of all nodes before some nodes, or after them."""
    names, found = {name for node in nodes for name in (node.input if upstream else node.output)}, set[str]()
    for node in reversed(graph.node) if upstream else graph.node:
        here, beyond = (node.output, node.input) if upstream else (node.input, node.output)
        if names.intersection(here):
            found.add(node.name)
            names.update(beyond)
    return found


def _crops(look: Callable[[Scales], Proposals], pictures: Sequence[Scales]) -> list[Given]:
    """What a network is given at the places of a look at pictures in the letterbox, always of as many crops."""
    looked_at = [(picture, look(picture)) for picture in pictures]
    found = [crop_inputs(picture, regions) for picture, regions in looked_at if len(regions)]
    if not found:
        raise TrainingDataError("the proposal network finds no place to look at", hint="train it for longer first")
    together = {name: np.concatenate([one[name] for one in found]) for name in found[0]}
    count = len(together["chips"])
    size = min(_CROPS_AT_ONCE, count)
    return [
        {name: values[first : first + size] for name, values in together.items()}
        for first in range(0, count - size + 1, size)
    ]


def write_quantised(
    file: Path, given: Sequence[Given], out: Path, other_facts: Mapping[str, str] | None = None
) -> None:
    """Quantises the network of a file, with a note and `other_facts` in its metadata."""
    model = onnx.load(file)
    facts = {**facts_of(model), **(other_facts or {}), QUANTISED: "yes"}
    write_sealed(quantise(model, given), out, facts)


def main() -> int:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description="A detector that is quantised to INT8.")
    parser.add_argument("file", type=Path, help="the proposal network's ONNX file")
    parser.add_argument("--data", type=Path, required=True, help="the data set's folder")
    parser.add_argument("--out", type=Path, required=True, help="the folder to write to")
    given = parser.parse_args()
    try:
        quantise_detector(given.file, given.data, given.out)
    except (TrainingDataError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
