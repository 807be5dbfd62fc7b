"""The detector of the stack: a cascade of networks, by default looked through in several views."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from skills.detection import Detector


@dataclass(frozen=True)
class Cascade:
    """Networks of an ONNX `file`; those that come with Errand unless one is named.

    With `views` a picture of the hand camera that leaves doubt is looked through in several views.
    """

    file: str | None = None
    views: bool = True

    def build(self) -> Detector:
        """The detector, loaded. Raises ModelFileError when its file cannot be used."""
        from skills.perception.detector.augmentation import AugmentedDetector
        from skills.perception.detector.cascade_files import MODEL_FILE
        from skills.perception.detector.onnx_detector import load_detector

        single = load_detector(MODEL_FILE if self.file is None else Path(self.file))
        return AugmentedDetector(single) if self.views else single
