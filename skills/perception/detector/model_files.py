"""Model files of the detector's cascade: paths, checks, and loading for ONNX Runtime.

The proposal network takes `images` uint8 (N, 480, 640, 3) RGB, and returns `boxes` float32 (N, A, 4), which are
(u0, v0, u1, v1) in pixels of the letterbox, and `scores` float32 (N, A, K) from 0 to 1.

The refinement network of detector.onnx is detector_refinement.onnx. It takes the crops `chips` uint8
(N, 128, 128, 3) RGB, the proposals `regions` float32 (N, 4) in pixels of the crops, and their `logits` float32 (N, K),
and returns `boxes` float32 (N, 4) in pixels of the crops and `scores` float32 (N, K). The classifier network,
detector_classifier.onnx, is alike, and takes the refinement network's logits. Both later networks may be missing; each
works only with the one with which it was trained, and holds the digest of its file as `first` or `second`.

The metadata also hold the `format`, `class_names` as a JSON list, and, in a sealed file, the digest of all before it.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from skills.inputs.errors import InputError
from skills.inputs.outside import is_file, read_bytes
from skills.perception.detector.boxes import HEIGHT_PX, WIDTH_PX

if TYPE_CHECKING:
    import onnxruntime

MODEL_FILE: Final = Path(__file__).with_name("model") / "errand_detector.onnx"
"""The shipped proposal network; the files of the other two stand beside it."""
CROP_PX: Final = 128
"""Side of the square crops of the refinement and classifier networks."""
LOG_FATAL_ONLY: Final = 4
MOST_BYTES: Final = 2_000_000_000
_SEAL_KEY: Final = b"sha256"
_SEAL_HEAD: Final = b"\x72\x4a\x0a\x06" + _SEAL_KEY + b"\x12\x40"
_SEAL_LENGTH: Final = len(_SEAL_HEAD) + 64
_CPU_INFO: Final = Path("/proc/cpuinfo")
_VNNI: Final = frozenset({"avx512_vnni", "avx_vnni"})
_WEIGHTS_IN: Final = re.compile(rb"\n\x08location\x12(.)", re.DOTALL)
"""Key, and length of the value, before the name of a file with weights, in the encoding of Protocol Buffers."""
_NUMPY: Final = {"uint8": np.uint8, "float": np.float32}

Inputs = Mapping[str, tuple[str, tuple[int, ...]]]


class ModelFileError(InputError):
    """Error of a model file that cannot be used."""


@dataclass(frozen=True)
class NetworkKind:
    """Expected format and inputs of a model file; `hint` says how to make a new one.

    As a function of the number of classes, `inputs` maps a name to ("uint8" or "float", shape of a row).
    """

    format: str
    hint: str
    inputs: Callable[[int], Inputs]


def _crop_inputs(classes: int) -> Inputs:
    return {"chips": ("uint8", (CROP_PX, CROP_PX, 3)), "regions": ("float", (4,)), "logits": ("float", (classes,))}


PROPOSAL: Final = NetworkKind(
    "errand-detector-1",
    "make a new one: errand dataset train --data DIR --out DIR",
    lambda _classes: {"images": ("uint8", (HEIGHT_PX, WIDTH_PX, 3))},
)
"""Proposes regions in a whole picture."""
REFINEMENT: Final = NetworkKind(
    "errand-regions-1", "remove it, or make a new one: errand dataset refine --data DIR --out DIR", _crop_inputs
)
"""Refines boxes and scores of regions."""
CLASSIFIER: Final = NetworkKind(
    "errand-third-1",
    "remove it, or make a new one: errand dataset refine --classifier --data DIR --out DIR",
    _crop_inputs,
)
"""Classifies the refined regions."""
_EXPORTED: Final = replace(PROPOSAL, hint="name an ONNX file; yolo export model=FILE.pt format=onnx makes one")


@dataclass(frozen=True)
class Network:
    """A loaded network with its class names, and the metadata and digest of its file.

    `session` runs on the calling thread, and several threads may call it at once. Equal inputs give equal outputs.
    """

    session: onnxruntime.InferenceSession
    class_names: tuple[str, ...]
    metadata: Mapping[str, str]
    digest: str


@dataclass(frozen=True)
class DetectorModel:
    """The networks of the cascade; a classifier needs a refinement network."""

    proposal: Network
    refinement: Network | None = None
    classifier: Network | None = None

    @property
    def class_names(self) -> tuple[str, ...]:
        """Names of the classes."""
        return self.proposal.class_names


def refinement_file(file: Path) -> Path:
    """Path of the refinement network that belongs to a proposal network's file."""
    return file.with_name(f"{file.stem}_refinement{file.suffix}")


def classifier_file(file: Path) -> Path:
    """Path of the classifier network that belongs to a proposal network's file."""
    return file.with_name(f"{file.stem}_classifier{file.suffix}")


def load_model(file: Path = MODEL_FILE, *, networks: int = 3) -> DetectorModel:
    """Loads the proposal network and those beside it, at most `networks` in all. Raises ModelFileError."""
    proposal = load_network(file, PROPOSAL)
    beside, last = refinement_file(file), classifier_file(file)
    if networks < 2 or not beside.exists():
        return DetectorModel(proposal)
    refinement = load_network(beside, REFINEMENT)
    _check_belongs(refinement, beside, "first", proposal, file, REFINEMENT)
    if networks < 3 or not last.exists():
        return DetectorModel(proposal, refinement)
    classifier = load_network(last, CLASSIFIER)
    _check_belongs(classifier, last, "second", refinement, beside, CLASSIFIER)
    return DetectorModel(proposal, refinement, classifier)


def _check_belongs(found: Network, file: Path, key: str, before: Network, source: Path, kind: NetworkKind) -> None:
    """Raises ModelFileError unless a network's metadata contain the digest of the network `before` it."""
    if found.metadata.get(key) != before.digest or found.class_names != before.class_names:
        raise ModelFileError(f"it belongs to another network than {source.name}", hint=kind.hint, file=file)


def load_network(file: Path, kind: NetworkKind) -> Network:
    """Loads the network in a file. Raises ModelFileError when the file is missing, damaged or of another format."""
    reader = _Reader(file, kind)
    content = reader.content()
    session = reader.session(content)
    metadata = session.get_modelmeta().custom_metadata_map
    reader.check_format(metadata)
    names = reader.class_names(metadata)
    reader.check_ports(session, len(names))
    reader.try_out(session, len(names))
    return Network(session, names, metadata, hashlib.sha256(content).hexdigest())


def open_session(file: Path) -> onnxruntime.InferenceSession:
    """Opens a network that another tool exported, with weights in files beside it. Raises ModelFileError."""
    reader = _Reader(file, _EXPORTED)
    content = reader.content()
    for found in re.finditer(_WEIGHTS_IN, content):
        name = content[found.end() : found.end() + found[1][0]].decode(errors="replace")
        if not is_file(file.parent / name):
            raise ModelFileError(f"its weights are in {name}, which is missing", hint="copy it along", file=file)
    return reader.session(str(file))


def is_cascade(file: Path) -> bool:
    """Returns whether a file names a format of Errand. Raises ModelFileError when it is no ONNX file."""
    return "format" in open_session(file).get_modelmeta().custom_metadata_map


def seal(content: bytes) -> bytes:
    """Appends the digest of a model file to its metadata, so that damage is detected."""
    return content + _seal_of(content)


def _seal_of(content: bytes) -> bytes:
    """Field 14 of ModelProto: a pair of key (field 1) and value (field 2), in the encoding of Protocol Buffers."""
    return _SEAL_HEAD + hashlib.sha256(content).hexdigest().encode()


@dataclass(frozen=True)
class _Reader:
    """Steps of loading a model file; each raises ModelFileError when the file fails it."""

    file: Path
    kind: NetworkKind

    def error(self, message: str) -> ModelFileError:
        """Returns an error that names this file."""
        return ModelFileError(message, hint=self.kind.hint, file=self.file)

    def content(self) -> bytes:
        """Reads the file and checks its seal."""
        try:
            content = read_bytes(self.file, most_bytes=MOST_BYTES)
        except InputError as error:
            missing = "there is no such model of the detector"
            raise self.error(error.message if self.file.exists() else missing) from error
        body, end = content[:-_SEAL_LENGTH], content[-_SEAL_LENGTH:]
        if end.startswith(_SEAL_HEAD) and end != _seal_of(body):
            raise self.error("the model of the detector is damaged (its digest is another than the file says)")
        return content

    def session(self, content: bytes | str) -> onnxruntime.InferenceSession:
        """Creates the inference session of a file's content or name."""
        import onnxruntime

        try:
            return onnxruntime.InferenceSession(content, _session_options(), providers=["CPUExecutionProvider"])
        except Exception as error:  # the library's errors have no common class
            reason = str(error).splitlines()[0][:120]
            if self.kind is _EXPORTED and "PROTOBUF" not in reason:
                hint = "export it again, for ONNX Runtime and without operations of other runtimes"
                raise ModelFileError(f"ONNX Runtime cannot run it ({reason})", hint=hint, file=self.file) from error
            raise self.error(f"the model of the detector is damaged or no ONNX file ({reason})") from error

    def check_format(self, metadata: Mapping[str, str]) -> None:
        """Checks that this version of the project reads the format."""
        found = metadata.get("format")
        if found != self.kind.format:
            what = f"a model of format '{found[:40]}'" if found else "no model of this detector"
            raise self.error(f"it is {what}; this version of Errand reads '{self.kind.format}'")

    def class_names(self, metadata: Mapping[str, str]) -> tuple[str, ...]:
        """Reads the class names from the metadata."""
        try:
            names = json.loads(metadata.get("class_names", ""))
        except (ValueError, RecursionError):
            names = None
        if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
            raise self.error("the model has no list of class names")
        return tuple(names)

    def check_ports(self, session: onnxruntime.InferenceSession, classes: int) -> None:
        """Checks that inputs and outputs match the format."""
        inputs = {port.name: (port.type, tuple(port.shape[1:])) for port in session.get_inputs()}
        outputs = {port.name: (port.type, port.shape[-1] if port.shape else None) for port in session.get_outputs()}
        wanted_inputs = {name: (f"tensor({of})", shape) for name, (of, shape) in self.kind.inputs(classes).items()}
        wanted_outputs = {"boxes": ("tensor(float)", 4), "scores": ("tensor(float)", classes)}
        if (inputs, outputs) != (wanted_inputs, wanted_outputs):
            raise self.error(f"the model has other inputs or outputs: {_ports_text(inputs)} -> {_ports_text(outputs)}")

    def try_out(self, session: onnxruntime.InferenceSession, classes: int) -> None:
        """Runs once on zeros: the first run takes longer, and reveals damage that loading does not."""
        ports = self.kind.inputs(classes)
        zeros = {name: np.zeros((1, *shape), dtype=_NUMPY[of]) for name, (of, shape) in ports.items()}
        try:
            session.run(["boxes", "scores"], zeros)
        except Exception as error:  # the library's errors have no common class
            raise self.error("the model of the detector is damaged (it does not run)") from error


def _session_options() -> onnxruntime.SessionOptions:
    from onnxruntime import SessionOptions

    options = SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    if not has_exact_byte_products():
        options.add_session_config_entry("session.x64quantprecision", "1")
    options.log_severity_level = LOG_FATAL_ONLY
    return options


@cache
def has_exact_byte_products(cpu_info: Path = _CPU_INFO) -> bool:
    """Returns whether the processor adds products of bytes in 32 bits at once (VNNI), as Linux reports.

    On other processors ONNX Runtime's fastest kernel adds two products in 16 bits first, and saturates.
    """
    try:
        lines = cpu_info.read_text(encoding="utf-8").splitlines()
    except OSError:
        return False
    flags = [line.partition(":")[2].split() for line in lines if line.startswith("flags")]
    return bool(flags) and all(_VNNI.intersection(able) for able in flags)


def _ports_text(ports: Mapping[str, tuple[str, Any]]) -> str:
    return ", ".join(f"{name} {kind} {shape}" for name, (kind, shape) in ports.items())
