"""Layouts of detection networks that other tools export: how to recognise one, its input, and its boxes and scores."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from skills.inputs.yaml_source import read_yaml
from skills.perception.detector.boxes import PADDING

Floats = NDArray[np.float32]
Outputs = Mapping[str, NDArray[Any]]
"""Outputs of a run on one picture by name, with their batch axis; numbers with a fraction are float32."""
WITH_MORE_COLUMNS: Final = ("segment", "pose")
"""Tasks of Ultralytics whose rows go on behind the scores, with masks or key points."""
WITH_NO_OBJECT: Final = ("logits", "softmax")
"""Scores that may have a last column for no object, without a name."""


@dataclass(frozen=True)
class Preparation:
    """Preparation of a picture as the network's input: its place there, then (byte * scale - mean) / std.

    `fit`: letterbox centred or in the upper left corner, stretched, or native, as it is. `resize`: linear between
    bytes as OpenCV does, or floats as PyTorch does, or smooth as Pillow does, which averages when it scales down.
    """

    fit: Literal["letterbox", "corner", "stretch", "native"] = "letterbox"
    resize: Literal["bytes", "floats", "smooth"] = "bytes"
    scale: float = 1 / 255
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)
    colours: Literal["rgb", "bgr"] = "rgb"
    padding: int = PADDING


_STRIDES: Final = (8, 16, 32, 64)
_LARGEST_SHARE: Final = 1.5
"""Largest coordinate of boxes that are shares of the input's sides; in pixels, no object is so small."""
_LARGEST_IN_CELLS: Final = 16.0
"""Largest absolute value of the best boxes that are relative to their cells."""
_BEST: Final = 100
"""Number of the best boxes that tell whether a network decodes its boxes."""


@dataclass(frozen=True)
class Facts:
    """Properties of a network. `classes`: largest label + 1, None when nobody names the classes.

    `size_px`: width and height of its input. `task` and `about` are Ultralytics' metadata. `sized`: another input takes
    the picture's size. `channels_last`: the input is (1, height, width, 3), as in TensorFlow.
    """

    size_px: tuple[int, int]
    classes: int | None
    task: str = "detect"
    about: str = ""
    sized: bool = False
    channels_last: bool = False

    @property
    def cells(self) -> list[int]:
        """Numbers of cells of 8, 16 and 32 pixels, and of those and 64 pixels, in the input."""
        width, height = self.size_px
        return [sum((width // side) * (height // side) for side in _STRIDES[:count]) for count in (3, 4)]


@dataclass(frozen=True)
class Layout:
    """Meaning of a network's outputs, and how a picture becomes its input.

    `form`: a dense table whose columns or rows are boxes, a `list` of detections, `arrays` of their boxes, scores and
    labels, or a `pair` of boxes and the scores of classes. `boxes`: corners with u or v first, centre and sides, or
    `cells`: centre, and logarithms of the sides, relative to the cell. `scores`: for each class; the same times a score
    of any object (`objectness`: that alone if there is one class, which YOLOv5 and v7 do not train); as logits; as
    logits for `softmax` whose last class is no object; or one score and the label. `distinct`: one box for each object.
    `order`: columns of box, score and label in a list. `first_label`: the label of the first class.
    """

    about: str
    form: Literal["columns", "rows", "list", "arrays", "pair"]
    boxes: Literal["xyxy", "yxyx", "cxcywh", "cells"]
    scores: Literal["classes", "product", "objectness", "logits", "softmax", "label"]
    preparation: Preparation = Preparation()
    distinct: bool = True
    order: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    first_label: int = 0


LAYOUTS: Final = TypeAdapter(dict[str, Layout]).validate_python(read_yaml(Path(__file__).with_suffix(".yaml")).data)


def recognise(outputs: Outputs, facts: Facts) -> tuple[str, ...]:
    """Names of the layouts that fit the outputs of a trial run: several when their values leave it open."""
    if (found := _arrays(outputs)) is not None:
        return (_named_arrays(outputs, found[0], facts),)
    if (pair := _pair(outputs)) is not None:
        return _named_pair(outputs, *pair, facts.classes)
    first, *others = outputs.values()
    dense = {count * boxes for count in facts.cells for boxes in (1, 3)}
    (rows, columns), more = first.shape[-2:] if first.ndim > 1 else (0, 0), facts.task in WITH_MORE_COLUMNS
    if first.shape[:2] == (1, 1) and columns == 7:
        return ("detection_output",) if _is_list(first[0, 0], "detection_output", facts) else ()
    if first.ndim == 2 or (columns == 7 and rows not in dense):
        lists = tuple(name for name in LAYOUTS if _is_list(first.reshape(-1, columns), name, facts))
        if lists or first.ndim == 2:
            return lists
    if first.ndim != 3 or any(each.ndim < 4 for each in others):
        return ()
    labelled = rows not in dense and (columns == 6 or (more and 6 < columns < rows))
    if labelled and not np.any(first[..., 5] % 1):
        return ("rtdetr_labels" if "rtdetr" in facts.about.lower() else "end_to_end",)
    classes = facts.classes if facts.classes is not None else (rows - 4 if columns in dense else columns - 5)
    if rows == 4 + classes or (more and rows > 4 + classes):
        return ("yolo",)
    if columns == 4 + classes:
        return ("rtdetr" if _are_shares(first[..., :4]) else "yolo",)
    named = facts.classes is not None or rows in dense
    return (_named_rows(first[0], facts),) if columns == 5 + classes and named else ()


def _named_arrays(outputs: Outputs, boxes: NDArray[Any], facts: Facts) -> str:
    if "detection_boxes" in outputs:
        return "tensorflow"
    if any(each.shape[-1:] == (5,) for each in outputs.values()):
        return "mmdeploy"
    if facts.sized:
        return "dfine"
    if any(each.shape == (2,) and each.dtype.kind != "f" for each in outputs.values()):  # the picture's sides
        return "detectron2"
    return "ssd" if _are_shares(boxes) else "torchvision" if boxes.ndim == 2 else "nms"


def _named_pair(outputs: Outputs, boxes: NDArray[Any], values: NDArray[Any], classes: int | None) -> tuple[str, ...]:
    """Layouts of boxes and scores: with softmax, the last class, no object, is the likeliest of most boxes."""
    named, sigmoid = bool(outputs.keys() & {"dets", "pred_boxes"}), "rfdetr" if "dets" in outputs else "detr"
    if not named and np.all((values >= 0) & (values <= 1)):
        corners = (boxes[..., 2:] > boxes[..., :2]).all(axis=-1) | ~boxes.any(axis=-1)
        return ("darknet" if "confs" in outputs else "dense",) if 2 * corners.mean() > 1 else ()
    if not named and not (_are_shares(boxes) and np.all(boxes >= 0)):  # such as offsets from anchors
        return ()
    last = values.shape[-1] - 1
    if last == 0 or not values.any() or 2 * np.mean(values.argmax(axis=-1) == last) <= 1:
        return (sigmoid,)
    if np.median(values.max(axis=-1)) > 0:
        return ("detr_softmax",)
    return (sigmoid,) if sigmoid == "rfdetr" or classes == last + 1 else (sigmoid, "detr_softmax")


def _named_rows(table: NDArray[Any], facts: Facts) -> str:
    """Layout of dense rows, by their number for each cell, the scores of any object, and the size of the boxes."""
    if len(table) not in facts.cells:
        return "yolov5"
    if np.all(table[:, 4] == 1):
        return "yolov6"
    best = table[np.argsort(-table[:, 4] * table[:, 5:].max(axis=1), kind="stable")[:_BEST], :4]
    return "yolox_cells" if np.abs(best).max() < _LARGEST_IN_CELLS else "yolox"


def _is_list(table: NDArray[Any], name: str, facts: Facts) -> bool:
    """True when rows hold detections as a layout says: whole numbers as labels, and scores from 0 to 1."""
    layout = LAYOUTS[name]
    if layout.form != "list" or layout.boxes == "cxcywh" or table.shape[1] != max(layout.order) + 1:
        return False
    scores, labels = table[:, layout.order[4:]].T
    sound = not np.any(labels % 1) and not np.any((scores > 1) | ((scores < 0) & (scores != -1)))
    return sound and (layout.boxes == "yxyx") == facts.channels_last


def _arrays(outputs: Outputs) -> tuple[NDArray[Any], ...] | None:
    """Boxes (..., 4), scores (...) and labels (...) among outputs with one row for each detection."""
    boxes = next((each for each in outputs.values() if each.ndim in (2, 3) and each.shape[-1] in (4, 5)), None)
    if boxes is None:
        return None
    rows = {name: each for name, each in outputs.items() if each.shape == boxes.shape[:-1] and "num" not in name}
    whole = [name for name in rows if rows[name].dtype.kind != "f" or re.search("class|label", name)]
    real = sorted(rows.keys() - set(whole), key=lambda name: (not re.search("score|conf", name), [*rows].index(name)))
    scores = boxes[..., 4] if boxes.shape[-1] == 5 else rows[real[0]] if real else None
    return None if scores is None or not whole else (boxes[..., :4], scores, rows[whole[0]])


def _pair(outputs: Outputs) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Boxes (1, A, 4) or (1, A, 1, 4), and values (1, A, K), among outputs with one row for each box."""
    found = [name for name, each in outputs.items() if each.ndim in (3, 4) and each.shape[-1] == 4]
    boxes = min(found, key=lambda name: not re.search("box|dets", name), default=None)
    if len({outputs[name].shape[1] for name in found if re.search("box", name)}) > 1:  # heads of several strides
        return None
    others = [name for name, each in outputs.items() if name != boxes and each.ndim == 3]
    values = min(others, key=lambda name: not re.search("logit|score|conf|class|label", name), default=None)
    if boxes is None or values is None or outputs[values].shape[1] != outputs[boxes].shape[1]:
        return None
    return outputs[boxes], outputs[values]


def _are_shares(boxes: NDArray[Any]) -> bool:
    """True when the boxes are shares of the input's sides."""
    return bool(boxes.size and np.all(boxes <= _LARGEST_SHARE))


def decode(outputs: Outputs, name: str, facts: Facts) -> tuple[Floats, Floats]:
    """Boxes (A, 4) of (u0, v0, u1, v1) in pixels of the input, and scores (A, K), of outputs of a layout.

    Raises ValueError when the outputs do not have its form.
    """
    layout = LAYOUTS[name]
    boxes, values = _boxes_and_values(outputs, layout, facts)
    if layout.boxes == "yxyx":
        boxes = boxes[:, [1, 0, 3, 2]]
    if layout.boxes == "cells":
        boxes = _decoded(boxes, facts.size_px)
    elif _are_shares(boxes):
        boxes = boxes * np.array(facts.size_px * 2, dtype=np.float32)
    if layout.boxes in ("cxcywh", "cells"):
        boxes = np.concatenate([boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2], axis=1)
    if layout.scores == "label":
        return boxes, np.where(values[:, 1:2] == np.arange(facts.classes or 0), values[:, :1], 0.0)
    if layout.scores in ("product", "objectness"):
        alone = layout.scores == "objectness" and values.shape[1] == 2
        values = values[:, :1] if alone else values[:, :1] * values[:, 1:]
    if layout.scores == "softmax":
        values = np.exp(values - values.max(axis=1, keepdims=True))
        values = values / values.sum(axis=1, keepdims=True) * (np.arange(values.shape[1]) < values.shape[1] - 1)
    if layout.scores == "logits":
        values = 0.5 * (1.0 + np.tanh(0.5 * values))
    more = layout.scores in WITH_NO_OBJECT or facts.task in WITH_MORE_COLUMNS
    return boxes, values[:, : facts.classes] if more else values


def _boxes_and_values(outputs: Outputs, layout: Layout, facts: Facts) -> tuple[Floats, Floats]:
    """Boxes (A, 4), and their values (A, ...): scores of the classes, or a score and a label."""
    if layout.form in ("arrays", "pair"):
        found = _arrays(outputs) if layout.form == "arrays" else _pair(outputs)
        if found is None:
            raise ValueError("there are no boxes")
        boxes, *more = (each[0] if found[0].ndim > 2 else each for each in found)
        return boxes.reshape(-1, 4), more[0] if layout.form == "pair" else np.stack(more, axis=1)
    first = next(iter(outputs.values()))
    table = first[(0,) * (first.ndim - 2)]
    if layout.form == "list":
        table = table if 0 in layout.order else table[table[:, 0] == table[:1, 0]]
        return table[:, layout.order[:4]], table[:, layout.order[4:]]
    if layout.form == "columns" and table.shape[1] != 4 + (facts.classes or 0):
        table = table.T
    return table[:, :4], table[:, 4:]


def _decoded(boxes: Floats, size_px: tuple[int, int]) -> Floats:
    """Centres and sides in pixels of boxes relative to the cells of an input."""
    grids = [np.meshgrid(np.arange(size_px[0] // side), np.arange(size_px[1] // side)) for side in _STRIDES]
    sides = np.repeat(_STRIDES, [grid[0].size for grid in grids])[: len(boxes), None]
    cells = np.concatenate([np.stack(grid, axis=-1).reshape(-1, 2) for grid in grids])[: len(boxes)]
    return np.concatenate([(boxes[:, :2] + cells) * sides, np.exp(np.minimum(boxes[:, 2:], 10.0)) * sides], axis=1)
