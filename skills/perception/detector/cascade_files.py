"""The files of the detector's cascade: where they are, and whether they can be used.

The proposal network takes `images` uint8 (N, 480, 640, 3) RGB, and gives `boxes`
float32 (N, A, 4), which are (u0, v0, u1, v1) in pixels of the letterbox, and `scores` float32 (N, A, K) from 0 to 1.

The refinement network stands beside it: beside detector.onnx as detector_refinement.onnx. It takes `chips`, crops of
uint8 (N, 128, 128, 3) RGB, `regions` float32 (N, 4), the proposals in pixels of the crops, and their `logits` float32
(N, K), and gives `boxes` float32 (N, 4) in pixels of the crops and `scores` float32 (N, K). Its metadata hold the
digest of the proposal network's file as `first`: it works only beside the network that it was trained on.

The classifier network, detector_classifier.onnx, has the same inputs and outputs, takes the refinement network's
logits, and holds the digest of that one's file as `second`. Both may be missing; the networks before them work alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skills.perception.detector.letterbox import HEIGHT_PX, WIDTH_PX
from skills.perception.detector.network_file import Inputs, ModelFileError, Network, NetworkKind, Outputs, load_network
from skills.perception.detector.proposals import CROP_PX

MODEL_FILE: Final = Path(__file__).with_name("model") / "errand_detector.onnx"


def _one_box(classes: int) -> Outputs:
    return {"boxes": ("float", 4), "scores": ("float", classes)}


def _crops(classes: int) -> Inputs:
    return {
        "chips": ("uint8", (CROP_PX, CROP_PX, 3)),
        "regions": ("float", (4,)),
        "logits": ("float", (classes,)),
    }


PROPOSAL: Final = NetworkKind(
    "errand-detector-1",
    "make a new one: errand dataset train --data DIR --out DIR",
    lambda _classes: {"images": ("uint8", (HEIGHT_PX, WIDTH_PX, 3))},
    _one_box,
)
REFINEMENT: Final = NetworkKind(
    "errand-regions-1", "remove it, or make a new one: errand dataset refine --data DIR --out DIR", _crops, _one_box
)
CLASSIFIER: Final = NetworkKind(
    "errand-third-1",
    "remove it, or make a new one: errand dataset refine --classifier --data DIR --out DIR",
    _crops,
    _one_box,
)


@dataclass(frozen=True)
class DetectorModel:
    """The networks of the cascade; a classifier only behind a refinement network."""

    proposal: Network
    refinement: Network | None = None
    classifier: Network | None = None

    @property
    def class_names(self) -> tuple[str, ...]:
        """The names of the classes."""
        return self.proposal.class_names


def refinement_file(file: Path) -> Path:
    """Where the refinement network stands that belongs to a proposal network's file."""
    return file.with_name(f"{file.stem}_refinement{file.suffix}")


def classifier_file(file: Path) -> Path:
    """Where the classifier network stands that belongs to a proposal network's file."""
    return file.with_name(f"{file.stem}_classifier{file.suffix}")


def load_model(file: Path = MODEL_FILE, *, networks: int = 3) -> DetectorModel:
    """The network of a file, and those that stand beside it, up to so many `networks`. Raises ModelFileError."""
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
    """Raises ModelFileError unless the metadata of a network hold the digest of the one `before` it."""
    if found.metadata.get(key) != before.digest or found.class_names != before.class_names:
        raise ModelFileError(file, f"it belongs to another network than {source.name}", hint=kind.hint)
