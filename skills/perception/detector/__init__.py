"""Detectors of objects in pictures: a cascade of three small networks, or an exported network, in ONNX Runtime."""

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

    file: Path | None = None
    views: bool = True
    objects: tuple[Path, ...] = ()

    def build(self) -> Detector:
        """Loads the detector. Raises InputError when a file cannot be used."""
        from skills.perception.detector.augmentation import AugmentedDetector
        from skills.perception.detector.exported import ExportedNetwork, load_exported
        from skills.perception.detector.layouts import LAYOUTS
        from skills.perception.detector.model_files import MODEL_FILE, ModelFileError, is_cascade
        from skills.perception.detector.onnx_detector import load_detector
        from skills.perception.model_matching import with_models

        if self.file is not None and not is_cascade(self.file):
            about = LAYOUTS[load_exported(ExportedNetwork(self.file), every=True).layout].about
            hint = "write 'detector: {use: onnx, file: ...}'; other detectors come as a class of errand.detectors"
            raise ModelFileError(f"it is no cascade of Errand, but {about}", hint=hint, file=self.file)
        single = load_detector(self.file or MODEL_FILE)
        return with_models(AugmentedDetector(single) if self.views else single, self.objects)
