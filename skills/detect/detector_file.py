"""The files of the detector's two networks: where they are, and whether they are ones that can be used.

The first has the input `images` uint8 (N, 480, 640, 3) RGB and the outputs `boxes` float32 (N, A, 4), which are
(u0, v0, u1, v1) in pixels of the letterbox, and `scores` float32 (N, A, K), from 0 to 1.

The second, which looks again at places that the first one found, may stand beside it: beside detector.onnx as
detector_regions.onnx. It has the inputs `chips` uint8 (N, 128, 128, 3) RGB, `regions` float32 (N, 4) in pixels of the
chips and `logits` float32 (N, K) of the first one, and the outputs `boxes` float32 (N, 4) in pixels of the chips and
`scores` float32 (N, K). Its metadata tell as `first` the digest of the first one's file, to which it belongs.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skills.detect.letterbox import HEIGHT_PX, WIDTH_PX
from skills.detect.network_file import ModelFileError, Network, NetworkKind, load_network
from skills.detect.regions import CHIP_PX

__all__ = ["FORMAT", "MODEL_FILE", "REGIONS_FORMAT", "DetectorModel", "load_model", "load_regions", "regions_file"]

MODEL_FILE: Final = Path(__file__).with_name("model") / "errand_detector.onnx"
FORMAT: Final = "errand-detector-1"
REGIONS_FORMAT: Final = "errand-regions-1"
_FIRST: Final = NetworkKind(
    FORMAT,
    "make a new one: errand dataset train --data DIR --out DIR",
    lambda _classes: {"images": ("uint8", (HEIGHT_PX, WIDTH_PX, 3))},
    lambda classes: {"boxes": ("float", 4), "scores": ("float", classes)},
)
_SECOND: Final = NetworkKind(
    REGIONS_FORMAT,
    "remove it, or make a new one: errand dataset refine --data DIR --out DIR",
    lambda classes: {
        "chips": ("uint8", (CHIP_PX, CHIP_PX, 3)),
        "regions": ("float", (4,)),
        "logits": ("float", (classes,)),
    },
    lambda classes: {"boxes": ("float", 4), "scores": ("float", classes)},
)


@dataclass(frozen=True)
class DetectorModel:
    """The first network, and the second one if there is one."""

    first: Network
    second: Network | None = None

    @property
    def class_names(self) -> tuple[str, ...]:
        """The names of the classes."""
        return self.first.class_names


def regions_file(file: Path) -> Path:
    """Where the second network stands that belongs to a file of the first."""
    return file.with_name(f"{file.stem}_regions{file.suffix}")


def load_regions(file: Path) -> Network:
    """The second network of its own file, whichever first one it belongs to. Raises ModelFileError."""
    return load_network(file, _SECOND)


def load_model(file: Path = MODEL_FILE, *, second: bool = True) -> DetectorModel:
    """The network of a file, and the second one beside it if that is there and wanted. Raises ModelFileError."""
    first, beside = load_network(file, _FIRST), regions_file(file)
    if not second or not beside.exists():
        return DetectorModel(first)
    found = load_regions(beside)
    if found.metadata.get("first") != first.digest or found.class_names != first.class_names:
        raise ModelFileError(beside, f"it belongs to another network than {file.name}", mend=_SECOND.mend)
    return DetectorModel(first, found)
