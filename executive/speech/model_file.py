"""The weights of a model as CTranslate2 keeps them in `model.bin`, by name, to be read and changed where they stand.

The layout is that of `ModelSpec._serialize` in CTranslate2's converter, binary version 6: version, name of the
specification, revision, the variables (name, shape, type, bytes), and at last other names for some of them. All numbers
are little-endian; texts have their length before them and a zero behind.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from skills.files.errors import InputError

__all__ = ["ModelFile", "read_model_file"]

Weights = npt.NDArray[Any]
Content = bytes | bytearray | memoryview

_VERSION: Final = 6
_TYPES: Final = {0: "<f4", 1: "<i1", 2: "<i2", 3: "<i4", 4: "<f2"}
"""numpy's names of the types by their number; 5 is bfloat16, which numpy does not know."""


@dataclass(frozen=True)
class Variable:
    """Where the numbers of a variable begin in the file (bytes), their shape, and their type as numpy calls it."""

    start: int
    shape: tuple[int, ...]
    dtype: str


class ModelFile:
    """The content of a `model.bin`. Nothing is copied: where the content can be written, so can the weights."""

    def __init__(self, content: Content, variables: Mapping[str, Variable]) -> None:
        self._content, self._variables = content, variables

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all variables, in the order of the file."""
        return tuple(self._variables)

    def __getitem__(self, name: str) -> Weights:
        variable = self._variables[name]
        count = int(np.prod(variable.shape, dtype=np.int64))
        return np.frombuffer(self._content, variable.dtype, count, variable.start).reshape(variable.shape)

    def __contains__(self, name: object) -> bool:
        return name in self._variables


def read_model_file(content: Content) -> ModelFile:
    """The variables of a `model.bin`.

    Raises:
        InputError: it is of another version, cut off, or has numbers of a kind that is not known.
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
