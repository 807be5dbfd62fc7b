"""Each layout of exported networks, on a small ONNX file with constant outputs: one coke at (16, 8) to (48, 56)."""

import numpy as np
import pytest

from errand_make.detectors.exported import ExportedNetwork, load_exported
from errand_make.detectors.layouts import LAYOUTS
from skills.inputs.errors import InputError
from tests.skills.exported_networks import export

NAMES = {"names": "{0: 'bottle', 1: 'coke', 2: 'hammer'}", "task": "detect"}
RTDETR = {**NAMES, "description": "Ultralytics rtdetr-l model"}
PICTURE = np.zeros((64, 64, 3), np.uint8)
CORNERS, CENTRE = [16, 8, 48, 56], [32, 32, 32, 48]
SHARES, CENTRE_SHARES = [each / 64 for each in CORNERS], [each / 64 for each in CENTRE]
SCORES = [0.125, 0.75, 0.25]
LOGITS = np.log(np.array(SCORES) / (1 - np.array(SCORES))).tolist()


HEADS = (("cls", 3), ("bbox", 4))
BACKGROUND = {"names": "{0: 'background', 1: 'coke', 2: 'hammer'}"}


def f32(*values):
    return np.array(values, np.float32)


def rows(*row, others=8, empty=0.0):
    """One row with an object and others that are empty."""
    return np.concatenate([f32([row]), np.full((1, others, len(row)), empty, np.float32)], axis=1)


NO_OBJECT = rows(*np.log([*SCORES, 0.001]) + 5, empty=-9)
NO_OBJECT[0, 1:, 3] = 5
CASES = {
    "yolo": ({"output0": rows(*CENTRE, *SCORES).transpose(0, 2, 1)}, NAMES),
    "yolov5": ({"output0": rows(*CENTRE, 0.8, 0.1, 0.75 / 0.8, 0.2)}, NAMES),
    "end_to_end": ({"output0": rows(*CORNERS, 0.75, 1)}, NAMES),
    "rtdetr": ({"output0": rows(*CENTRE_SHARES, *SCORES)}, RTDETR),
    "rtdetr_labels": ({"output0": rows(*CENTRE_SHARES, 0.75, 1)}, RTDETR),
    "rfdetr": ({"dets": rows(*CENTRE_SHARES), "labels": rows(*LOGITS, 9, empty=-9)}, NAMES),
    "detr": ({"logits": rows(*LOGITS, empty=-9), "pred_boxes": rows(*CENTRE_SHARES)}, NAMES),
    "nms": ({"labels": np.array([[1, 2]]), "boxes": f32([CORNERS, CORNERS]), "scores": f32([0.75, 0])}, NAMES),
    "ssd": ({"labels": np.array([[1, 2]]), "boxes": f32([SHARES, SHARES]), "scores": f32([0.75, 0])}, NAMES),
    "mmdeploy": ({"dets": rows(*CORNERS, 0.75), "labels": np.array([[1] + [0] * 8])}, NAMES),
    "yolov6": (
        {"output": rows(*CENTRE, 1, *SCORES, others=83) + f32(*[0] * 4, 1, *[0] * 3) * (np.arange(84)[:, None] > 0)},
        NAMES,
    ),
    "yolox": ({"output": rows(*CENTRE, 0.8, 0.1, 0.75 / 0.8, 0.2, others=83)}, NAMES),
    "yolox_cells": ({"output": rows(4, 4, np.log(4), np.log(6), 0.8, 0.1, 0.75 / 0.8, 0.2, others=83)}, NAMES),
    "yolov7_nms": ({"output": f32([0, *CORNERS, 1, 0.75])}, NAMES),
    "yolo_nas": ({"output": f32([0, *CORNERS, 0.75, 1])}, NAMES),
    "paddle": ({"multiclass_nms3_0": f32([1, 0.75, *CORNERS]), "bbox_num": np.array([1])}, NAMES),
    "detr_softmax": ({"logits": NO_OBJECT, "pred_boxes": rows(*CENTRE_SHARES)}, NAMES),
    "dense": ({"scores": rows(*SCORES), "boxes": rows(*CORNERS)}, NAMES),
    "torchvision": ({"a": f32(CORNERS), "b": np.array([1]), "c": f32(0.75)}, NAMES),
    "detectron2": ({"4": f32(CORNERS), "5": np.array([1]), "6": f32(0.75), "7": np.array([64, 64])}, NAMES),
    "detection_output": ({"out": f32([[[0, 1, 0.75, *SHARES], [-1] + [0] * 6]])}, NAMES),
    "darknet": ({"boxes": rows(*SHARES)[:, :, None], "confs": rows(*SCORES)}, NAMES),
}


ROW_FIRST = [8, 16, 56, 48]
TENSORFLOW = {
    "efficientdet": {"detections": rows(0, *ROW_FIRST, 0.75, 1)},
    "tensorflow": {
        "num_detections": f32(1),
        "detection_anchor_indices": rows(7)[..., 0],
        "detection_boxes": rows(*[each / 64 for each in ROW_FIRST]),
        "detection_scores": rows(0.75)[..., 0],
        "detection_classes": rows(1)[..., 0],
    },
}


def loaded(file, **options):
    return load_exported(ExportedNetwork(file, **options), every=True)


def best(detector, picture=PICTURE):
    one = detector.detect([picture])[0][0]
    return one.class_name, pytest.approx(one.score, abs=1e-3), pytest.approx(one.box, abs=1e-2)


@pytest.mark.parametrize("layout", CASES)
def test_a_network_of_the_layout_is_recognised_and_decoded(layout, tmp_path):
    outputs, metadata = CASES[layout]
    detector = loaded(export(tmp_path / "own.onnx", outputs, metadata=metadata))
    assert detector.layout == layout
    name, score, box = best(detector)
    assert (name, 0.75 / 1.126 if layout == "detr_softmax" else 0.75, tuple(CORNERS)) == (name, score, box)
    assert name == "coke"


def test_each_layout_is_tested():
    assert {*CASES, *TENSORFLOW, "dfine"} == {*LAYOUTS}


@pytest.mark.parametrize("layout", TENSORFLOW)
def test_boxes_of_tensorflow_begin_with_the_row(layout, tmp_path):
    outputs = TENSORFLOW[layout]
    file = export(tmp_path / "own.onnx", outputs, shape=(1, 64, 64, 3), dtype="uint8", metadata=BACKGROUND)
    detector = loaded(file)
    assert detector.layout == layout
    assert ("coke", 0.75, tuple(CORNERS)) == best(detector)


def test_the_tables_column_of_background_gives_no_detection(tmp_path):
    outputs, metadata = CASES["rfdetr"]
    found = loaded(export(tmp_path / "own.onnx", outputs, metadata=metadata)).detect([PICTURE])[0]
    assert [one.class_name for one in found] == ["coke"]


def test_masks_beside_the_boxes_are_left_out(tmp_path):
    outputs = {
        "output0": rows(*CENTRE, *SCORES, 7, 8).transpose(0, 2, 1),
        "output1": np.ones((1, 2, 16, 16), np.float32),
    }
    detector = loaded(export(tmp_path / "own.onnx", outputs, metadata={**NAMES, "task": "segment"}))
    assert ("coke", 0.75, tuple(CORNERS)) == best(detector)


def test_hidden_states_beside_boxes_and_logits_are_left_out(tmp_path):
    outputs, metadata = CASES["detr"]
    detector = loaded(
        export(tmp_path / "own.onnx", {"last_hidden_state": rows(*[3] * 16), **outputs}, metadata=metadata)
    )
    assert ("coke", 0.75, tuple(CORNERS)) == best(detector)


def test_raw_heads_beside_the_boxes_are_left_out(tmp_path):
    outputs, metadata = CASES["yolov5"]
    outputs = {**outputs, "397": np.ones((1, 3, 8, 8, 8), np.float32)}
    assert ("coke", 0.75, tuple(CORNERS)) == best(loaded(export(tmp_path / "own.onnx", outputs, metadata=metadata)))


def test_heads_of_several_strides_are_no_boxes_with_scores(tmp_path):
    heads = {f"{name}_{side}": np.zeros((1, side, count), np.float32) for side in (64, 16) for name, count in HEADS}
    with pytest.raises(InputError, match="no layout that Errand reads"):
        loaded(export(tmp_path / "own.onnx", heads, metadata=NAMES))


def test_boxes_of_dfine_are_in_pixels_of_the_size_that_it_is_given(tmp_path):
    outputs = {"labels": np.array([[1]]), "boxes": f32([SHARES]), "scores": f32([0.75])}
    file = export(tmp_path / "own.onnx", outputs, metadata=NAMES, sizes="orig_target_sizes")
    assert best(loaded(file), np.zeros((64, 128, 3), np.uint8)) == ("coke", 0.75, (32, 8, 96, 56))


@pytest.mark.parametrize("shape", [("N", 3, "H", "W"), (2, 3, 64, 64), (1, 3, "H", "W")])
def test_inputs_with_a_batch_or_of_any_size_are_filled(shape, tmp_path):
    outputs, metadata = CASES["yolo"]
    file = export(tmp_path / "own.onnx", outputs, shape=shape, metadata={**metadata, "imgsz": "[64, 64]"})
    assert ("coke", 0.75, tuple(CORNERS)) == best(loaded(file))


def test_half_precision_is_read(tmp_path):
    outputs = {"output0": rows(*CENTRE, *SCORES).transpose(0, 2, 1).astype(np.float16)}
    assert ("coke", 0.75, tuple(CORNERS)) == best(
        loaded(export(tmp_path / "own.onnx", outputs, dtype="float16", metadata=NAMES))
    )


def test_a_named_layout_decides(tmp_path):
    file = export(tmp_path / "own.onnx", CASES["rtdetr"][0], metadata=NAMES)
    assert ("coke", 0.75, tuple(CORNERS)) == best(loaded(file, layout="rtdetr"))
