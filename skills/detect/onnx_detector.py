"""The detector: networks in ONNX Runtime on pictures in the letterbox, and one box for each thing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from onnxruntime import InferenceSession

from skills.detect.detector_file import MODEL_FILE, DetectorModel, load_model
from skills.detect.letterbox import Letterbox, letterbox
from skills.detect.network_file import THREADS, Network
from skills.detect.region_look import judged, looked_again
from skills.detect.regions import JUDGED, RegionOptions
from skills.detect.scales import Scales, halved
from skills.detect.suppression import SuppressionOptions, candidates_of, told
from skills.detection import Detection
from skills.robot import Picture

__all__ = ["DetectorOptions", "OnnxDetector", "load_detector"]

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class DetectorOptions:
    """The least score that is told, also of a class that a thing may be as well, and how boxes on it become one.

    `regions` are the places at which a second network, where there is one, looks again, and `judged` those of them that
    a third one judges, where there is one; what it does not judge is told as the second one sees it.
    """

    threshold: float = 0.5
    rival_threshold: float = 0.1
    suppression: SuppressionOptions = field(default_factory=SuppressionOptions)
    regions: RegionOptions = field(default_factory=RegionOptions)
    judged: RegionOptions = JUDGED


@dataclass(frozen=True)
class OnnxDetector:
    """Finds things with loaded networks. Safe to call from several threads."""

    model: DetectorModel
    options: DetectorOptions = field(default_factory=DetectorOptions)

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return self.model.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[tuple[Detection, ...]]:
        """What is in each picture, the surest first; boxes in the pictures' own pixels.

        Pictures are (H, W, 3) RGB or (H, W) grey, of any sizes. Several are looked at side by side, each on a thread of
        its own, which is quicker than all threads on one. Raises ValueError for what is no such picture.
        """
        if len(pictures) < 2:
            return [self._look(_on_all_threads, picture) for picture in pictures]
        with ThreadPoolExecutor(THREADS) as threads:
            return list(threads.map(partial(self._look, _on_one_thread), pictures))

    def _look(self, session: Callable[[Network], InferenceSession], picture: Picture) -> tuple[Detection, ...]:
        image, placed = letterbox(picture)
        boxes, scores = session(self.model.first).run(["boxes", "scores"], {"images": image[None]})
        boxes, scores = boxes[0], scores[0]
        if self.model.second is not None:
            scales = Scales(image, halved(image))
            boxes, scores = looked_again(session(self.model.second), scales, boxes, scores, self.options.regions)
            if self.model.third is not None:
                boxes, scores = judged(session(self.model.third), scales, boxes, scores, self.options.judged)
        return self._detections(boxes, scores, placed)

    def _detections(self, boxes: Floats, scores: Floats, placed: Letterbox) -> tuple[Detection, ...]:
        """The things of one picture from boxes (A, 4) and scores (A, K)."""
        options = self.options
        least = min(options.threshold, options.rival_threshold)
        found = candidates_of(boxes, scores, least, options.suppression.most_candidates)
        in_picture = replace(found, boxes=placed.to_picture(found.boxes))
        return told(in_picture, self.class_names, options.threshold, options.suppression)


def _on_all_threads(network: Network) -> InferenceSession:
    return network.session


def _on_one_thread(network: Network) -> InferenceSession:
    return network.single


def load_detector(file: Path = MODEL_FILE, options: DetectorOptions | None = None) -> OnnxDetector:
    """The detector of a file. Raises `skills.detect.detector_file.ModelFileError`."""
    return OnnxDetector(load_model(file), options or DetectorOptions())
