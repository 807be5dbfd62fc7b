"""`errand dataset render`: a few real pictures, and what wrong arguments are told."""

import json
from typing import Any

import cv2
import pytest

from tests.executive.cli.calls import errand


def render(*arguments):
    return errand("dataset", "render", *arguments)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--out", "x"), "--images"),
        (("--out", "x", "--images", "0"), "--images: should"),
        (("--out", "x", "--images", "8", "--seed", "-1"), "--seed: should"),
        (("--out", "x", "--images", "many"), "--images: should"),
        (("--out", "x", "--images", "8", "--jobs", "0"), "--jobs: should"),
    ],
)
def test_wrong_arguments_are_refused(arguments, told):
    result = render(*arguments)
    assert result.exit_code == 2
    assert told in result.stderr


def test_a_folder_that_is_not_ours_ends_with_status_2(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    result = render("--out", str(tmp_path), "--images", "8")
    assert result.exit_code == 2
    assert "name a new or empty folder with --out" in " ".join(result.stderr.split())


def rendered(folder):
    """What is told of four pictures that are made in a folder."""
    result = render("--out", str(folder), "--images", "4", "--seed", "3", "--jobs", "1", "--json")
    assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout.splitlines()[-1])
    assert told["images"] == {"train": 4, "val": 0}
    coco: dict[str, Any] = json.loads((folder / "train.json").read_text())
    assert coco["annotations"]
    for image in coco["images"]:
        picture = cv2.imread(str(folder / image["file_name"]), cv2.IMREAD_UNCHANGED)
        assert picture.shape[:2] == (image["height"], image["width"])
        assert (picture.ndim == 2) == image["grey"]
    return coco


def test_pictures_are_made_with_their_labels(few_models, tmp_path, monkeypatch):
    """In this process, and no more views of the room than are asked for."""
    monkeypatch.setattr("errand_train.dataset.render.TRAINING_VIEWS", 4)
    monkeypatch.setattr(
        "errand_train.commands.dataset._give_out", lambda _, make, numbers: ((each, make(each)) for each in numbers)
    )
    rendered(tmp_path)


@pytest.mark.nightly
def test_pictures_are_made_twice_alike_by_other_processes(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    coco = rendered(first)
    assert coco == rendered(second)
    for image in coco["images"]:
        assert (first / image["file_name"]).read_bytes() == (second / image["file_name"]).read_bytes()
