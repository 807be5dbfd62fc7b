"""`errand dataset render`: a few real pictures, and what wrong arguments are told."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import pytest
from typer.testing import CliRunner, Result

from executive.cli.entry import app


def errand(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["dataset", "render", *arguments])


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
def test_wrong_arguments_are_refused(arguments: tuple[str, ...], told: str) -> None:
    result = errand(*arguments)
    assert result.exit_code == 2
    assert told in result.stderr


def test_a_folder_that_is_not_ours_ends_with_status_2(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    result = errand("--out", str(tmp_path), "--images", "8")
    assert result.exit_code == 2
    assert "name a new or empty folder with --out" in " ".join(result.stderr.split())


def test_real_pictures_are_made_twice_alike(tmp_path: Path) -> None:
    for name in ("one", "two"):
        result = errand("--out", str(tmp_path / name), "--images", "8", "--seed", "3", "--jobs", "1", "--json")
        assert result.exit_code == 0, result.stderr
    told = json.loads(result.stdout.splitlines()[-1])
    assert told["images"] == {"train": 8, "val": 0}
    coco = json.loads((tmp_path / "one" / "train.json").read_text())
    assert coco == json.loads((tmp_path / "two" / "train.json").read_text())
    assert coco["annotations"]
    for image in coco["images"]:
        first, second = ((tmp_path / name / image["file_name"]).read_bytes() for name in ("one", "two"))
        assert first == second
        picture = cv2.imread(str(tmp_path / "one" / image["file_name"]), cv2.IMREAD_UNCHANGED)
        assert picture.shape[:2] == (image["height"], image["width"])
        assert (picture.ndim == 2) == image["grey"]
