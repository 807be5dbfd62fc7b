"""The detector: the cascade of networks in ONNX Runtime on pictures in the letterbox, and one box for each object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection
from skills.perception.detector.cascade_files import MODEL_FILE, DetectorModel, load_model
from skills.perception.detector.letterbox import Letterbox, letterbox
from skills.perception.detector.network_file import Network
from skills.perception.detector.proposals import (
    CLASSIFIED,
    CROP_PX,
    ProposalOptions,
    Proposals,
    crop_map,
    mapped,
    proposals_of,
    rows_of,
)
from skills.perception.detector.scales import Scales, halved
from skills.perception.detector.suppression import SuppressionOptions, candidates_of, detections_of
from skills.robot import Picture

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

Floats = NDArray[np.float32]


def refined(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: ProposalOptions
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K) of what a network sees at the proposals among boxes (A, 4) with scores (A, K).

    Boxes are in pixels of the letterbox (480, 640, 3), of which `scales` are. Where the options ask for the mirror
    image too, the result is the mean of both.
    """
    proposals = proposals_of(boxes, scores, options)
    if not len(proposals):
        return proposals.boxes, np.zeros_like(proposals.logits)
    found, seen = _seen(session, scales, proposals, mirrored=False)
    if options.mirrored_from is None:
        return found, seen
    rows = np.flatnonzero(seen.max(axis=1) >= options.mirrored_from)
    if len(rows):
        again, others = _seen(session, scales, Proposals(proposals.boxes[rows], proposals.logits[rows]), mirrored=True)
        found[rows] = 0.5 * (found[rows] + again)
        seen[rows] = 0.5 * (seen[rows] + others)
    return found, seen


def classified(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: ProposalOptions
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K), with those that `options` choose replaced by what a network sees there."""
    rows = rows_of(boxes, scores, options)
    boxes, scores = boxes.copy(), scores.copy()
    boxes[rows], scores[rows] = refined(session, scales, boxes[rows], scores[rows], options)
    return boxes, scores


def crops_about(scales: Scales, proposals: Proposals, *, mirrored: bool = False) -> dict[str, NDArray[Any]]:
    """The inputs of such a network: crops about proposals or their mirror images, proposals in them, and logits."""
    maps = _maps(proposals, mirrored)
    return {
        "chips": np.stack([scales.cut(to_crop, (CROP_PX, CROP_PX)) for to_crop in maps]),
        "regions": mapped(proposals.boxes, maps),
        "logits": proposals.logits,
    }


def _maps(proposals: Proposals, mirrored: bool) -> Floats:
    return np.stack([crop_map(box, mirrored=mirrored) for box in proposals.boxes])


def _seen(session: InferenceSession, scales: Scales, proposals: Proposals, *, mirrored: bool) -> tuple[Floats, Floats]:
    """Boxes in the letterbox and scores of what is seen in crops about proposals, or in their mirror images."""
    found, scores = session.run(["boxes", "scores"], crops_about(scales, proposals, mirrored=mirrored))
    back = np.stack([cv2.invertAffineTransform(to_crop) for to_crop in _maps(proposals, mirrored)])
    return mapped(found, back), scores


THREADS: Final = 2
"""So many pictures are looked at side by side."""


@dataclass(frozen=True)
class DetectorOptions:
    """The least score of a detection, also of an alternative class, and how boxes of one object become one.

    `proposals` are judged by the refinement network, and of those the `classified` by the classifier network. A quick
    look for one class is content with the proposals that give that class at least `quick_score`.
    """

    threshold: float = 0.5
    alternative_threshold: float = 0.1
    suppression: SuppressionOptions = field(default_factory=SuppressionOptions)
    proposals: ProposalOptions = field(default_factory=ProposalOptions)
    classified: ProposalOptions = CLASSIFIED
    quick_score: float = 0.02


@dataclass(frozen=True)
class OnnxDetector:
    """Finds objects with loaded networks. Safe to call from several threads."""

    model: DetectorModel
    options: DetectorOptions = field(default_factory=DetectorOptions)

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return self.model.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[tuple[Detection, ...]]:
        """What is in each picture, the surest first; boxes in the pictures' own pixels.

        Pictures are (H, W, 3) RGB or (H, W) grey, of any sizes. Raises ValueError for what is no such picture.
        """
        return _side_by_side(self._detect, pictures)

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[tuple[Detection, ...]]:
        """The objects of one class in each picture, quickly.

        The proposal network sees the picture, and the others only what it gives a score of the class.
        Raises ValueError for what is no picture, and for a class that the detector does not know.
        """
        if class_name not in self.class_names:
            raise ValueError(f"the detector knows no class {class_name!r}")
        return _side_by_side(partial(self._detect_class, number=self.class_names.index(class_name)), pictures)

    def _detect(self, picture: Picture) -> tuple[Detection, ...]:
        image, placed = letterbox(picture)
        return self._judged(image, placed, *_proposed(self.model.proposal, image))

    def _detect_class(self, picture: Picture, number: int) -> tuple[Detection, ...]:
        image, placed = letterbox(picture)
        boxes, scores = _proposed(self.model.proposal, image)
        rows = rows_of(boxes, scores, self.options.proposals)
        likely = rows[scores[rows, number] >= self.options.quick_score]
        if not len(likely):
            return ()
        found = self._judged(image, placed, boxes[likely], scores[likely])
        return tuple(one for one in found if one.class_name == self.class_names[number])

    def _judged(self, image: Picture, placed: Letterbox, boxes: Floats, scores: Floats) -> tuple[Detection, ...]:
        """The objects of a picture in the letterbox from proposals: boxes (A, 4) and scores (A, K)."""
        model, scales = self.model, Scales(image, halved(image))
        if model.refinement is not None:
            boxes, scores = refined(model.refinement.session, scales, boxes, scores, self.options.proposals)
        if model.classifier is not None:
            boxes, scores = classified(model.classifier.session, scales, boxes, scores, self.options.classified)
        options = self.options
        least = min(options.threshold, options.alternative_threshold)
        found = candidates_of(boxes, scores, least, options.suppression.most_candidates)
        in_picture = replace(found, boxes=placed.to_picture(found.boxes))
        return detections_of(in_picture, self.class_names, options.threshold, options.suppression)


def _side_by_side(
    detect: Callable[[Picture], tuple[Detection, ...]], pictures: Sequence[Picture]
) -> list[tuple[Detection, ...]]:
    """What is in each picture, several at a time."""
    if len(pictures) < 2:
        return [detect(picture) for picture in pictures]
    with ThreadPoolExecutor(THREADS) as threads:
        return list(threads.map(detect, pictures))


def _proposed(network: Network, image: Picture) -> tuple[Floats, Floats]:
    """Boxes (A, 4) and scores (A, K) of the proposal network in a letterbox (H, W, 3)."""
    boxes, scores = network.session.run(["boxes", "scores"], {"images": image[None]})
    return boxes[0], scores[0]


def load_detector(file: Path = MODEL_FILE, options: DetectorOptions | None = None) -> OnnxDetector:
    """The detector of a file. Raises `skills.perception.detector.network_file.ModelFileError`."""
    return OnnxDetector(load_model(file), options or DetectorOptions())
