"""Detector of objects in pictures: a cascade of three small networks in ONNX Runtime."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

from skills.detection import Detector, DetectorWrapper

if TYPE_CHECKING:
    from skills.perception.detector.onnx_detector import OnnxDetector
    from skills.perception.shape_model import ShapeModel


@dataclass(frozen=True)
class Cascade:
    """Cascade of networks in an ONNX `file`; the project's own when none is named.

    `views`: a picture of the hand camera with doubtful scores is judged in several views (test-time augmentation).
    `shapes`: the shape in depth is a second witness of the class beside the scores.
    `objects`: folders written by `errand object import`, whose objects are recognised by their models.
    """

    file: Path | None = None
    views: bool = True
    shapes: bool = True
    objects: tuple[Path, ...] = ()

    def build(self) -> Detector:
        """Returns the detector; the project's own loads when used first. Raises InputError if a file is unusable."""
        from skills.perception.model_matching import with_models

        cascade = _LoadedWhenUsed(self)
        return with_models(cascade if self.file is None else cascade.loaded(), self.objects)

    def build_for_pictures(self, threshold: float) -> Detector:
        """Loads the networks for single pictures. Raises InputError if the file is unusable."""
        return _loaded(self.file, threshold)


@dataclass(frozen=True)
class _LoadedWhenUsed(DetectorWrapper):
    """Cascade whose networks load when its classes or a picture are first asked for."""

    _options: Cascade

    def loaded(self) -> Self:
        """Loads the networks now. Raises InputError if their file is unusable."""
        _ = self._detector
        return self

    @property
    def shapes(self) -> ShapeModel | None:
        """The project's own shape model, unless the options leave it out."""
        from skills.perception.shape_model import shape_model

        return shape_model() if self._options.shapes else None

    @cached_property
    def _detector(self) -> Detector:  # type: ignore[override]
        from skills.perception.detector.augmentation import AugmentedDetector

        single = _loaded(self._options.file)
        return AugmentedDetector(single) if self._options.views else single


def _loaded(file: Path | None, threshold: float | None = None) -> OnnxDetector:
    """Loads a cascade, by default the project's own. Raises ModelFileError if the file is unusable."""
    from skills.perception.detector.model_files import MODEL_FILE, ModelFileError
    from skills.perception.detector.onnx_detector import DetectorOptions, load_detector

    try:
        return load_detector(file or MODEL_FILE, None if threshold is None else DetectorOptions(threshold=threshold))
    except ModelFileError:
        _check_cascade(file or MODEL_FILE)
        raise


def _check_cascade(file: Path) -> None:
    """Raises ModelFileError unless a file holds a network of Errand."""
    from skills.perception.detector.model_files import ModelFileError, is_cascade
    from skills.stack import StackError, component_of

    if is_cascade(file):
        return
    try:
        about = component_of("detector", "onnx")(file).build_for_pictures(0.0).about.partition(";")[0]
    except StackError as error:
        what = f"it is no cascade of Errand, and the detector {error.message}"
        raise ModelFileError(what, hint=error.hint, file=file) from error
    hint = "write 'detector: {use: onnx, file: ...}'; other detectors come as a class of errand.detectors"
    raise ModelFileError(f"it is no cascade of Errand, but {about}", hint=hint, file=file)
