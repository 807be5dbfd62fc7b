"""`errand detect` with a small network whose pictures tell what it sees."""

import subprocess
import sys
from functools import partial

import cv2
import numpy as np
import pytest
from tiny_detector import picture_of, write_model

from tests.executive.cli.calls import errand, json_of
from tests.skills.exported_networks import mean_colour

HAMMER = ("hammer", 0.9, (100, 50, 200, 80))
BEER = ("beer", 0.6, (0, 0, 50, 50))


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model") / "tiny.onnx")


@pytest.fixture
def detect(model):
    return partial(errand, "detect", "--model", model)


def picture(file, *things):
    cv2.imwrite(str(file), picture_of(*things)[:, :, ::-1])
    return file


def test_pictures_are_told_in_their_order(detect, tmp_path):
    both = picture(tmp_path / "z.png", HAMMER, BEER)
    nothing = picture(tmp_path / "a.png")
    result = detect(both, nothing, "--json")
    assert result.exit_code == 0
    first, second = json_of(result)
    assert first["file"] == str(both)
    assert first["detections"] == [
        {"class": "hammer", "score": 0.9, "box": [100.0, 50.0, 200.0, 80.0]},
        {"class": "beer", "score": 0.6, "box": [0.0, 0.0, 50.0, 50.0]},
    ]
    assert (second["file"], second["detections"]) == (str(nothing), [])
    assert first["ms"] > 0
    assert set(first) == {"file", "detections", "ms"}


def test_the_threshold_is_heeded(detect, tmp_path):
    file = picture(tmp_path / "a.png", HAMMER, BEER)
    assert len(json_of(detect(file, "--json", "--threshold", "0.7"))[0]["detections"]) == 1
    assert len(json_of(detect(file, "--json", "--threshold", "0"))[0]["detections"]) >= 2


def test_a_table_is_shown_to_people(detect, tmp_path):
    result = detect(picture(tmp_path / "a.png", HAMMER), picture(tmp_path / "b.png"))
    assert [text for text in ("hammer", "100, 50, 200, 80", "nothing") if text not in result.stdout] == []


def test_boxes_are_drawn_under_the_pictures_names(detect, tmp_path):
    (tmp_path / "other").mkdir()
    files = [picture(tmp_path / "a.png", HAMMER), picture(tmp_path / "other" / "a.png", BEER)]
    assert detect(*files, "--out", tmp_path / "drawn").exit_code == 0
    assert sorted(file.name for file in (tmp_path / "drawn").iterdir()) == ["a-2.png", "a.png"]
    drawn = cv2.imread(str(tmp_path / "drawn" / "a.png"))
    assert drawn.shape == (480, 640, 3)
    assert drawn[80, 150].any()
    assert not drawn[65, 150].any()


def test_an_unreadable_picture_keeps_no_other_from_being_told(detect, tmp_path):
    (tmp_path / "b.txt").write_text("no picture")
    result = detect(
        picture(tmp_path / "a.png", HAMMER), tmp_path / "b.txt", picture(tmp_path / "c.png", BEER), "--json"
    )
    assert result.exit_code == 2
    assert result.stderr == (
        f"errand: {tmp_path / 'b.txt'}: it is no picture; name a file in PNG, JPEG, WebP, TIFF or BMP\n"
    )
    assert [len(one["detections"]) for one in json_of(result)] == [1, 0, 1]
    assert "it is no picture" in json_of(result)[1]["error"]


@pytest.mark.parametrize(
    "content",
    [np.zeros((1, 1), np.uint8), np.zeros((480, 640, 3), np.uint8), np.zeros((9, 30_000), np.uint8)],
    ids=["one pixel", "black", "long"],
)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_odd_pictures_hold_nothing(detect, tmp_path, content, dtype):
    cv2.imwrite(str(tmp_path / "a.png"), content.astype(dtype))
    result = detect(tmp_path / "a.png", "--json")
    assert (result.exit_code, json_of(result)[0]["detections"]) == (0, [])


def test_neither_the_plant_nor_the_language_is_loaded_for_it(model, tmp_path):
    file = picture(tmp_path / "a.png", HAMMER)
    program = (
        "import sys; from executive.cli.entry import command_line\n"
        f"sys.argv = ['errand', 'detect', '--json', '--model', {str(model)!r}, {str(file)!r}]\n"
        "try: command_line()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'pydrake', 'spacy', 'plant', 'scipy', 'torch'}))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "[]"
    assert "hammer" in run.stdout


def test_all_other_commands_are_there_too(tmp_path):
    run = subprocess.run([sys.executable, "-m", "executive.cli", "--help"], capture_output=True, text=True, check=True)
    for name in ("detect", "parse", "run"):
        assert f" {name} " in run.stdout


def test_an_exported_network_and_a_stack_file_that_names_it_are_taken(tmp_path):
    mean_colour(tmp_path / "own.onnx")
    (tmp_path / "stack.yaml").write_text("detector: {use: onnx, file: own.onnx, classes: {red: beer}}\n")
    red = tmp_path / "red.png"
    cv2.imwrite(str(red), np.full((64, 64, 3), (0, 0, 255), np.uint8))
    for model, name in (("own.onnx", "red"), ("stack.yaml", "beer")):
        result = errand("detect", "--model", tmp_path / model, red, "--json")
        (found,) = json_of(result)
        assert [one["class"] for one in found["detections"]] == [name]
        assert errand("detect", "--model", tmp_path / model, red).stdout.startswith("detector: Ultralytics YOLO")
