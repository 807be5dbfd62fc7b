"""Detector that runs a network which another tool exported; `layouts` says what its inputs and outputs mean."""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.class_forms import class_forms
from skills.detection import Detections, Detector
from skills.inputs.errors import nearest_name, suggestion
from skills.inputs.outside import read_text
from skills.perception.detector.boxes import SuppressionOptions, check_picture, detections_from, select_candidates
from skills.perception.detector.layouts import (
    LAYOUTS,
    WITH_MORE_COLUMNS,
    Facts,
    Outputs,
    Preparation,
    decode,
    recognise,
)
from skills.perception.detector.model_files import ModelFileError, open_session
from skills.perception.shape_model import ShapeModel, shape_model
from skills.quantities import Count, Factor, Quantity, Share
from skills.robot import Picture

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

USUAL_PX: Final = (640, 640)
_DTYPES: Final = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(int64)": np.int64}
_ALTERNATIVE_SCORE: Final = 0.1
_NAMES_HINT: Final = "write 'names: [bottle, cup, ...]', 'names: {1: bottle}' or 'names: FILE'"
Level = Annotated[float, Quantity(ge=0.0, le=255.0)]


@dataclass(frozen=True)
class ExportedNetwork:
    """Detection network in an ONNX `file` that another tool exported, such as a YOLO, RT-DETR or RF-DETR.

    `classes` maps its class names to words of Errand, `{bottle: beer}` or `{bottle: drink}` for a category; the robot
    uses these, and the classes that have the same name here. `names`: where the metadata have none, the names in the
    order of the network's labels from 0 on, a file with one a line, or a table of label and name. `layout`: what the
    outputs are, where their shapes leave it open. `fit`, `scale`, `mean`, `std`, `colours`: how a picture becomes the
    input, where that is not as usual for the layout; values are (byte * scale - mean) / std. `size_px`: width and
    height of an input of any size. `threshold`: least score. `overlap`: boxes of a class that overlap by more are one
    object, where the network itself does not suppress them. `objects`: folders written by `errand object import`.
    """

    file: Path
    classes: Mapping[str, str] = field(default_factory=dict, hash=False)
    names: Mapping[int | str, str] | tuple[str, ...] | Path = field(default=(), hash=False)
    layout: str | None = None
    fit: Literal["letterbox", "corner", "stretch", "native"] | None = None
    scale: Factor | None = None
    mean: tuple[Level, Level, Level] | None = None
    std: tuple[Factor, Factor, Factor] | None = None
    colours: Literal["rgb", "bgr"] | None = None
    size_px: tuple[Count, Count] | None = None
    threshold: Share = 0.5
    overlap: Share = 0.7
    objects: tuple[Path, ...] = ()

    def build(self) -> Detector:
        """Loads the detector. Raises InputError when a file cannot be used."""
        from skills.perception.model_matching import with_models

        return with_models(load_exported(self, every=False), self.objects)


@dataclass(frozen=True)
class ExportedDetector(Detector):
    """Detector that runs an exported network. Several threads may use it at once.

    `labels`: for each class that it reports, the network's labels that stand for it.
    """

    session: InferenceSession
    layout: str
    facts: Facts
    preparation: Preparation
    labels: tuple[list[int], ...]
    threshold: float
    suppression: SuppressionOptions
    class_names: tuple[str, ...] = ()

    @property
    def shapes(self) -> ShapeModel | None:
        """The project's own shape model where it knows all classes."""
        model = shape_model()
        return model if {*self.class_names} <= {*model.names} else None

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Detects the objects in each picture, best first. Raises ValueError when an array is no picture."""
        return [self.detect_in_views(picture) for picture in pictures]

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> Detections:
        """Detects the objects in one picture, best first; `least_score` replaces the threshold."""
        check_picture(picture)
        threshold = self.threshold if least_score is None else least_score
        colour = np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
        image, scale, corner = place(colour, self.facts.size_px, self.preparation)
        boxes, scores = decode(run(self.session, image, self.preparation), self.layout, self.facts)
        boxes = ((boxes - np.array(corner * 2)) / np.array(scale * 2)).astype(np.float32)
        if not LAYOUTS[self.layout].distinct:  # a box is of its best class alone, also where that is not reported
            scores = np.where(scores == scores.max(axis=1, keepdims=True), scores, 0.0)
        scores = np.stack([scores[:, labels].max(axis=1) for labels in self.labels], axis=1)
        least = min(threshold, _ALTERNATIVE_SCORE)
        candidates = select_candidates(boxes, scores, least, self.suppression.most_candidates)
        found = detections_from(candidates, self.class_names, threshold, self.suppression)
        clipped = [np.clip(one.box, 0, picture.shape[1::-1] * 2).tolist() for one in found]
        boxed = zip(found, clipped, strict=True)
        return tuple(replace(one, box=(u0, v0, u1, v1)) for one, (u0, v0, u1, v1) in boxed if u1 > u0 and v1 > v0)


def place(
    picture: Picture, size_px: tuple[int, int], how: Preparation
) -> tuple[NDArray[Any], tuple[float, float], tuple[int, int]]:
    """Places a picture (H, W, 3) in an image of this width and height, at a scale (u, v) and a corner in pixels."""
    (rows, columns), (width, height) = picture.shape[:2], size_px
    if how.fit == "native":
        return picture, (1.0, 1.0), (0, 0)
    if how.fit == "stretch":
        return _resized(picture, width, height, how), (width / columns, height / rows), (0, 0)
    scale = min(width / columns, height / rows)
    across, down = max(1, round(columns * scale)), max(1, round(rows * scale))
    # Half of the padding, rounded as Ultralytics does.
    left, top = (0, 0) if how.fit == "corner" else (round((width - across) / 2 - 0.1), round((height - down) / 2 - 0.1))
    image = np.full((height, width, 3), how.padding, dtype=np.float32)
    image[top : top + down, left : left + across] = _resized(picture, across, down, how)
    return image, (scale, scale), (left, top)


def _resized(picture: Picture, width: int, height: int, how: Preparation) -> NDArray[Any]:
    """Scales a picture: interpolates linearly, or if smooth over a triangle as wide as a pixel of the result."""
    values: NDArray[Any] = picture if how.resize == "bytes" else picture.astype(np.float32)
    if how.resize != "smooth":
        return np.asarray(cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR))
    for axis, length in ((1, width), (0, height)):
        ratio = values.shape[axis] / length
        centres = (np.arange(length)[:, None] + 0.5) * ratio - 0.5
        weights = np.clip(1.0 - np.abs(np.arange(values.shape[axis]) - centres) / max(ratio, 1.0), 0.0, None)
        weights = np.round(weights / weights.sum(axis=1, keepdims=True) * 2.0**22) / 2.0**22  # as Pillow
        values = np.floor(np.moveaxis(np.tensordot(weights, values, axes=(1, axis)), 0, axis) + 0.5)
    return values


def run(session: InferenceSession, image: NDArray[Any], how: Preparation) -> Outputs:
    """Runs a network on an image (H, W, 3) of bytes; a second input gets its width and height."""
    first, *others = session.get_inputs()
    ordered = image[..., ::-1] if how.colours == "bgr" else image
    values = np.moveaxis((ordered * np.float64(how.scale) - how.mean) / how.std, 2, 0).astype(_DTYPES[first.type])
    batch = first.shape[0] if len(first.shape) == 4 and isinstance(first.shape[0], int) else 1
    feed = {first.name: values if len(first.shape) == 3 else np.repeat(values[None], batch, axis=0)}
    for port in others:
        feed[port.name] = np.array([image.shape[1::-1]] * batch, dtype=_DTYPES[port.type])
    found = zip([port.name for port in session.get_outputs()], session.run(None, feed), strict=True)
    return {name: value.astype(np.float32) if value.dtype.kind == "f" else value for name, value in found}


def load_exported(options: ExportedNetwork, threshold: float | None = None, *, every: bool) -> ExportedDetector:
    """Loads an exported network; `every`: reports also classes that are no words of Errand.

    Raises ModelFileError when the file cannot be read, or is no detector of a known layout.
    """
    session = open_session(options.file)
    metadata = session.get_modelmeta().custom_metadata_map
    names, classes, forms = _names(options, metadata), options.classes, class_forms()
    size_px, count = _size_px(session, options, metadata), max(names) + 1 if names else None
    facts = Facts(size_px, count, metadata.get("task", "detect"), " ".join(metadata.values()))
    layout = _layout(session, options, facts)
    words = {label: classes.get(theirs, theirs) for label, theirs in names.items()}
    reported = tuple(word for word in dict.fromkeys(words.values()) if every or word in {*forms, *classes.values()})
    for theirs in classes.keys() - names.values():
        what = f"'classes' names {theirs!r}, which is no class of the network"
        raise _error(options, what, suggestion(theirs, names.values()))
    for ours in classes.values():  # any other word may be a category of the world's knowledge
        if ours not in forms and (near := nearest_name(ours, forms)):
            what = f"'classes' names {ours!r}, which has no class_forms"
            raise _error(options, what, f"did you mean {near!r}?")
    if not reported:
        shown = textwrap.shorten(", ".join(names.values()), 200, placeholder=" ...")
        hint = "write 'classes: {THEIRS: OURS}', or give a class its class_forms"
        raise _error(options, f"none of its classes is a word of Errand ({shown})", hint)
    labels = tuple([label for label, other in words.items() if other == word] for word in reported)
    given = {key: getattr(options, key) for key in ("fit", "scale", "mean", "std", "colours")}
    preparation = replace(LAYOUTS[layout].preparation, **{key: one for key, one in given.items() if one is not None})
    overlap = 1.0 if LAYOUTS[layout].distinct else options.overlap
    suppression = SuppressionOptions(overlap, other_class=1.0, most_candidates=3000)
    least = options.threshold if threshold is None else threshold
    return ExportedDetector(session, layout, facts, preparation, labels, least, suppression, reported)


def _error(options: ExportedNetwork, what: str, hint: str) -> ModelFileError:
    return ModelFileError(what, hint=hint, file=options.file)


def _names(options: ExportedNetwork, metadata: Mapping[str, str]) -> dict[int, str]:
    """Names of the labels, from the options or the metadata; a list counts from 0, and has them all."""
    named: Any = options.names
    if isinstance(options.names, Path):
        named = [line.strip() for line in read_text(options.names).rstrip().splitlines()]
        if "" in named:
            hint = "each line names the next class: write its name there, or a table, 'names: {2: bottle}'"
            raise ModelFileError("the line is empty", hint=hint, file=options.names, line=named.index("") + 1)
    try:
        own = ast.literal_eval(metadata.get("names") or metadata.get("class_names") or "()")
        if named and not isinstance(named, Mapping) and len(named) < len(own):
            raise _error(options, f"it has {len(own)} classes, and 'names' has {len(named)}", _NAMES_HINT)
        pairs = (named or own).items() if isinstance(named or own, Mapping) else enumerate(named or own)
        return {int(label): str(name) for label, name in pairs if name}
    except (ValueError, SyntaxError, TypeError):
        return {}


def _size_px(session: InferenceSession, options: ExportedNetwork, metadata: Mapping[str, str]) -> tuple[int, int]:
    """Width and height of the input. Raises ModelFileError unless it is a picture, perhaps with the picture's size."""
    first, *others = session.get_inputs()
    sides = [side if isinstance(side, int) else 0 for side in first.shape[-3:]]
    picture = len(first.shape) in (3, 4) and sides[0] in (0, 3) and first.type in ("tensor(float)", "tensor(float16)")
    if not picture or len(others) > 1 or any(port.shape[1:] != [2] or port.type not in _DTYPES for port in others):
        what = f"it takes no picture in colour: {_shapes(session)}"
        raise _error(options, what, "export the network with an input (1, 3, height, width) of floats")
    told = [int(side) for side in re.findall(r"\d+", metadata.get("imgsz", ""))]
    width, height = options.size_px or (told[::-1] if len(told) == 2 else USUAL_PX)
    size_px = (sides[2] or width, sides[1] or height)
    if options.size_px not in (None, size_px):
        what = f"'size_px' is {list(options.size_px or ())}, and its input is fixed at {list(size_px)}"
        raise _error(options, what, "leave out 'size_px', or export the network again with an input of this size")
    return size_px


def _layout(session: InferenceSession, options: ExportedNetwork, facts: Facts) -> str:
    """Name of the layout, by a trial run on noise. Raises ModelFileError when there is none, or names are missing."""
    noise = np.random.default_rng(0).integers(0, 256, (*facts.size_px[::-1], 3)).astype(np.float32)
    try:
        outputs = run(session, noise, Preparation())
    except Exception as fault:  # the library's errors have no common class
        what = f"the network does not run ({str(fault).splitlines()[0][:160]})"
        raise _error(options, what, "export it again") from fault
    ports = f"{_shapes(session)} -> {', '.join(f'{name} {array.shape}' for name, array in outputs.items())}"
    name = options.layout or recognise(outputs, facts) or recognise(outputs, replace(facts, classes=None))
    if name is None or facts.task not in ("detect", *WITH_MORE_COLUMNS):
        hint = f"write 'layout: NAME' with one of {', '.join(LAYOUTS)}, or bring a class of errand.detectors"
        raise _error(options, f"{_guess(outputs, facts)}: {ports}", hint)
    if name not in LAYOUTS:
        raise _error(options, f"there is no layout {name!r}", suggestion(name, LAYOUTS))
    try:
        boxes, scores = decode(outputs, name, facts)
        fits, columns = boxes.shape == (len(scores), 4), scores.shape[1]
        if LAYOUTS[name].scores == "logits" and options.names and not isinstance(options.names, Mapping):
            every = decode(outputs, name, replace(facts, classes=None))[1].shape[1]  # perhaps with one for no object
            columns = columns if columns >= every - 1 else every
    except (ValueError, IndexError, KeyError):
        fits = False
    if not fits:
        what = f"its outputs are not of layout {name} ({LAYOUTS[name].about}): {ports}"
        raise _error(options, what, "leave out 'layout', or export it again")
    if facts.classes is None or columns != facts.classes:
        what = f"its layout is {name} with {columns or 'some'} classes, and {facts.classes or 'none'} are named"
        raise _error(options, f"{what}: {ports}", _NAMES_HINT)
    return name


def _guess(outputs: Outputs, facts: Facts) -> str:
    """Says what a network probably is that is no detector of a known layout."""
    ranks = {array.ndim for array in outputs.values()}
    if ranks == {2} or facts.task == "classify":
        return "it classifies whole pictures, and gives no boxes"
    if ranks == {4} or facts.task == "semantic":
        return "it gives a map of pixels (segmentation), and no boxes"
    return f"its outputs are of no layout that Errand reads (task '{facts.task[:40]}')"


def _shapes(session: InferenceSession) -> str:
    return ", ".join(f"{each.name} {each.type[7:-1]} {tuple(each.shape)}" for each in session.get_inputs())
