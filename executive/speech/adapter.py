"""Adapter of the recogniser to noise: low-rank changes of its weight matrices, added when it is loaded.

W becomes W + B A (Hu and others, "LoRA: low-rank adaptation of large language models", 2021). The file is of numpy's
npz kind, with `NAME.up` (B) and `NAME.down` (A) in 16 bits for each matrix, and `base`, the sha256 of the weights to
which it belongs; `errand_train` makes it.

The weights are in CTranslate2's `model.bin`, and are changed in place. Its layout is that of `ModelSpec._serialize` in
CTranslate2's converter, binary version 6: version, name of the specification, revision, the variables (name, shape,
type, bytes), and finally aliases of variables. All numbers are little-endian; a text is preceded by its length and ends
with a zero byte.
"""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from skills.inputs.errors import InputError

Matrix = npt.NDArray[np.float16]

_UP: Final = ".up"
_DOWN: Final = ".down"
_BASE: Final = "base"
_FILE: Final = "noise_adapter.npz"
_HINT: Final = f"make a new one: python -m errand_train.speech --out executive/speech/{_FILE}"


@dataclass(frozen=True)
class LowRank:
    """Low-rank change of a matrix: `up` (outputs, rank) times `down` (rank, inputs)."""

    up: Matrix
    down: Matrix

    @property
    def shape(self) -> tuple[int, int]:
        """Outputs and inputs of the matrix; (0, 0) if the shapes of `up` and `down` do not fit together."""
        fits = self.up.ndim == self.down.ndim == 2 and self.up.shape[1] == self.down.shape[0]
        return (self.up.shape[0], self.down.shape[1]) if fits else (0, 0)

    def change(self) -> npt.NDArray[np.float32]:
        """Change as a full matrix (outputs, inputs)."""
        product: npt.NDArray[np.float32] = self.up.astype(np.float32) @ self.down.astype(np.float32)
        return product


@dataclass(frozen=True)
class Adapter:
    """Low-rank changes by the matrix's name in the model file; a convolution is one, (outputs, inputs x width)."""

    changes: Mapping[str, LowRank]

    def add_to(self, weights: ModelFile) -> None:
        """Adds the changes to the weights, in place.

        Raises InputError when a matrix is missing or of another shape; then no weight is changed.
        """
        for name, low_rank in self.changes.items():
            if name not in weights:
                raise _unfit(f"changes {name}, which the recogniser does not have")
            if low_rank.shape != (len(weights[name]), weights[name][0].size):
                raise _unfit(f"changes {name} as if it were {low_rank.shape}")
        for name, low_rank in self.changes.items():
            before = weights[name]
            before[...] = before + low_rank.change().reshape(before.shape)

    def save(self, file: Path, *, base: str) -> None:
        """Writes the adapter to a file; `base` is the sha256 of the weights to which the adapter belongs."""
        parts = {f"{name}{_UP}": low.up for name, low in self.changes.items()}
        parts |= {f"{name}{_DOWN}": low.down for name, low in self.changes.items()}
        np.savez(file, base=np.array(base), **parts)  # type: ignore[arg-type]


def packaged_adapter(*, base: str) -> Adapter:
    """Reads the shipped adapter for the weights with the sha256 `base`.

    Raises InputError when the adapter is missing or damaged, or belongs to other weights.
    """
    try:
        content = (resources.files(__package__) / _FILE).read_bytes()
    except OSError as error:
        raise _unfit("is missing") from error
    return read_adapter(content, base=base)


def read_adapter(content: bytes, *, base: str) -> Adapter:
    """Reads an adapter from the content of a file.

    Raises InputError when the adapter is damaged, or belongs to other weights than those with the sha256 `base`.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as parts:
            belongs = str(parts[_BASE])
            names = [part.removesuffix(_UP) for part in parts.files if part.endswith(_UP)]
            changes = {name: LowRank(parts[f"{name}{_UP}"], parts[f"{name}{_DOWN}"]) for name in names}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise _unfit(f"is damaged ({error})") from error
    if belongs != base:
        raise _unfit("belongs to other weights")
    return Adapter(changes)


def _unfit(what: str) -> InputError:
    return InputError(f"the recogniser's adapter to noise {what}", hint=_HINT)


Weights = npt.NDArray[Any]
Content = bytes | bytearray | memoryview

_VERSION: Final = 6
_TYPES: Final = {0: "<f4", 1: "<i1", 2: "<i2", 3: "<i4", 4: "<f2"}
"""numpy's names of the types by their number; 5 is bfloat16, which numpy does not know."""


@dataclass(frozen=True)
class Variable:
    """Variable in a model file: the position (bytes) of its numbers, their shape, and their numpy type."""

    start: int
    shape: tuple[int, ...]
    dtype: str


class ModelFile:
    """Content of a `model.bin`. The weights are views of the content, not copies, and writable if the content is."""

    def __init__(self, content: Content, variables: Mapping[str, Variable]) -> None:
        self._content, self._variables = content, variables

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all variables, in the order of the file."""
        return tuple(self._variables)

    def __getitem__(self, name: str) -> Weights:
        variable = self._variables[name]
        count = int(np.prod(variable.shape, dtype=np.int64))
        return np.frombuffer(self._content, variable.dtype, count, variable.start).reshape(variable.shape)

    def __contains__(self, name: object) -> bool:
        return name in self._variables


def read_model_file(content: Content) -> ModelFile:
    """Parses the variables of a `model.bin`.

    Raises InputError when the file is of another version, cut off, or has numbers of an unknown type.
    """
    try:
        return ModelFile(content, _variables(_Reader(content)))
    except (struct.error, KeyError, UnicodeDecodeError, IndexError) as error:
        raise _strange(f"damaged ({error})") from error


class _Reader:
    """Reads numbers and texts one after another."""

    def __init__(self, content: Content) -> None:
        self.content, self.at = content, 0

    def number(self, form: str) -> int:
        (value,) = struct.unpack_from(f"<{form}", self.content, self.at)
        self.at += struct.calcsize(f"<{form}")
        return int(value)

    def text(self) -> str:
        length = self.number("H")
        raw = bytes(self.content[self.at : self.at + length - 1])
        self.at += length
        return raw.decode("utf-8")

    def skip(self, count: int) -> None:
        self.at += count
        if self.at > len(self.content):
            raise IndexError("it ends too early")


def _variables(reader: _Reader) -> dict[str, Variable]:
    if (version := reader.number("I")) != _VERSION:
        raise _strange(f"of version {version}, not {_VERSION}")
    reader.text()
    reader.number("I")
    found = dict[str, Variable]()
    for _ in range(reader.number("I")):
        name = reader.text()
        shape = tuple(reader.number("I") for _ in range(reader.number("B")))
        dtype = _TYPES[reader.number("B")]
        size = reader.number("I")
        found[name] = Variable(reader.at, shape, dtype)
        reader.skip(size)
    return found


def _strange(what: str) -> InputError:
    hint = "install the extra that listens again: pip install --force-reinstall 'spot-errand[speech]'"
    return InputError(f"the weights of the speech recogniser are {what}", hint=hint)
