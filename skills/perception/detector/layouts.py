"""Layouts of detection networks that other tools export: how to recognise one, its input, and its boxes and scores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from skills.perception.detector.boxes import PADDING, Floats

Outputs = Mapping[str, NDArray[Any]]
"""Outputs of a run on one picture by name, with their batch axis; numbers with a fraction are float32."""
WITH_MORE_COLUMNS: Final = ("segment", "pose")
"""Tasks of Ultralytics whose rows go on behind the scores, with masks or key points."""


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


NATIVE, STRETCHED, SMOOTH = Preparation("native"), Preparation("stretch"), Preparation("stretch", resize="smooth")
IMAGENET: Final = Preparation("stretch", "floats", mean=(0.485, 0.456, 0.406), std=(0.229, 0.224, 0.225))


@dataclass(frozen=True)
class Facts:
    """Properties of a network. `classes`: largest label + 1, None when nobody names the classes.

    `size_px`: width and height of its input. `task` and `about` are Ultralytics' metadata.
    """

    size_px: tuple[int, int]
    classes: int | None
    task: str = "detect"
    about: str = ""


@dataclass(frozen=True)
class Layout:
    """Meaning of a network's outputs, and how a picture becomes its input.

    `boxes`: corners, or centre and sides; `shares` of the input's sides, else in its pixels. `scores`: for each class,
    as logits, behind a score of any object, or one score and the label. `distinct`: one box for each object.
    """

    about: str
    boxes: Literal["xyxy", "cxcywh"]
    scores: Literal["classes", "logits", "objectness", "label"]
    shares: bool = False
    preparation: Preparation = Preparation()
    distinct: bool = True


LAYOUTS: Final = {
    "yolo": Layout("Ultralytics YOLO: one output (1, 4 + K, A)", "cxcywh", "classes", distinct=False),
    "yolov5": Layout("YOLOv5 or v7: one output (1, A, 5 + K)", "cxcywh", "objectness", distinct=False),
    "end_to_end": Layout("YOLOv10, YOLO26, or any with nms=True: one output (1, N, 6)", "xyxy", "label"),
    "rtdetr": Layout("RT-DETR of Ultralytics: one output (1, Q, 4 + K)", "cxcywh", "classes", True, STRETCHED),
    "rtdetr_labels": Layout("RT-DETR of Ultralytics: one output (1, Q, 6)", "cxcywh", "label", True, STRETCHED),
    "rfdetr": Layout("RF-DETR: dets (1, Q, 4), labels (1, Q, K)", "cxcywh", "logits", True, IMAGENET),
    "detr": Layout("Transformers: pred_boxes (1, Q, 4), logits (1, Q, K)", "cxcywh", "logits", True, SMOOTH),
    "dfine": Layout("D-FINE, RT-DETR: boxes (1, N, 4), scores (1, N), labels (1, N)", "xyxy", "label", False, SMOOTH),
    "torchvision": Layout("TorchVision: boxes (N, 4), scores (N), labels (N)", "xyxy", "label", False, NATIVE),
    "darknet": Layout("Darknet: boxes (1, A, 1, 4), confs (1, A, K)", "xyxy", "classes", True, STRETCHED, False),
}
_OUTPUTS: Final = {"rfdetr": ("dets", "labels"), "detr": ("pred_boxes", "logits"), "darknet": ("boxes", "confs")}
"""Names of boxes and scores."""


def recognise(outputs: Outputs, facts: Facts) -> str | None:
    """Name of the layout of the outputs of a trial run on noise; None when it is none of LAYOUTS."""
    first, *others = outputs.values()
    if (found := _boxes_scores_labels(outputs)) is not None:
        return "torchvision" if found[0].ndim == 2 else "dfine"
    if named := next((name for name, pair in _OUTPUTS.items() if outputs.keys() >= {*pair}), None):
        return named
    if first.ndim != 3 or any(each.ndim != 4 for each in others):
        return None
    (rows, columns), classes, more = first.shape[1:], facts.classes, facts.task in WITH_MORE_COLUMNS
    labelled = (columns == 6 or (more and 6 < columns < rows)) and not np.any(first[..., 5] % 1)
    if "rtdetr" in facts.about.lower():
        return "rtdetr_labels" if labelled else "rtdetr"
    if labelled:
        return "end_to_end"
    if classes is None:  # a cell of 32 pixels has 4 of 16 and 16 of 8 pixels, each with one box or three
        return "yolo" if columns % 21 == 0 else "yolov5" if rows % 63 == 0 else None
    if rows == 4 + classes or (more and rows > 4 + classes):
        return "yolo"
    return "yolov5" if columns == 5 + classes else None


def _boxes_scores_labels(outputs: Outputs) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]] | None:
    """Boxes (..., 4), scores (...) and integer labels (...) among outputs with one row for each detection."""
    boxes = next((each for each in outputs.values() if each.ndim in (2, 3) and each.shape[-1] == 4), None)
    rows = [each for each in outputs.values() if boxes is not None and each.shape == boxes.shape[:-1]]
    scores, labels = ([each for each in rows if (each.dtype.kind == "f") == real] for real in (True, False))
    return (boxes, scores[0], labels[0]) if boxes is not None and scores and labels else None


def decode(outputs: Outputs, name: str, facts: Facts) -> tuple[Floats, Floats]:
    """Boxes (A, 4) of (u0, v0, u1, v1) in pixels of the input, and scores (A, K), of outputs of a layout."""
    layout, found = LAYOUTS[name], _boxes_scores_labels(outputs)
    if name in _OUTPUTS:
        boxes, values = (outputs[each][0].reshape(-1, outputs[each].shape[-1]) for each in _OUTPUTS[name])
    elif found is not None:
        boxes, values = found[0].reshape(-1, 4), np.stack([each.ravel() for each in found[1:]], axis=1)
    else:
        rows = next(iter(outputs.values()))[0]
        boxes, values = np.split(rows.T if name == "yolo" else rows, [4], axis=1)
    if layout.boxes == "cxcywh":
        boxes = np.concatenate([boxes[:, :2] - boxes[:, 2:] / 2, boxes[:, :2] + boxes[:, 2:] / 2], axis=1)
    if layout.shares:
        boxes = boxes * np.array(facts.size_px * 2, dtype=np.float32)
    if layout.scores == "label":
        return boxes, np.where(values[:, 1:2] == np.arange(facts.classes or 0), values[:, :1], 0.0)
    if layout.scores == "objectness":
        values = values[:, :1] * values[:, 1:]
    if layout.scores == "logits":
        values = 0.5 * (1.0 + np.tanh(0.5 * values))
    more = layout.scores == "logits" or facts.task in WITH_MORE_COLUMNS
    return boxes, values[:, : facts.classes] if more else values
