"""Detector of objects in pictures: a cascade of three small networks in ONNX Runtime."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from skills.detection import Detector


@dataclass(frozen=True)
class Cascade:
    """Cascade of networks in an ONNX `file`; the project's own when none is named.

    `views`: a picture of the hand camera with doubtful scores is judged in several views (test-time augmentation).
    `objects`: folders written by `errand object import`, whose objects are recognised by their models.
    """

    file: str | None = None
    views: bool = True
    objects: tuple[str, ...] = ()

    def build(self) -> Detector:
        """Loads the detector. Raises InputError when a file cannot be used."""
        from skills.perception.detector.augmentation import AugmentedDetector
        from skills.perception.detector.model_files import MODEL_FILE
        from skills.perception.detector.onnx_detector import load_detector
        from skills.perception.model_matching import with_models

        single = load_detector(MODEL_FILE if self.file is None else Path(self.file))
        return with_models(AugmentedDetector(single) if self.views else single, self.objects)
