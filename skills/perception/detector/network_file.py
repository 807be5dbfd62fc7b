"""A network's ONNX file: read, checked against what is expected of it, and made ready to run on processor cores.

Its metadata tell its `format`, `class_names` as a JSON list, and, when it was sealed, the digest of all that stands
before.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from skills.files.errors import InputError
from skills.files.outside import read_bytes

if TYPE_CHECKING:
    import onnxruntime

QUIET: Final = 4
MOST_BYTES: Final = 2_000_000_000
_SEAL_KEY: Final = b"sha256"
_SEAL_HEAD: Final = b"\x72\x4a\x0a\x06" + _SEAL_KEY + b"\x12\x40"
_SEAL_LENGTH: Final = len(_SEAL_HEAD) + 64
_CPU_INFO: Final = Path("/proc/cpuinfo")
_VNNI: Final = frozenset({"avx512_vnni", "avx_vnni"})
_NUMPY: Final = {"uint8": np.uint8, "float": np.float32}

Inputs = Mapping[str, tuple[str, tuple[int, ...]]]
Outputs = Mapping[str, tuple[str, int]]


class ModelFileError(ValueError):
    """The file of a network cannot be used; `message` says why, `hint` what to do."""

    def __init__(self, file: Path, message: str, *, hint: str) -> None:
        self.file, self.message, self.hint = file, message, hint
        super().__init__(f"{file}: {message}; {hint}")


@dataclass(frozen=True)
class NetworkKind:
    """What is expected of a file of some `format`; `hint` says how to make a new one.

    For a number of classes, `inputs` are ("uint8" or "float", shape of a row) by name, and `outputs` ("float", length
    of the last axis).
    """

    format: str
    hint: str
    inputs: Callable[[int], Inputs]
    outputs: Callable[[int], Outputs]


@dataclass(frozen=True)
class Network:
    """A loaded network, the names of its classes, its file's metadata and digest.

    `session` runs on the thread that calls it, and several threads may call it at once. The same input gives the same
    output each time.
    """

    session: onnxruntime.InferenceSession
    class_names: tuple[str, ...]
    metadata: Mapping[str, str]
    digest: str


def load_network(file: Path, kind: NetworkKind) -> Network:
    """The network of a file. Raises ModelFileError."""
    reader = _Reader(file, kind)
    content = reader.content()
    session = reader.session(content)
    metadata = session.get_modelmeta().custom_metadata_map
    reader.check_format(metadata)
    names = reader.class_names(metadata)
    reader.check_ports(session, len(names))
    reader.try_out(session, len(names))
    return Network(session, names, metadata, hashlib.sha256(content).hexdigest())


def sealed(content: bytes) -> bytes:
    """A network's file with its digest as one more entry of its metadata, so that damage is noticed."""
    return content + _seal(content)


def _seal(content: bytes) -> bytes:
    """Field 14 of ModelProto: a pair of key (field 1) and value (field 2), in the encoding of Protocol Buffers."""
    return _SEAL_HEAD + hashlib.sha256(content).hexdigest().encode()


@dataclass(frozen=True)
class _Reader:
    """The steps of loading a file."""

    file: Path
    kind: NetworkKind

    def error(self, message: str) -> ModelFileError:
        """What is to be raised."""
        return ModelFileError(self.file, message, hint=self.kind.hint)

    def content(self) -> bytes:
        """The file's bytes, whose seal fits."""
        try:
            content = read_bytes(self.file, most_bytes=MOST_BYTES)
        except InputError as error:
            missing = "there is no such model of the detector"
            raise self.error(error.message if self.file.exists() else missing) from error
        body, seal = content[:-_SEAL_LENGTH], content[-_SEAL_LENGTH:]
        if seal.startswith(_SEAL_HEAD) and seal != _seal(body):
            raise self.error("the model of the detector is damaged (it has another digest than it tells)")
        return content

    def session(self, content: bytes) -> onnxruntime.InferenceSession:
        """The network, ready to run."""
        import onnxruntime

        try:
            return onnxruntime.InferenceSession(content, _session_options(), providers=["CPUExecutionProvider"])
        except Exception as error:  # the library has no common class of its own for them
            reason = str(error).splitlines()[0][:120]
            raise self.error(f"the model of the detector is damaged or no ONNX file ({reason})") from error

    def check_format(self, metadata: Mapping[str, str]) -> None:
        """The format must be the one that is read here."""
        told = metadata.get("format")
        if told != self.kind.format:
            what = f"a model of format '{told[:40]}'" if told else "no model of this detector"
            raise self.error(f"it is {what}; this version of Errand reads '{self.kind.format}'")

    def class_names(self, metadata: Mapping[str, str]) -> tuple[str, ...]:
        """The classes that the metadata tell."""
        try:
            names = json.loads(metadata.get("class_names", ""))
        except ValueError:
            names = None
        if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
            raise self.error("the model does not tell the names of its classes")
        return tuple(names)

    def check_ports(self, session: onnxruntime.InferenceSession, classes: int) -> None:
        """Inputs and outputs must be those of the format."""
        inputs = {port.name: (port.type, tuple(port.shape[1:])) for port in session.get_inputs()}
        outputs = {port.name: (port.type, port.shape[-1] if port.shape else None) for port in session.get_outputs()}
        wanted_inputs = {name: (_typed(of), shape) for name, (of, shape) in self.kind.inputs(classes).items()}
        wanted_outputs = {name: (_typed(of), length) for name, (of, length) in self.kind.outputs(classes).items()}
        if (inputs, outputs) != (wanted_inputs, wanted_outputs):
            raise self.error(f"the model has other inputs or outputs: {_told(inputs)} -> {_told(outputs)}")

    def try_out(self, session: onnxruntime.InferenceSession, classes: int) -> None:
        """Runs once on zeros: the first run takes longer, and shows damage that loading does not."""
        ports = self.kind.inputs(classes)
        nothing = {name: np.zeros((1, *shape), dtype=_NUMPY[of]) for name, (of, shape) in ports.items()}
        try:
            session.run(list(self.kind.outputs(classes)), nothing)
        except Exception as error:  # the library has no common class of its own for them
            raise self.error("the model of the detector is damaged (it does not run)") from error


def _session_options() -> onnxruntime.SessionOptions:
    from onnxruntime import SessionOptions

    options = SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    if not adds_byte_products_exactly():
        options.add_session_config_entry("session.x64quantprecision", "1")
    options.log_severity_level = QUIET
    return options


@cache
def adds_byte_products_exactly(cpu_info: Path = _CPU_INFO) -> bool:
    """Returns whether the processor adds products of bytes in 32 bits at once (VNNI), by what Linux tells of it.

    Where it does not, or nothing is told, ONNX Runtime's quickest way adds two of them in 16 bits first, and cuts off
    what is too large.
    """
    try:
        lines = cpu_info.read_text(encoding="utf-8").splitlines()
    except OSError:
        return False
    flags = [line.partition(":")[2].split() for line in lines if line.startswith("flags")]
    return bool(flags) and all(_VNNI.intersection(able) for able in flags)


def _typed(name: str) -> str:
    return f"tensor({name})"


def _told(ports: Mapping[str, tuple[str, Any]]) -> str:
    return ", ".join(f"{name} {kind} {shape}" for name, (kind, shape) in ports.items())
