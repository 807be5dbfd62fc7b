"""The detector's cascade: proposal network, refinement network, classifier network, non-maximum suppression.

Boxes are in pixels of the letterbox. The refinement network sees a crop about each proposal, scaled to one size
(Girshick, "Fast R-CNN", 2015, without shared features); the classifier network judges the crops about its results
(Cai and Vasconcelos, "Cascade R-CNN", 2018).
"""

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

from skills.detection import Detections, Detector
from skills.perception.detector.boxes import (
    Floats,
    Letterbox,
    Scales,
    SuppressionOptions,
    are_sound,
    detections_from,
    halve,
    letterbox,
    select_candidates,
    select_distinct,
)
from skills.perception.detector.model_files import CROP_PX, MODEL_FILE, DetectorModel, load_model
from skills.robot import Picture

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

OBJECT_PX: Final = 84.0
LEAST_SIDE_PX: Final = 20.0
THREADS: Final = 2
"""Pictures that are processed in parallel."""
_LOWEST_SCORE: Final = 1e-4


@dataclass(frozen=True)
class ProposalOptions:
    """Selection of the boxes that become proposals.

    `most_candidates` and `least_score`: only so many of the best boxes of any class, with at least this score, are
    considered. `same`: a box that overlaps a better one by more is dropped. `most`: number of proposals kept.
    `mirrored_from`: where the next network gives at least this score, it also judges the mirror image.
    """

    least_score: float = 0.01
    same: float = 0.6
    most: int = 12
    most_candidates: int = 250
    mirrored_from: float | None = 0.3


CLASSIFIER_PROPOSALS: Final = ProposalOptions(least_score=0.05, same=1.0, most=12, mirrored_from=None)
"""Boxes of the refinement network that the classifier network judges."""


@dataclass(frozen=True)
class DetectorOptions:
    """Thresholds for detections and for their alternative classes, and the options of the stages.

    `proposals` are judged by the refinement network, and `reclassified` of its results by the classifier network.
    `quick_score`: a search for one class uses only the proposals that give the class at least this score.
    """

    threshold: float = 0.5
    alternative_threshold: float = 0.1
    suppression: SuppressionOptions = field(default_factory=SuppressionOptions)
    proposals: ProposalOptions = field(default_factory=ProposalOptions)
    reclassified: ProposalOptions = CLASSIFIER_PROPOSALS
    quick_score: float = 0.02


@dataclass(frozen=True)
class OnnxDetector(Detector):
    """Detector that runs loaded networks. Several threads may use it at once."""

    model: DetectorModel
    options: DetectorOptions = field(default_factory=DetectorOptions)

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes of the networks."""
        return self.model.class_names

    def detect(self, pictures: Sequence[Picture], least_score: float | None = None) -> list[Detections]:
        """Detects the objects in each picture, best first; boxes are in the picture's own pixels.

        Pictures are (H, W, 3) RGB or (H, W) grey. `least_score` replaces the threshold. Raises ValueError for others.
        """
        threshold = self.options.threshold if least_score is None else least_score
        return _in_parallel(partial(self._detect, threshold=threshold), pictures)

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[Detections]:
        """Detects the objects of one class in each picture, quickly.

        The later networks judge only its proposals. Raises ValueError for a wrong array, or an unknown class.
        """
        if class_name not in self.class_names:
            raise ValueError(f"the detector knows no class {class_name!r}")
        return _in_parallel(partial(self._detect_class, number=self.class_names.index(class_name)), pictures)

    def _detect(self, picture: Picture, threshold: float) -> Detections:
        image, placed = letterbox(picture)
        return self._judge(image, placed, *self._propose(image), threshold)

    def _detect_class(self, picture: Picture, number: int) -> Detections:
        image, placed = letterbox(picture)
        boxes, scores = self._propose(image)
        rows = _proposal_rows(boxes, scores, self.options.proposals)
        likely = rows[scores[rows, number] >= self.options.quick_score]
        if not len(likely):
            return ()
        found = self._judge(image, placed, boxes[likely], scores[likely], self.options.threshold)
        return tuple(one for one in found if one.class_name == self.class_names[number])

    def _propose(self, image: Picture) -> tuple[Floats, Floats]:
        """Boxes (A, 4) and scores (A, K) from the proposal network in a letterbox (H, W, 3)."""
        boxes, scores = self.model.proposal.session.run(["boxes", "scores"], {"images": image[None]})
        return boxes[0], scores[0]

    def _judge(self, image: Picture, placed: Letterbox, boxes: Floats, scores: Floats, threshold: float) -> Detections:
        """Runs the later stages on the proposals in a letterbox: boxes (A, 4) and scores (A, K)."""
        model, scales, options = self.model, Scales(image, halve(image)), self.options
        if model.refinement is not None:
            boxes, scores = refine(model.refinement.session, scales, boxes, scores, options.proposals)
        if model.classifier is not None:
            rows = _proposal_rows(boxes, scores, options.reclassified)
            boxes, scores = boxes.copy(), scores.copy()
            boxes[rows], scores[rows] = refine(
                model.classifier.session, scales, boxes[rows], scores[rows], options.reclassified
            )
        least = min(threshold, options.alternative_threshold)
        found = select_candidates(boxes, scores, least, options.suppression.most_candidates)
        in_picture = replace(found, boxes=placed.to_picture(found.boxes))
        return detections_from(in_picture, self.class_names, threshold, options.suppression)


def load_detector(file: Path = MODEL_FILE, options: DetectorOptions | None = None) -> OnnxDetector:
    """Loads the detector in a file. Raises `ModelFileError` when its networks cannot be used."""
    return OnnxDetector(load_model(file), options or DetectorOptions())


def _in_parallel(detect: Callable[[Picture], Detections], pictures: Sequence[Picture]) -> list[Detections]:
    if len(pictures) < 2:
        return [detect(picture) for picture in pictures]
    with ThreadPoolExecutor(THREADS) as threads:
        return list(threads.map(detect, pictures))


@dataclass(frozen=True)
class Proposals:
    """Boxes (R, 4) of (u0, v0, u1, v1) and the logits (R, K) of their classes."""

    boxes: Floats
    logits: Floats

    def __len__(self) -> int:
        return len(self.boxes)


def select_proposals(boxes: Floats, scores: Floats, options: ProposalOptions) -> Proposals:
    """Selects the proposals, best first, among a network's boxes (A, 4) with scores (A, K)."""
    rows = _proposal_rows(boxes, scores, options)
    return Proposals(boxes[rows], logits(scores[rows]))


def _proposal_rows(boxes: Floats, scores: Floats, options: ProposalOptions) -> NDArray[np.int64]:
    """Rows of boxes (A, 4) with scores (A, K) that are proposals, best first."""
    best = scores.max(axis=1)
    rows = np.flatnonzero(best >= options.least_score)
    rows = rows[np.argsort(-best[rows], kind="stable")][: options.most_candidates]
    rows = rows[are_sound(boxes[rows])]
    return np.asarray(rows[select_distinct(boxes[rows], options.same)[: options.most]], dtype=np.int64)


def logits(scores: Floats) -> Floats:
    """Logits of scores from 0 to 1, clipped to 1e-4 and 1 - 1e-4."""
    sound = np.clip(scores, _LOWEST_SCORE, 1.0 - _LOWEST_SCORE)
    return np.asarray(np.log(sound / (1.0 - sound)), dtype=np.float32)


def refine(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: ProposalOptions
) -> tuple[Floats, Floats]:
    """Runs a network on the proposals among boxes (A, 4) with scores (A, K): new boxes (R, 4) and scores (R, K).

    `scales` holds the letterbox. Where the options ask for the mirror image too, the result is the mean of both.
    """
    proposals = select_proposals(boxes, scores, options)
    if not len(proposals):
        return proposals.boxes, np.zeros_like(proposals.logits)
    found, seen = _run_on_crops(session, scales, proposals, mirrored=False)
    if options.mirrored_from is None:
        return found, seen
    rows = np.flatnonzero(seen.max(axis=1) >= options.mirrored_from)
    if len(rows):
        sure = Proposals(proposals.boxes[rows], proposals.logits[rows])
        mirrored_found, mirrored_seen = _run_on_crops(session, scales, sure, mirrored=True)
        found[rows] = 0.5 * (found[rows] + mirrored_found)
        seen[rows] = 0.5 * (seen[rows] + mirrored_seen)
    return found, seen


def crop_inputs(scales: Scales, proposals: Proposals, *, mirrored: bool = False) -> dict[str, NDArray[Any]]:
    """Inputs of a later network: crops around proposals or their mirror images, the proposals in them, and logits."""
    maps = _crop_maps(proposals, mirrored)
    return {
        "chips": np.stack([scales.warp(to_crop, (CROP_PX, CROP_PX)) for to_crop in maps]),
        "regions": transform_boxes(proposals.boxes, maps),
        "logits": proposals.logits,
    }


def _crop_maps(proposals: Proposals, mirrored: bool) -> Floats:
    return np.stack([crop_map(box, mirrored=mirrored) for box in proposals.boxes])


def _run_on_crops(
    session: InferenceSession, scales: Scales, proposals: Proposals, *, mirrored: bool
) -> tuple[Floats, Floats]:
    """Boxes in the letterbox and scores from a network on the crops around proposals, or on their mirror images."""
    found, scores = session.run(["boxes", "scores"], crop_inputs(scales, proposals, mirrored=mirrored))
    back = np.stack([cv2.invertAffineTransform(to_crop) for to_crop in _crop_maps(proposals, mirrored)])
    return transform_boxes(found, back), scores


def crop_map(box: NDArray[np.floating], *, mirrored: bool = False) -> Floats:
    """Affine map (2, 3) from the letterbox to the crop around a box (4,), which fills about two thirds of the crop.

    A very small box fills less. `mirrored` flips the crop from left to right.
    """
    u0, v0, u1, v1 = (float(value) for value in box)
    scale = OBJECT_PX / max(u1 - u0, v1 - v0, LEAST_SIDE_PX)
    linear = np.diag([-scale if mirrored else scale, scale])
    shift = CROP_PX / 2 - linear @ (np.array([u0 + u1, v0 + v1]) / 2)
    return np.concatenate([linear, shift[:, None]], axis=1).astype(np.float32)


def transform_boxes(boxes: NDArray[np.floating], affine: NDArray[np.floating]) -> Floats:
    """Bounding boxes of the corners of boxes (N, 4) under an affine map (2, 3), or under one map each (N, 2, 3)."""
    u0, v0, u1, v1 = np.asarray(boxes, dtype=np.float64).T
    corners = np.stack([np.stack([u0, u1, u0, u1], axis=1), np.stack([v0, v0, v1, v1], axis=1)], axis=1)
    moved = affine[..., :2] @ corners + affine[..., 2:]
    return np.concatenate([moved.min(axis=2), moved.max(axis=2)], axis=1).astype(np.float32)
