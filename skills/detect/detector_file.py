"""The file of the detector's network: where it is, and whether it is one that can be used.

An ONNX file with input `images` uint8 (N, 480, 640, 3) RGB and outputs `boxes` float32 (N, A, 4), which are
(u0, v0, u1, v1) in pixels of the letterbox, and `scores` float32 (N, A, K), from 0 to 1. Its metadata tell
its `format`, `class_names` as a JSON list of K names, and, when it was sealed, the digest of all that stands before.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnxruntime

from skills.detect.letterbox import HEIGHT_PX, WIDTH_PX

__all__ = ["FORMAT", "MODEL_FILE", "DetectorModel", "ModelFileError", "load_model", "sealed"]

MODEL_FILE: Final = Path(__file__).with_name("model") / "errand_detector.onnx"
FORMAT: Final = "errand-detector-1"
MEND: Final = "make a new one: errand dataset train --data DIR --out DIR"
THREADS: Final = 2
QUIET: Final = 4
_SEAL_KEY: Final = b"sha256"
_SEAL_HEAD: Final = b"\x72\x4a\x0a\x06" + _SEAL_KEY + b"\x12\x40"
_SEAL_LENGTH: Final = len(_SEAL_HEAD) + 64


class ModelFileError(ValueError):
    """The file of a network cannot be used; `message` says why, `mend` what to do."""

    def __init__(self, file: Path, message: str, *, mend: str = MEND) -> None:
        self.file, self.message, self.mend = file, message, mend
        super().__init__(f"{file}: {message}; {mend}")


@dataclass(frozen=True)
class DetectorModel:
    """A loaded network and the names of its classes.

    `session` runs one picture on THREADS threads, `single` on the thread that calls it; so many of these may do so at
    once. The same picture gives the same each time; from one to the other a box may differ in the seventh digit.
    """

    session: onnxruntime.InferenceSession
    single: onnxruntime.InferenceSession
    class_names: tuple[str, ...]


def load_model(file: Path = MODEL_FILE) -> DetectorModel:
    """The network of a file, on two threads, with the same results each time. Raises ModelFileError."""
    content = _read(file)
    _check_seal(file, content)
    session, single = _session(file, content, THREADS), _session(file, content, 1)
    metadata = session.get_modelmeta().custom_metadata_map
    _check_format(file, metadata)
    names = _class_names(file, metadata)
    _check_ports(file, session, len(names))
    for one in (session, single):
        _try_out(file, one)
    return DetectorModel(session, single, names)


def sealed(content: bytes) -> bytes:
    """A network's file with its digest as one more entry of its metadata, so that damage is noticed."""
    return content + _seal(content)


def _seal(content: bytes) -> bytes:
    """Field 14 of ModelProto: a pair of key (field 1) and value (field 2), in the encoding of Protocol Buffers."""
    return _SEAL_HEAD + hashlib.sha256(content).hexdigest().encode()


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError as error:
        raise ModelFileError(file, "there is no such model of the detector") from error
    except OSError as error:
        raise ModelFileError(file, f"cannot read it ({error.strerror})") from error


def _check_seal(file: Path, content: bytes) -> None:
    body, seal = content[:-_SEAL_LENGTH], content[-_SEAL_LENGTH:]
    if seal.startswith(_SEAL_HEAD) and seal != _seal(body):
        raise ModelFileError(file, "the model of the detector is damaged (it has another digest than it tells)")


def _session(file: Path, content: bytes, threads: int) -> onnxruntime.InferenceSession:
    try:
        return onnxruntime.InferenceSession(content, _session_options(threads), providers=["CPUExecutionProvider"])
    except Exception as error:  # the library has no common class of its own for them
        reason = str(error).splitlines()[0][:120]
        raise ModelFileError(file, f"the model of the detector is damaged or no ONNX file ({reason})") from error


def _session_options(threads: int) -> onnxruntime.SessionOptions:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.use_deterministic_compute = True
    options.add_session_config_entry("session.force_spinning_stop", "1")  # between pictures the cores are others'
    options.log_severity_level = QUIET
    return options


def _check_format(file: Path, metadata: Mapping[str, str]) -> None:
    told = metadata.get("format")
    if told != FORMAT:
        what = f"a model of format '{told[:40]}'" if told else "no model of this detector"
        raise ModelFileError(file, f"it is {what}; this version of Errand reads '{FORMAT}'")


def _class_names(file: Path, metadata: Mapping[str, str]) -> tuple[str, ...]:
    try:
        names = json.loads(metadata.get("class_names", ""))
    except ValueError:
        names = None
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise ModelFileError(file, "the model does not tell the names of its classes")
    return tuple(names)


def _check_ports(file: Path, session: onnxruntime.InferenceSession, classes: int) -> None:
    inputs = {port.name: (port.type, port.shape[1:]) for port in session.get_inputs()}
    outputs = {port.name: (port.type, port.shape[2:]) for port in session.get_outputs()}
    floats = "tensor(float)"
    expected: tuple[Any, Any] = (
        {"images": ("tensor(uint8)", [HEIGHT_PX, WIDTH_PX, 3])},
        {"boxes": (floats, [4]), "scores": (floats, [classes])},
    )
    if (inputs, outputs) != expected:
        raise ModelFileError(file, f"the model has other inputs or outputs: {_told(inputs)} -> {_told(outputs)}")


def _try_out(file: Path, session: onnxruntime.InferenceSession) -> None:
    """Look at one black picture: the first time takes longer, and shows what loading does not."""
    black = np.zeros((1, HEIGHT_PX, WIDTH_PX, 3), dtype=np.uint8)
    try:
        session.run(["boxes", "scores"], {"images": black})
    except Exception as error:  # the library has no common class of its own for them
        raise ModelFileError(file, "the model of the detector is damaged (it does not run)") from error


def _told(ports: Mapping[str, tuple[str, Sequence[Any]]]) -> str:
    return ", ".join(f"{name} {kind} {list(shape)}" for name, (kind, shape) in ports.items())
