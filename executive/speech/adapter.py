"""What the recogniser learned about noise: low-rank changes to some of its matrices, added when it is loaded.

W becomes W + B A (Hu and others, "LoRA: low-rank adaptation of large language models", 2021). The file is of numpy's
npz kind, with `NAME.up` (B) and `NAME.down` (A) in 16 bits for each matrix, and `base`, the sha256 of the weights that
it belongs to. `executive/speech/training` makes it.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from executive.speech.model_file import ModelFile
from skills.files.errors import InputError

__all__ = ["Adapter", "LowRank", "packaged_adapter", "read_adapter"]

Matrix = npt.NDArray[np.float16]

_UP, _DOWN, _BASE = ".up", ".down", "base"
_FILE: Final = "noise_adapter.npz"
_HINT: Final = f"make a new one: python -m errand_train.speech --out executive/speech/{_FILE}"


@dataclass(frozen=True)
class LowRank:
    """A change to a matrix: `up` (outputs, rank) times `down` (rank, inputs)."""

    up: Matrix
    down: Matrix

    @property
    def shape(self) -> tuple[int, int]:
        """Outputs and inputs of the matrix; (0, 0) when the two parts do not fit together."""
        fits = self.up.ndim == self.down.ndim == 2 and self.up.shape[1] == self.down.shape[0]
        return (self.up.shape[0], self.down.shape[1]) if fits else (0, 0)

    def change(self) -> npt.NDArray[np.float32]:
        """The change as a whole matrix (outputs, inputs)."""
        product: npt.NDArray[np.float32] = self.up.astype(np.float32) @ self.down.astype(np.float32)
        return product


@dataclass(frozen=True)
class Adapter:
    """The changes by the names of the matrices in the model's file; a convolution is one, (outputs, inputs x width)."""

    changes: Mapping[str, LowRank]

    def add_to(self, weights: ModelFile) -> None:
        """Add the changes to the weights, where they stand.

        Raises:
            InputError: a matrix is missing or of another shape; then nothing is changed.
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
        """Write it to a file; `base` is the sha256 of the weights that it belongs to."""
        parts = {f"{name}{_UP}": low.up for name, low in self.changes.items()}
        parts |= {f"{name}{_DOWN}": low.down for name, low in self.changes.items()}
        np.savez(file, base=np.array(base), **parts)  # type: ignore[arg-type]


def packaged_adapter(*, base: str) -> Adapter:
    """The adapter that comes with this package, for the weights with the sha256 `base`.

    Raises:
        InputError: it is missing or damaged, or belongs to other weights.
    """
    try:
        content = (resources.files(__package__) / _FILE).read_bytes()
    except OSError as error:
        raise _unfit("is missing") from error
    return read_adapter(content, base=base)


def read_adapter(content: bytes, *, base: str) -> Adapter:
    """The adapter in the content of a file.

    Raises:
        InputError: it is damaged, or belongs to other weights than those with the sha256 `base`.
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
