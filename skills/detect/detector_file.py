"""The files of the detector's three networks: where they are, and whether they are ones that can be used.

The first has the input `images` uint8 (N, 480, 640, 3) RGB and the outputs `boxes` float32 (N, A, 4), which are
(u0, v0, u1, v1) in pixels of the letterbox, and `scores` float32 (N, A, K), from 0 to 1.

The second, which looks again at places that the first one found, may stand beside it: beside detector.onnx as
detector_regions.onnx. It has the inputs `chips` uint8 (N, 128, 128, 3) RGB, `regions` float32 (N, 4) in pixels of the
chips and `logits` float32 (N, K) of the first one, and the outputs `boxes` float32 (N, 4) in pixels of the chips and
`scores` float32 (N, K). Its metadata tell as `first` the digest of the first one's file, to which it belongs.

The third, which judges what the second one sees, may stand beside both, as detector_third.onnx. It takes and gives the
same, with the second one's logits, and tells as `second` the digest of that one's file.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skills.detect.letterbox import HEIGHT_PX, WIDTH_PX
from skills.detect.network_file import Inputs, ModelFileError, Network, NetworkKind, Outputs, load_network
from skills.detect.regions import CHIP_PX

__all__ = [
    "FORMAT",
    "MODEL_FILE",
    "REGIONS_FORMAT",
    "THIRD_FORMAT",
    "DetectorModel",
    "load_model",
    "load_regions",
    "load_third",
    "regions_file",
    "third_file",
]

MODEL_FILE: Final = Path(__file__).with_name("model") / "errand_detector.onnx"
FORMAT: Final = "errand-detector-1"
REGIONS_FORMAT: Final = "errand-regions-1"
THIRD_FORMAT: Final = "errand-third-1"


def _one_box(classes: int) -> Outputs:
    return {"boxes": ("float", 4), "scores": ("float", classes)}


def _chips(classes: int) -> Inputs:
    return {
        "chips": ("uint8", (CHIP_PX, CHIP_PX, 3)),
        "regions": ("float", (4,)),
        "logits": ("float", (classes,)),
    }


_FIRST: Final = NetworkKind(
    FORMAT,
    "make a new one: errand dataset train --data DIR --out DIR",
    lambda _classes: {"images": ("uint8", (HEIGHT_PX, WIDTH_PX, 3))},
    _one_box,
)
_SECOND: Final = NetworkKind(
    REGIONS_FORMAT, "remove it, or make a new one: errand dataset refine --data DIR --out DIR", _chips, _one_box
)
_THIRD: Final = NetworkKind(
    THIRD_FORMAT, "remove it, or make a new one: errand dataset refine --third --data DIR --out DIR", _chips, _one_box
)


@dataclass(frozen=True)
class DetectorModel:
    """The first network, the second one if there is one, and the third one if there is that too."""

    first: Network
    second: Network | None = None
    third: Network | None = None

    @property
    def class_names(self) -> tuple[str, ...]:
        """The names of the classes."""
        return self.first.class_names


def regions_file(file: Path) -> Path:
    """Where the second network stands that belongs to a file of the first."""
    return file.with_name(f"{file.stem}_regions{file.suffix}")


def third_file(file: Path) -> Path:
    """Where the third network stands that belongs to a file of the first."""
    return file.with_name(f"{file.stem}_third{file.suffix}")


def load_regions(file: Path) -> Network:
    """The second network of its own file, whichever first one it belongs to. Raises ModelFileError."""
    return load_network(file, _SECOND)


def load_third(file: Path) -> Network:
    """The third network of its own file, whichever second one it belongs to. Raises ModelFileError."""
    return load_network(file, _THIRD)


def load_model(file: Path = MODEL_FILE, *, networks: int = 3) -> DetectorModel:
    """The network of a file, and those that stand beside it, up to so many `networks`. Raises ModelFileError."""
    first = load_network(file, _FIRST)
    beside, last = regions_file(file), third_file(file)
    if networks < 2 or not beside.exists():
        return DetectorModel(first)
    second = _belonging(load_regions(beside), beside, "first", first, file.name, _SECOND.mend)
    if networks < 3 or not last.exists():
        return DetectorModel(first, second)
    return DetectorModel(first, second, _belonging(load_third(last), last, "second", second, beside.name, _THIRD.mend))


def _belonging(found: Network, file: Path, told_as: str, before: Network, name: str, mend: str) -> Network:
    """A network, which tells the digest of the one `before` it. Raises ModelFileError."""
    if found.metadata.get(told_as) != before.digest or found.class_names != before.class_names:
        raise ModelFileError(file, f"it belongs to another network than {name}", mend=mend)
    return found
