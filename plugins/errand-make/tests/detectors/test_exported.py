"""Detector of an exported network: preparation of the picture, class names, words, suppression, and refusals."""

import numpy as np
import onnx
import pytest

from errand_make.detectors.exported import ExportedNetwork, load_exported, place
from errand_make.detectors.layouts import LAYOUTS
from skills.inputs.errors import InputError
from skills.perception.detector import Cascade
from skills.perception.detector.model_files import ModelFileError
from skills.stack import stack_of
from tests.skills.exported_networks import export, mean_colour

THREE = {"names": "{0: 'bottle', 1: 'coke', 2: 'hammer'}"}
RED = np.full((64, 64, 3), (200, 100, 0), np.uint8)


def yolo(*boxes):
    """Output of a YOLO: rows of centre, sides and the scores, and empty ones."""
    found = np.zeros((1, len(boxes[0]), 84), np.float32)
    found[0, :, : len(boxes)] = np.array(boxes).T
    return {"output0": found}


def network(tmp_path, outputs=None, *, metadata=THREE, **options):
    outputs = yolo([32, 32, 20, 20, 0.1, 0.9, 0.2]) if outputs is None else outputs
    file = export(tmp_path / "own.onnx", outputs, metadata=metadata)
    return ExportedNetwork(file, **options)


def scores(detector, picture=RED):
    return {one.class_name: round(one.score, 3) for one in detector.detect_in_views(picture, 0.01)}


@pytest.fixture
def colours(tmp_path):
    """Returns the score of the colour that an own network sees most of in a picture, by options."""
    file = mean_colour(tmp_path / "own.onnx")
    return lambda picture=RED, **options: scores(load_exported(ExportedNetwork(file, **options), every=True), picture)


def test_bytes_are_scaled_and_channels_stand_as_red_green_blue(colours):
    assert colours() == {"red": round(200 / 255, 3)}


def test_colour_order_scale_mean_and_deviation_come_from_the_options(colours):
    assert colours(colours="bgr") == {"blue": round(200 / 255, 3)}
    assert colours(scale=0.001, mean=(0.1, 0.0, 0.0), std=(0.5, 1.0, 1.0)) == {"red": 0.2}


def test_a_word_that_is_no_class_may_be_a_category_of_a_world(tmp_path):
    found = scores(load_exported(network(tmp_path, classes={"coke": "drink"}), every=False))
    assert found == {"drink": 0.9}


def test_a_wide_picture_is_padded_with_grey_above_and_below(colours):
    wide = np.full((32, 64, 3), 255, np.uint8)
    assert set(colours(wide).values()) == {round((1 + 114 / 255) / 2, 3)}
    assert set(colours(wide, fit="stretch").values()) == {1.0}


@pytest.mark.parametrize(
    ("fit", "box"),
    [("letterbox", (44, 12, 84, 52)), ("corner", (44, 44, 84, 64)), ("stretch", (44, 22, 84, 42))],
)
def test_boxes_are_converted_back_to_the_picture(tmp_path, fit, box):
    detector = network(tmp_path, fit=fit).build()
    assert detector.detect([np.zeros((64, 128, 3), np.uint8)])[0][0].box == pytest.approx(box)


def test_a_grey_picture_is_taken_as_colour(tmp_path):
    assert len(network(tmp_path).build().detect([np.zeros((64, 64), np.uint8)])[0]) == 1


def test_boxes_of_a_class_that_overlap_are_one_object(tmp_path):
    boxes = [[32, 32, 20, 20, 0, 0.8, 0], [33, 32, 20, 20, 0, 0.9, 0], [32, 32, 20, 20, 0, 0, 0.7]]
    found = network(tmp_path, yolo(*boxes)).build().detect([RED])[0]
    assert [(one.class_name, round(one.score, 2)) for one in found] == [("coke", 0.9), ("hammer", 0.7)]


def test_a_box_is_of_its_best_class_alone(tmp_path):
    found = network(tmp_path, yolo([32, 32, 20, 20, 0.0, 0.7, 0.9])).build().detect([RED])[0]
    assert [one.class_name for one in found] == ["hammer"]


def test_a_better_class_without_a_word_keeps_the_box(tmp_path):
    assert network(tmp_path, yolo([32, 32, 20, 20, 0.9, 0.7, 0.0])).build().detect([RED]) == [()]


def test_names_come_from_options_a_file_or_a_table_of_labels(tmp_path):
    (tmp_path / "names.txt").write_text("bottle\nchair\nhammer\n\n")
    for names in (("bottle", "coke", "hammer"), {1: "coke", 2: "hammer"}):
        assert network(tmp_path, metadata={}, names=names).build().class_names == ("coke", "hammer")
    assert network(tmp_path, metadata={}, names=tmp_path / "names.txt").build().class_names == ("hammer",)


def rfdetr(classes):
    return {"dets": np.full((1, 8, 4), 0.5, np.float32), "labels": np.zeros((1, 8, classes), np.float32)}


def detr(classes):
    """Output of a DETR whose last class is the likeliest of all boxes, with a logit below zero."""
    logits = np.full((1, 8, classes), -4, np.float32)
    logits[..., -1] = -1
    return {"pred_boxes": np.full((1, 8, 4), 0.5, np.float32), "logits": logits}


@pytest.mark.parametrize(
    ("outputs", "metadata", "expected"),
    [
        (rfdetr(5), {}, "its layout is rfdetr with 5 classes, and 2 are named"),
        ({"output0": np.ones((1, 300, 6), np.float32)}, THREE, "it has 3 classes, and 'names' has 2"),
    ],
)
def test_fewer_names_than_the_network_has_classes_are_refused(tmp_path, outputs, metadata, expected):
    assert expected in refusal(network(tmp_path, outputs, metadata=metadata, names=("bottle", "coke")))


@pytest.mark.parametrize("names", [("bottle", "coke", "beer", "hammer"), {1: "coke"}])
def test_a_class_for_no_object_needs_no_name_and_a_table_names_some(tmp_path, names):
    assert "coke" in network(tmp_path, rfdetr(5), metadata={}, names=names).build().class_names


def test_as_many_classes_as_names_leave_none_for_no_object(tmp_path):
    assert network(tmp_path, detr(3)).build().layout == "detr"


def test_an_empty_line_between_names_is_refused_with_its_place(tmp_path):
    (tmp_path / "names.txt").write_text("bottle\n\nhammer\n")
    message = refusal(network(tmp_path, metadata={}, names=tmp_path / "names.txt"))
    assert f"{tmp_path / 'names.txt'}:2: the line is empty; each line names the next class" in message


def test_another_size_than_that_of_a_fixed_input_is_refused(tmp_path):
    expected = "'size_px' is [32, 48], and its input is fixed at [64, 64]; leave out 'size_px'"
    assert expected in refusal(network(tmp_path, size_px=(32, 48)))
    assert network(tmp_path, size_px=(64, 64)).build().facts.size_px == (64, 64)


def test_several_classes_may_stand_for_one_word(tmp_path):
    both = network(tmp_path, classes={"bottle": "beer", "hammer": "beer"}).build()
    assert both.class_names == ("beer", "coke")


def test_a_stack_names_the_network_relative_to_its_folder(tmp_path):
    network(tmp_path)
    for key in ("use", "name"):
        stack = stack_of({"detector": {key: "onnx", "file": "own.onnx", "classes": {"bottle": "beer"}}}, tmp_path)
        assert stack.detector.build().class_names == ("beer", "coke", "hammer")


def refusal(component):
    with pytest.raises(InputError) as error:
        component.build()
    return str(error.value)


@pytest.mark.parametrize(
    ("outputs", "metadata", "expected"),
    [
        ({"probabilities": np.ones((1, 1000), np.float32)}, THREE, "it classifies whole pictures"),
        ({"output0": np.ones((1, 3), np.float32)}, {**THREE, "task": "classify"}, "it classifies whole pictures"),
        (
            {"masks": np.ones((1, 3, 64, 64), np.float32)},
            THREE,
            "it gives a map of pixels (segmentation), and no boxes",
        ),
        (yolo([0] * 8), {**THREE, "task": "obb"}, "of no layout that Errand reads (task 'obb')"),
        ({"out": np.ones((1, 17, 5), np.float32)}, THREE, "images float (1, 3, 64, 64) -> out (1, 17, 5)"),
        (
            {"a": np.ones((1, 24, 8, 8), np.float32), "b": np.ones((1, 24, 4, 4), np.float32)},
            THREE,
            "of a head, whose boxes are still to be computed",
        ),
        ({"out": np.full((1, 84, 35), -1, np.float32)}, THREE, "of a head, whose boxes are still to be computed"),
        (
            {"boxes": np.full((1, 9, 4), -1, np.float32), "scores": np.full((1, 9, 3), -1, np.float32)},
            THREE,
            "of no layout that Errand reads",
        ),
        (yolo([32, 32, 20, 20, -3.0, 8.0, -2.0]), THREE, "its scores go from -3 to 8, and not from 0 to 1"),
        (yolo([32, 32, 20, 20, 0.0, np.nan, 0.0]), THREE, "export it in full precision"),
        (yolo([900, 32, 20, 20, 0.0, 0.9, 0.0]), THREE, "as yolo it finds the box"),
        ({"found": np.zeros((0, 7), np.float32)}, THREE, "'layout: yolov7_nms' (YOLOv7 with suppression"),
        (detr(4), THREE, "write 'layout: detr' (RT-DETR and D-FINE of Transformers"),
        (yolo([0] * 8), {}, "its layout is yolo with 4 classes, and none are named"),
        (yolo([0] * 8), THREE, "its layout is yolo with 4 classes, and 3 are named"),
        (yolo([0] * 5), {"names": "{0: 'chair'}"}, "none of its classes is a word of Errand (chair)"),
        (yolo([0] * 5), {"names": "{'a': 'coke'}"}, "and none are named"),
    ],
)
def test_a_network_that_is_no_detector_with_names_is_refused(tmp_path, outputs, metadata, expected):
    message = refusal(network(tmp_path, outputs, metadata=metadata))
    assert expected in message
    assert str(tmp_path / "own.onnx") in message


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"classes": {"botle": "beer"}}, "'classes' names 'botle', which is no class of the network"),
        ({"classes": {"bottle": "bear"}}, "'classes' names 'bear', which has no class_forms"),
        ({"layout": "yolov8"}, "there is no layout 'yolov8'"),
        ({"layout": "darknet"}, "its outputs are not of layout darknet"),
        ({"layout": "yolo_nas"}, "its outputs are not of layout yolo_nas"),
    ],
)
def test_options_that_do_not_fit_the_network_are_refused_with_the_likely_ones(tmp_path, options, expected):
    message = refusal(network(tmp_path, **options))
    assert expected in message
    assert "did you mean" in message or "leave out 'layout'" in message


@pytest.mark.parametrize("shape", [(1, 1, 64, 64), (1, 64, 64, 1), (1, 3)])
def test_an_input_that_is_no_picture_in_colour_is_refused(tmp_path, shape):
    file = export(tmp_path / "own.onnx", yolo([0] * 7), shape=shape, metadata=THREE)
    assert "it takes no picture in colour: images float" in refusal(ExportedNetwork(file))


def test_a_file_that_is_no_onnx_is_refused(tmp_path):
    (tmp_path / "own.pt").write_bytes(b"PK\x03\x04 weights")
    message = refusal(ExportedNetwork(tmp_path / "own.pt"))
    assert "no ONNX file" in message
    assert "yolo export" in message


def test_a_file_whose_weights_are_missing_is_refused_with_their_file(tmp_path):
    file = export(tmp_path / "own.onnx", yolo([32, 32, 20, 20, 0.1, 0.9, 0.2]), metadata=THREE)
    onnx.save(onnx.load(file), file, save_as_external_data=True, location="own.data", size_threshold=0)
    assert ExportedNetwork(file).build().class_names == ("coke", "hammer")
    (tmp_path / "own.data").unlink()
    assert "its weights are in own.data, which is missing; copy it along" in refusal(ExportedNetwork(file))


def test_an_operation_of_another_runtime_is_refused_without_calling_the_file_damaged(tmp_path):
    model = onnx.load(export(tmp_path / "own.onnx", yolo([0] * 7), metadata=THREE))
    model.graph.node[0].op_type = "EfficientNMS_TRT"
    onnx.save(model, tmp_path / "own.onnx")
    message = refusal(ExportedNetwork(tmp_path / "own.onnx"))
    assert "ONNX Runtime cannot run it" in message
    assert "damaged" not in message


def test_an_input_beside_the_picture_that_errand_cannot_give_is_refused(tmp_path):
    model = onnx.load(export(tmp_path / "own.onnx", yolo([0] * 7), metadata=THREE))
    model.graph.input.append(onnx.helper.make_tensor_value_info("input_ids", onnx.TensorProto.INT64, (1, 16)))
    onnx.save(model, tmp_path / "own.onnx")
    assert "beside the picture it takes 'input_ids'" in refusal(ExportedNetwork(tmp_path / "own.onnx"))


def test_a_mask_of_pixels_beside_the_picture_is_filled(tmp_path):
    model = onnx.load(export(tmp_path / "own.onnx", yolo([32, 32, 20, 20, 0.1, 0.9, 0.2]), metadata=THREE))
    model.graph.input.append(onnx.helper.make_tensor_value_info("pixel_mask", onnx.TensorProto.INT64, ("b", "h", "w")))
    onnx.save(model, tmp_path / "own.onnx")
    assert scores(ExportedNetwork(tmp_path / "own.onnx").build()) == {"coke": 0.9}


def test_a_layout_whose_labels_would_be_the_scores_is_refused(tmp_path):
    outputs = {"output": np.array([[0, 16, 8, 48, 56, 1, 0.9]], np.float32)}
    assert "are not of layout yolo_nas" in refusal(network(tmp_path, outputs, layout="yolo_nas"))
    assert scores(network(tmp_path, outputs, layout="yolov7_nms").build()) == {"coke": 0.9}


def test_labels_of_tensorflow_count_from_one(tmp_path):
    outputs = {
        "detection_boxes": np.array([[[0.1, 0.1, 0.5, 0.5]]], np.float32),
        "detection_scores": np.array([[0.9]], np.float32),
        "detection_classes": np.array([[2]], np.float32),
    }
    options = {"metadata": {}, "classes": {"bottle": "beer"}}
    message = refusal(network(tmp_path, outputs, names=("bottle", "cup"), **options))
    assert "write 'names: {1: bottle, 2: cup}'" in message
    detector = load_exported(network(tmp_path, outputs, names={1: "cup", 2: "bottle"}, **options), every=True)
    assert scores(detector) == {"beer": 0.9}


def test_a_label_beyond_the_names_is_refused(tmp_path):
    outputs = {"output0": np.array([[[16, 8, 48, 56, 0.9, 3]]], np.float32)}
    message = refusal(network(tmp_path, outputs, metadata={}, names=("bottle", "coke", "hammer")))
    assert "its layout is end_to_end with 4 classes, and 3 are named" in message


def test_one_class_of_yolov5_has_the_score_of_any_object(tmp_path):
    rows = np.zeros((1, 252, 6), np.float32)
    rows[..., 5], rows[0, 7] = 0.5, [32, 32, 20, 20, 0.9, 0.5]
    detector = network(tmp_path, {"output": rows}, metadata={}, names=("coke",)).build()
    assert scores(detector) == {"coke": 0.9}


def test_one_class_of_yolov5_that_rounds_to_one_is_no_label(tmp_path):
    rows = np.zeros((1, 252, 6), np.float16)
    rows[..., 5], rows[0, 7] = 1.0, [32, 32, 20, 20, 0.9, 1.0]
    detector = network(tmp_path, {"output": rows}, metadata={}, names=("coke",)).build()
    assert (detector.layout, scores(detector)) == ("yolov5", {"coke": 0.9})


def test_a_class_of_the_background_is_not_reported(tmp_path):
    outputs = yolo([32, 32, 20, 20, 0.9, 0.1, 0.1], [12, 12, 10, 10, 0.1, 0.8, 0.1])
    component = network(tmp_path, outputs, metadata={}, names=("background", "coke", "hammer"))
    assert scores(load_exported(component, every=True)) == {"coke": 0.8}


def test_pictures_in_colour_have_the_range_and_order_that_windows_metadata_say(tmp_path):
    told = {"names": "{0: 'red', 1: 'green', 2: 'blue'}"}
    told |= {"Image.BitmapPixelFormat": "Bgr8", "Image.NominalPixelRange": "NominalRange_0_255"}
    detector = load_exported(
        ExportedNetwork(mean_colour(tmp_path / "own.onnx", metadata=told), scale=0.001), every=True
    )
    assert scores(detector) == {"blue": 0.2}


def test_a_detector_says_how_it_reads_its_network(tmp_path):
    about = network(tmp_path, classes={"bottle": "beer"}).build().about
    assert "takes RGB of 64 x 64 (letterbox) from 0 to 1" in about
    assert "scores up to 0.90, boxes in the picture" in about
    assert "labels 0 bottle (beer), 1 coke, 2 hammer" in about


def test_a_network_that_runs_with_one_size_alone_is_refused_or_gets_that_size(tmp_path):
    outputs = {"boxes": np.array([[16, 8, 48, 56]], np.float32), "labels": np.array([1]), "scores": np.float32([0.9])}
    detector = network(tmp_path, outputs).build()
    assert detector.preparation.fit == "letterbox"
    assert detector.detect([np.zeros((32, 64, 3), np.uint8)])[0][0].box == pytest.approx((16, 0, 48, 32))


def test_a_file_that_is_missing_is_refused(tmp_path):
    with pytest.raises(ModelFileError, match="there is no such model"):
        ExportedNetwork(tmp_path / "own.onnx").build()


def test_a_cascade_names_the_layout_of_an_exported_file(tmp_path):
    message = refusal(Cascade(network(tmp_path).file))
    assert "it is no cascade of Errand, but Ultralytics YOLO" in message
    assert "detector: {use: onnx" in message
    assert "errand.detectors" in message


@pytest.mark.parametrize(("shape", "size_px"), [((90, 160, 3), (64, 64)), ((33, 50, 3), (64, 48))])
def test_smooth_scaling_gives_the_bytes_of_pillow(shape, size_px):
    image = pytest.importorskip("PIL.Image")
    picture = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    wanted = np.asarray(image.fromarray(picture).resize(size_px, image.Resampling.BILINEAR))
    assert np.array_equal(place(picture, size_px, LAYOUTS["detr"].preparation)[0], wanted)
