"""`errand dataset score` with a small network whose pictures tell what it sees."""

import importlib.util
import json

import cv2
import numpy as np
import pytest

from tests.executive.cli.calls import errand
from tests.skills.tiny_detector import picture_of, write_model

HAMMER, BEER, STRAY = (
    ("hammer", 0.9, (100, 50, 200, 80)),
    ("beer", 0.6, (0, 0, 50, 50)),
    ("coke", 0.7, (300, 300, 400, 400)),
)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model") / "tiny.onnx")


@pytest.fixture
def score(model):
    def invoked(*arguments):
        return errand("dataset", "score", "--model", model, *arguments)

    return invoked


def label(image, category, box, **more):
    u0, v0, u1, v1 = box
    return {"image_id": image, "category_id": category, "bbox": [u0, v0, u1 - u0, v1 - v0], **more}


@pytest.fixture
def data(tmp_path):
    """Three pictures: all found; one found, one stray and one missed; nothing to find, and a stray."""
    seen = {"a.png": (HAMMER, BEER), "b.png": (HAMMER, STRAY), "c.png": (STRAY,)}
    (tmp_path / "pictures").mkdir()
    for name, things in seen.items():
        cv2.imwrite(str(tmp_path / "pictures" / name), picture_of(*things)[:, :, ::-1])
    document = {
        "images": [
            {"id": k + 10, "file_name": f"pictures/{name}", "width": 640, "height": 480} for k, name in enumerate(seen)
        ],
        "categories": [{"id": 70, "name": "hammer"}, {"id": 3, "name": "beer"}, {"id": 5, "name": "zebra"}],
        "annotations": [
            label(10, 70, HAMMER[2], visibility=0.9, distance_m=1.2),
            label(10, 3, BEER[2], visibility=0.9, distance_m=0.6),
            label(11, 70, HAMMER[2], visibility=0.5, distance_m=1.2),
            label(11, 3, BEER[2], visibility=0.9, distance_m=2.5),
            label(11, 5, (0, 0, 640, 480)),
        ],
    }
    return written(tmp_path / "data.json", document)


def written(file, document):
    file.write_text(json.dumps(document), encoding="utf-8")
    return file


def told(result):
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout.splitlines()[-1])


def test_all_figures_are_reported(score, data):
    figures = told(score("--data", data, "--json"))
    assert (figures["pictures"], figures["distractor_pictures"]) == (3, 1)
    # hammer: two of two; beer: one of two, so 51 of 101 recalls at 1; coke: nothing to find
    assert figures["mAP50"] == pytest.approx((1 + 51 / 101) / 2, abs=1e-4)
    assert figures["mAP50-95"] == pytest.approx((1 + 51 / 101) / 2, abs=1e-4)
    assert (figures["precision"], figures["recall"]) == (pytest.approx(3 / 5), pytest.approx(3 / 4))
    assert figures["per_class"]["beer"] == {
        "labels": 2,
        "AP50": pytest.approx(51 / 101, abs=1e-4),
        "AP50-95": pytest.approx(51 / 101, abs=1e-4),
        "precision": 1.0,
        "recall": 0.5,
    }
    assert figures["per_class"]["coke"]["AP50"] is None
    assert figures["false_per_100_distractor_pictures"] == 100.0
    assert figures["frames_per_second"] > 0
    assert "worst" not in figures
    filled = {one["from"]: one["recall"] for one in figures["by_distance_m"] if one["labels"]}
    assert filled == {0.5: 1.0, 1.0: 1.0, 2.0: 0.0}
    assert figures["by_size_px"][-1]["to"] is None


def test_labels_without_an_area_are_named(score, data):
    document = json.loads(data.read_text())
    written(data, {**document, "annotations": [*document["annotations"], label(10, 3, (9, 9, 9, 40))]})
    assert told(score("--data", data, "--json"))["outside"] == [5]
    assert "1 label without an area in the picture left out: annotations[5]" in score("--data", data).stdout


def test_without_pycocotools_the_command_says_what_to_install(score, data, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = score("--data", data)
    assert result.exit_code == 2
    assert "scoring needs pycocotools; pip install" in result.stderr


def test_figures_are_reported_by_camera(score, data):
    document = json.loads(data.read_text())
    for image, camera in zip(document["images"], ("hand", "left", "left"), strict=True):
        image["camera"] = camera
    figures = told(score("--data", written(data, document), "--json"))
    assert figures["by_camera"]["hand"]["recall"] == 1.0
    # the tiny network knows no people, so nothing counts on the body cameras
    assert (figures["by_camera"]["body"]["pictures"], figures["by_camera"]["body"]["mAP50"]) == (2, None)
    assert figures["recall"] == pytest.approx(3 / 4)
    assert "body cameras" in score("--data", data).stdout


def test_people_get_tables(score, data):
    result = score("--data", data)
    assert result.exit_code == 0
    for part in ("hammer", "longer side, px", "distance, m", "visibility", "100.0 false detections", "a second"):
        assert part in result.stdout


def test_a_plain_coco_file_has_no_figures_by_distance(score, data):
    document = json.loads(data.read_text())
    for one in document["annotations"]:
        one.pop("distance_m", None), one.pop("visibility", None)
    figures = told(score("--data", written(data, document), "--json"))
    assert (figures["by_distance_m"], figures["by_visibility"]) == ([], [])
    assert figures["recall"] == pytest.approx(3 / 4)


class NothingInViews:
    """Test-time augmentation that sees nothing."""

    def __init__(self, networks):
        self.class_names = networks.class_names

    def detect_in_views(self, picture):
        return ()


def test_test_time_augmentation_is_judged_when_asked_for(score, data, monkeypatch):
    monkeypatch.setattr("errand_train.commands.score.AugmentedDetector", NothingInViews)
    assert told(score("--data", data, "--views", "--json"))["recall"] == 0.0
    assert told(score("--data", data, "--json"))["recall"] == pytest.approx(3 / 4)


# roll_deg    seen and judged as
# none, 100   it lies
# 172, -172   turned by half a turn, and the boxes turned back
@pytest.mark.parametrize(("roll_deg", "recall"), [(None, 0.0), (100.0, 0.0), (172.0, 1.0), (-172.0, 1.0)])
def test_a_picture_whose_camera_hung_upside_down_is_turned_first(score, tmp_path, roll_deg, recall):
    u0, v0, u1, v1 = HAMMER[2]
    cv2.imwrite(str(tmp_path / "a.png"), picture_of(HAMMER)[::-1, ::-1, ::-1])
    image = {"id": 1, "file_name": "a.png", "width": 640, "height": 480}
    document = {
        "images": [image if roll_deg is None else {**image, "roll_deg": roll_deg}],
        "categories": [{"id": 70, "name": "hammer"}],
        "annotations": [label(1, 70, (640 - u1, 480 - v1, 640 - u0, 480 - v0))],
    }
    assert told(score("--data", written(tmp_path / "data.json", document), "--json"))["recall"] == recall


def test_only_so_many_pictures_are_taken(score, data):
    figures = told(score("--data", data, "--limit", "1", "--json"))
    assert (figures["pictures"], figures["recall"], figures["false_per_100_distractor_pictures"]) == (1, 1.0, None)


def test_the_worst_pictures_are_named_and_drawn(score, data, tmp_path):
    figures = told(score("--data", data, "--worst", "2", "--sheet", tmp_path / "sheet.png", "--json"))
    # b: a stray of 0.7, a missed label of 1, and a hammer that is sure by 0.9; c: a stray of 0.7
    assert [one["file"] for one in figures["worst"]] == ["pictures/b.png", "pictures/c.png"]
    assert [one["error"] for one in figures["worst"]] == [pytest.approx(1.8), pytest.approx(0.7)]
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet.shape[1] == 2 * 400
    red, yellow = (np.abs(sheet.astype(int) - colour).sum(axis=2) < 30 for colour in ((50, 60, 240), (30, 200, 250)))
    assert red[:, :400].any()
    assert yellow[:, :400].any()
    assert red[:, 400:].any()
    assert not yellow[:, 400:].any()


def test_pictures_may_lie_elsewhere(score, data, tmp_path):
    moved = tmp_path / "labels" / "data.json"
    moved.parent.mkdir()
    data.rename(moved)
    assert "3 of 3 pictures are not there" in score("--data", moved).stderr
    assert told(score("--data", moved, "--pictures", tmp_path, "--json"))["pictures"] == 3


@pytest.mark.parametrize(
    ("content", "part"),
    [
        ("no json", "it is no JSON"),
        ("[" * 100_000, "it is no JSON"),
        ("[]", "the file"),
        ("{}", "images"),
        ('{"images": [], "annotations": [], "categories": [{"id": 1, "name": "zebra"}]}', "zebra"),
        ('{"images": [], "annotations": [], "categories": [{"id": 1, "name": "beer"}]}', "it names no pictures"),
    ],
)
def test_anything_but_a_coco_file_is_refused(score, tmp_path, content, part):
    file = tmp_path / "data.json"
    file.write_text(content)
    result = score("--data", file)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"errand: {file}: ")
    assert part in result.stderr
    assert "--data" in result.stderr


def test_a_missing_file_and_a_binary_one_are_refused(score, tmp_path):
    (tmp_path / "data.json").write_bytes(b"\xff\xfe\x00")
    for name in ("none.json", "data.json"):
        result = score("--data", tmp_path / name)
        assert result.exit_code == 2
        assert f"{name}:" in result.stderr


def test_a_damaged_picture_is_named(score, data):
    (data.parent / "pictures" / "b.png").write_bytes(b"x")
    result = score("--data", data)
    assert result.exit_code == 2
    assert "b.png: it is no picture" in result.stderr


def test_a_picture_of_another_size_than_its_labels_are_for_is_named(score, data):
    cv2.imwrite(str(data.parent / "pictures" / "b.png"), np.zeros((100, 100), np.uint8))
    result = score("--data", data)
    assert result.exit_code == 2
    assert "it has 100 x 100 pixels, and its labels are for 640 x 480" in result.stderr


@pytest.mark.parametrize("name", ["sheet.jpg", "sheet"])
def test_the_sheet_is_a_png(score, data, name):
    result = score("--data", data, "--sheet", data.parent / name)
    assert result.exit_code == 2
    assert "call it sheet.png" in result.stderr
