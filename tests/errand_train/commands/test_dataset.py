"""`errand dataset render`: a few real pictures, and what wrong arguments are told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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


def rendered(folder: Path) -> dict[str, Any]:
    """What is told of four pictures that are made in a folder."""
    result = errand("--out", str(folder), "--images", "4", "--seed", "3", "--jobs", "1", "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("made")
    return folder, rendered(folder)


def test_real_pictures_are_made(made: tuple[Path, dict[str, Any]]) -> None:
    folder, told = made
    assert told["images"] == {"train": 4, "val": 0}
    coco = json.loads((folder / "train.json").read_text())
    assert coco["annotations"]
    for image in coco["images"]:
        picture = cv2.imread(str(folder / image["file_name"]), cv2.IMREAD_UNCHANGED)
        assert picture.shape[:2] == (image["height"], image["width"])
        assert (picture.ndim == 2) == image["grey"]


@pytest.mark.nightly
def test_real_pictures_are_made_twice_alike(made: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    first, _ = made
    rendered(tmp_path)
    coco = json.loads((first / "train.json").read_text())
    assert coco == json.loads((tmp_path / "train.json").read_text())
    for image in coco["images"]:
        assert (first / image["file_name"]).read_bytes() == (tmp_path / image["file_name"]).read_bytes()
