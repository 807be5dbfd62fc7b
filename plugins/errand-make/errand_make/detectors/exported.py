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

from errand_make.detectors.layouts import (
    LAYOUTS,
    WITH_MORE_COLUMNS,
    WITH_NO_OBJECT,
    Facts,
    Floats,
    Outputs,
    Preparation,
    decode,
    recognise,
)
from skills.api import Detection, Detector
from skills.class_forms import class_forms
from skills.inputs.errors import nearest_name, suggestion
from skills.inputs.outside import read_text
from skills.perception.detector import Cascade
from skills.perception.detector.boxes import SuppressionOptions, check_picture, detections_from, select_candidates
from skills.perception.detector.model_files import ModelFileError, is_cascade, open_session
from skills.perception.shape_model import ShapeModel, shape_model
from skills.quantities import Count, Factor, Quantity, Share
from skills.robot import Picture

if TYPE_CHECKING:
    from onnxruntime import InferenceSession, NodeArg

USUAL_PX: Final = (640, 640)
_PICTURE_DTYPES: Final = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(uint8)": np.uint8}
_DTYPES: Final = {**_PICTURE_DTYPES, "tensor(int64)": np.int64, "tensor(int32)": np.int32, "tensor(bool)": np.bool_}
_TRIAL_SIZES: Final = ((480, 640), (640, 480), (300, 400))
"""Rows and columns of the pictures on which a network is tried."""
_BINS: Final = (8, 16, 17)
"""Bins of the distributions by which some heads, such as NanoDet's, describe each side of a box."""
_UNFINISHED: Final = ("its outputs are of a head, whose boxes are still to be computed", "export it with that step")
_BACKGROUND: Final = ("background", "__background__", "no object", "N/A")
"""Names of classes that are no object."""
_FAINT: Final = 0.05
"""Score from which on a label of the trial picture counts."""
_MANY: Final = 2000
_SURE: Final = 0.25
"""Score from which on the box of a trial picture must lie in it."""
_NEAR: Final = 1.0
"""Distance of such a box's middle from the picture's, as a share of the sides: it may lie in the padding."""
_LEAST_BOX_PX: Final = 2.0
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

    def build_for_pictures(self, threshold: float) -> Detector:
        """Loads the network for single pictures, also one of Errand's own. Raises InputError for an unusable file."""
        if is_cascade(self.file):
            return Cascade(self.file).build_for_pictures(threshold)
        return load_exported(self, threshold, every=True)


@dataclass(frozen=True)
class ExportedDetector(Detector):
    """Detector that runs an exported network. Several threads may use it at once.

    `labels`: for each class that it reports, the network's labels that stand for it. `about`: how it is read.
    """

    session: InferenceSession
    layout: str
    facts: Facts
    preparation: Preparation
    labels: tuple[list[int], ...]
    threshold: float
    suppression: SuppressionOptions
    class_names: tuple[str, ...] = ()
    about: str = ""

    @property
    def shapes(self) -> ShapeModel | None:
        """The project's own shape model where it knows all classes."""
        model = shape_model()
        return model if {*self.class_names} <= {*model.names} else None

    def detect(self, pictures: Sequence[Picture]) -> list[tuple[Detection, ...]]:
        """Detects the objects in each picture, best first. Raises ValueError when an array is no picture."""
        return [self.detect_in_views(picture) for picture in pictures]

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> tuple[Detection, ...]:
        """Detects the objects in one picture, best first; `least_score` replaces the threshold."""
        check_picture(picture)
        threshold = self.threshold if least_score is None else least_score
        boxes, scores = self.boxes_and_scores(picture)
        if not LAYOUTS[self.layout].distinct:  # a box is of its best class alone, also where that is not reported
            scores = np.where(scores == scores.max(axis=1, keepdims=True), scores, 0.0)
        scores = np.stack([scores[:, labels].max(axis=1) for labels in self.labels], axis=1)
        least = min(threshold, _ALTERNATIVE_SCORE)
        candidates = select_candidates(boxes, scores, least, self.suppression.most_candidates)
        found = detections_from(candidates, self.class_names, threshold, self.suppression)
        clipped = [np.clip(one.box, 0, picture.shape[1::-1] * 2).tolist() for one in found]
        boxed = zip(found, clipped, strict=True)
        return tuple(replace(one, box=(u0, v0, u1, v1)) for one, (u0, v0, u1, v1) in boxed if u1 > u0 and v1 > v0)

    def boxes_and_scores(self, picture: Picture) -> tuple[Floats, Floats]:
        """Boxes (A, 4) in pixels of the picture, and scores (A, K) of the network's labels."""
        colour = np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
        image, scale, corner = place(colour, self.facts.size_px, self.preparation)
        facts = replace(self.facts, size_px=image.shape[1::-1])
        boxes, scores = decode(run(self.session, image, self.preparation), self.layout, facts)
        return ((boxes - np.array(corner * 2)) / np.array(scale * 2)).astype(np.float32), scores


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
    """Runs a network on an image (H, W, 3) of bytes.

    An input for the picture's size, its scale or a mask of its pixels gets ones: boxes of size 1 are shares.
    """
    first, others = _ports(session)
    ordered = image[..., ::-1] if how.colours == "bgr" else image
    values: NDArray[Any] = ((ordered * np.float64(how.scale) - how.mean) / how.std).astype(_DTYPES[first.type])
    values = values if _has_channels_last(first) else np.moveaxis(values, 2, 0)
    batch = first.shape[0] if len(first.shape) == 4 and isinstance(first.shape[0], int) else 1
    feed = {first.name: values if len(first.shape) == 3 else np.repeat(values[None], batch, axis=0)}
    for port in others:
        sides = zip(port.shape, (batch, *image.shape[:2]), strict=False)
        feed[port.name] = np.ones([n if isinstance(n, int) else other for n, other in sides], _DTYPES[port.type])
    found = zip([port.name.partition(":")[0] for port in session.get_outputs()], session.run(None, feed), strict=True)
    return {name: value.astype(np.float32) if value.dtype.kind == "f" else value for name, value in found}


def _ports(session: InferenceSession) -> tuple[NodeArg, list[NodeArg]]:
    """Input for the picture, and the other inputs."""
    ports = session.get_inputs()
    first = next((port for port in ports if len(port.shape) in (3, 4) and 3 in port.shape), ports[0])
    return first, [port for port in ports if port is not first]


def _has_channels_last(port: NodeArg) -> bool:
    return bool(port.shape[-1] == 3 != port.shape[-3])


def load_exported(options: ExportedNetwork, threshold: float | None = None, *, every: bool) -> ExportedDetector:
    """Loads an exported network; `every`: reports also classes that are no words of Errand.

    Raises ModelFileError when the file cannot be read, or is no detector of a known layout.
    """
    session = open_session(options.file)
    metadata = session.get_modelmeta().custom_metadata_map
    names, classes, forms = _names(options, metadata), options.classes, class_forms()
    size_px, count = _size_px(session, options, metadata), max(names) + 1 if names else None
    (first, others), about = _ports(session), " ".join(metadata.values())
    sized, channels_last = any(len(port.shape) == 2 for port in others), _has_channels_last(first)
    facts = Facts(size_px, count, metadata.get("task", "detect"), about, sized, channels_last)
    usual = _usual_values(first.type, metadata)
    layout = _layout(session, options, facts, Preparation("stretch", **usual))
    if LAYOUTS[layout].first_label and names.get(0, _BACKGROUND[0]) not in _BACKGROUND:
        table = textwrap.shorten(", ".join(f"{label + 1}: {name}" for label, name in names.items()), 80)
        raise _error(options, f"its layout is {layout}, whose labels count from 1", f"write 'names: {{{table}}}'")
    words = {label: classes.get(theirs, theirs) for label, theirs in names.items() if theirs not in _BACKGROUND}
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
    usual |= {key: one for key, one in given.items() if one is not None}
    preparation = replace(LAYOUTS[layout].preparation, **usual)
    if preparation.fit == "native" and all(isinstance(side, int) for side in first.shape[-3:]):
        preparation = replace(preparation, fit="letterbox")
    overlap = 1.0 if LAYOUTS[layout].distinct else options.overlap
    suppression = SuppressionOptions(overlap, other_class=1.0, most_candidates=3000)
    least = options.threshold if threshold is None else threshold
    detector = ExportedDetector(session, layout, facts, preparation, labels, least, suppression, reported)
    meanings = [f"{label} {names[label]}" + f" ({word})" * (word != names[label]) for label, word in words.items()]
    shown = textwrap.shorten(", ".join(meanings), 120, placeholder=" ...")
    return replace(detector, about=f"{_tried(detector, options)}; labels {shown}")


def _usual_values(kind: str, metadata: Mapping[str, str]) -> dict[str, Any]:
    """Values of the input that its type, or Windows' metadata, demand."""
    colours = {"colours": "bgr"} if metadata.get("Image.BitmapPixelFormat") == "Bgr8" else {}
    full = kind == "tensor(uint8)" or metadata.get("Image.NominalPixelRange") == "NominalRange_0_255"
    return {**colours, **({"scale": 1.0, "mean": (0.0,) * 3, "std": (1.0,) * 3} if full else {})}


def _trial_picture(rows: int, columns: int) -> Picture:
    """Draws a red box and a white disc on a shaded floor."""
    picture = np.full((rows, columns, 3), np.linspace(60, 180, rows)[:, None, None], dtype=np.uint8)
    cv2.rectangle(picture, (columns // 8, rows // 4, columns // 4, rows // 2), (200, 30, 30), cv2.FILLED)
    cv2.circle(picture, (2 * columns // 3, rows // 2), rows // 5, (240, 240, 240), cv2.FILLED)
    return picture


def _tried(detector: ExportedDetector, options: ExportedNetwork) -> str:
    """Tries a detector on pictures of three sizes, and says how it reads the network, and what the scores were.

    Raises ModelFileError when it cannot run, or its scores or boxes cannot be meant so.
    """
    best, inside, how = 0.0, "", detector.preparation
    for rows, columns in _TRIAL_SIZES:
        try:
            boxes, scores = detector.boxes_and_scores(_trial_picture(rows, columns))
        except Exception as fault:  # the library's errors have no common class
            what = f"the network does not run on a picture of {columns} x {rows} pixels ({_first_line(fault)})"
            raise _error(options, what, "export it with an input of one size, or of any") from fault
        low, high = float(scores.min(initial=0.0)), float(scores.max(initial=0.0))
        if not -1.001 < low <= high < 1.001:
            what = f"its scores go from {low:.2g} to {high:.2g}, and not from 0 to 1"
            raise _error(options, what, "export it in full precision with its sigmoid or softmax, or write 'layout'")
        sure = boxes[scores.max(axis=1, initial=0.0) >= _SURE]
        middle = (sure[:, :2] + sure[:, 2:]) / 2 / (columns, rows)
        good = (np.abs(middle - 0.5) < _NEAR).all(axis=1) & (sure[:, 2:] - sure[:, :2] > _LEAST_BOX_PX).all(axis=1)
        if 2 * np.count_nonzero(good) < len(good):
            box = ", ".join(f"{value:.1f}" for value in sure[~good][0])
            what = f"as {detector.layout} it finds the box {box} in a picture of {columns} x {rows} pixels"
            raise _error(options, what, "write another 'layout', or export it with boxes in pixels of its input")
        best, inside = max(best, high), ", boxes in the picture" if len(sure) else inside
    low, high = ((byte * how.scale - how.mean[0]) / how.std[0] for byte in (0, 255))
    size = "any size" if how.fit == "native" else "{} x {} ({})".format(*detector.facts.size_px, how.fit)
    taken = f"takes {how.colours.upper()} of {size} from {low:.3g} to {high:.3g}"
    return f"{LAYOUTS[detector.layout].about}; {taken}; on pictures of three sizes: scores up to {best:.2f}{inside}"


def _first_line(fault: Exception) -> str:
    return str(fault).strip().splitlines()[0][:160]


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
    first, others = _ports(session)
    sides = [side if isinstance(side, int) else 0 for side in first.shape[-3:]]
    sides = [*sides[2:], *sides[:2]] if len(sides) == 3 and _has_channels_last(first) else sides
    if len(first.shape) not in (3, 4) or sides[0] not in (0, 3) or first.type not in _PICTURE_DTYPES:
        what = f"it takes no picture in colour: {_shapes(session)}"
        raise _error(options, what, "export the network with an input (1, 3, height, width) of floats")
    for port in others:
        if (len(port.shape) != 3 and port.shape[1:] != [2]) or port.type not in _DTYPES:
            what = f"beside the picture it takes '{port.name}', which Errand cannot give: {_shapes(session)}"
            raise _error(options, what, "export it without this input")
    told = [int(side) for side in re.findall(r"\d+", metadata.get("imgsz", ""))]
    width, height = options.size_px or (told[::-1] if len(told) == 2 else USUAL_PX)
    size_px = (sides[2] or width, sides[1] or height)
    if options.size_px not in (None, size_px):
        what = f"'size_px' is {list(options.size_px or ())}, and its input is fixed at {list(size_px)}"
        raise _error(options, what, "leave out 'size_px', or export the network again with an input of this size")
    return size_px


def _layout(session: InferenceSession, options: ExportedNetwork, facts: Facts, how: Preparation) -> str:
    """Name of the layout, by a trial run. Raises ModelFileError when there is none, or names are missing."""
    try:
        outputs = run(session, _trial_picture(*facts.size_px[::-1]), how)
    except Exception as fault:  # the library's errors have no common class
        raise _error(options, f"the network does not run ({_first_line(fault)})", "export it again") from fault
    ports = f"{_shapes(session)} -> {', '.join(f'{name} {array.shape}' for name, array in outputs.items())}"
    first = next(iter(outputs.values()))
    spread = np.any(first < 0) and {4 * bins + (facts.classes or 0) for bins in _BINS} & {*first.shape[1:]}
    fitting = recognise(outputs, facts) or (() if spread else recognise(outputs, replace(facts, classes=None)))
    name = options.layout or next(iter(fitting), None)
    if len(fitting) > 1 and not options.layout:
        hint = " or ".join(f"'layout: {each}' ({LAYOUTS[each].about})" for each in fitting)
        raise _error(options, f"its outputs may mean two things: {ports}", f"write {hint}")
    if name is None or facts.task not in ("detect", *WITH_MORE_COLUMNS):
        what, hint = _UNFINISHED if spread else _guess(outputs, facts)
        raise _error(options, f"{what}: {ports}", hint)
    if name not in LAYOUTS:
        raise _error(options, f"there is no layout {name!r}", suggestion(name, LAYOUTS))
    try:
        boxes, scores = decode(outputs, name, facts)
        listed, layout = options.names and not isinstance(options.names, Mapping), LAYOUTS[name]
        ordered = layout.form != "list" or any(LAYOUTS[each].order == layout.order for each in fitting)
        fits, columns = ordered and boxes.shape == (len(scores), 4), scores.shape[1]
        if layout.scores in WITH_NO_OBJECT and listed:
            every = decode(outputs, name, replace(facts, classes=None))[1].shape[1]  # perhaps with one for no object
            columns = columns if columns >= every - 1 else every
        if layout.scores == "label" and listed and not layout.first_label:
            seen = np.flatnonzero((decode(outputs, name, replace(facts, classes=_MANY))[1] > _FAINT).any(axis=0))
            columns = int(seen.max(initial=columns - 1)) + 1
    except (ValueError, IndexError, KeyError):
        fits = False
    if not fits:
        what = f"its outputs are not of layout {name} ({LAYOUTS[name].about}): {ports}"
        raise _error(options, what, "leave out 'layout', or export it again" if options.layout else "export it again")
    if facts.classes is None or columns != facts.classes:
        what = f"its layout is {name} with {columns or 'some'} classes, and {facts.classes or 'none'} are named"
        raise _error(options, f"{what}: {ports}", _NAMES_HINT)
    return name


def _guess(outputs: Outputs, facts: Facts) -> tuple[str, str]:
    """Says what a network probably is that is no detector of a known layout, and the mend."""
    ranks, first = {array.ndim for array in outputs.values()}, next(iter(outputs.values()))
    if facts.task == "classify" or (ranks == {2} and len(outputs) == 1):
        return "it classifies whole pictures, and gives no boxes", "name a network that detects objects"
    fine = ranks == {4} and len(outputs) == 1 and 64 * first[0, 0].size >= facts.size_px[0] * facts.size_px[1]
    if facts.task == "semantic" or fine:
        return "it gives a map of pixels (segmentation), and no boxes", "name a network that detects objects"
    if ranks <= {4, 5}:
        return _UNFINISHED
    hint = "export it as one of plugins/errand-make/docs/own-detector.md, or bring a class of errand.detectors"
    return f"its outputs are of no layout that Errand reads (task '{facts.task[:40]}')", hint


def _shapes(session: InferenceSession) -> str:
    return ", ".join(f"{each.name} {each.type[7:-1]} {tuple(each.shape)}" for each in session.get_inputs())
