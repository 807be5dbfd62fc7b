import json

import numpy as np
import pytest

from errand_train.detector.coco import CocoLabel
from errand_train.detector.labels import TrainingDataError, category_names, outline_of, read_split

CATEGORIES = [{"id": 2, "name": "coke"}, {"id": 1, "name": "beer"}]


def run_lengths(mask):
    flat = mask.reshape(-1, order="F")
    edges = np.concatenate([[0], np.flatnonzero(np.diff(flat.astype(int))) + 1, [flat.size]])
    counts = np.diff(edges).tolist()
    return {"size": list(mask.shape), "counts": [0, *counts] if flat[0] else counts}


def label(bbox, segmentation):
    return CocoLabel(image_id=1, category_id=1, bbox=bbox, segmentation=segmentation)


def disc(height, width):
    y, x = np.mgrid[:height, :width]
    return (x - 30) ** 2 + (y - 20) ** 2 < 100


def write(folder, **annotation):
    label = {"id": 1, "image_id": 5, "category_id": 2, "bbox": [10, 20, 30, 8], "ignore": 0, **annotation}
    image = {"id": 5, "file_name": "scenes/000000/0.jpg", "width": 320, "height": 240}
    document = {"images": [image], "annotations": [label], "categories": CATEGORIES}
    (folder / "train.json").write_text(json.dumps(document))
    return folder


def test_names_stand_in_the_order_of_their_ids(tmp_path):
    assert category_names(write(tmp_path)) == ("beer", "coke")


def test_outlines_are_in_pixels_of_the_letterbox(tmp_path):
    (picture,) = read_split(write(tmp_path), "train")
    outline = picture.labels.outlines[0]
    assert outline.min(axis=0).tolist() == [20, 40]
    assert outline.max(axis=0).tolist() == [80, 56]
    assert picture.labels.classes.tolist() == [1]
    assert picture.file == tmp_path / "scenes/000000/0.jpg"


def test_seen_is_the_unoccluded_share_within_the_picture(tmp_path):
    (picture,) = read_split(write(tmp_path, visibility=0.5, truncation=0.2, ignore=1), "train")
    assert picture.labels.seen.tolist() == pytest.approx([0.4])
    assert picture.labels.ignored.tolist() == [True]


def test_the_outline_of_a_mask_is_its_hull():
    mask = disc(48, 64)
    outline = outline_of(label([0, 0, 1, 1], run_lengths(mask)))
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    assert outline.min(axis=0).tolist() == [columns[0], rows[0]]
    assert outline.max(axis=0).tolist() == [columns[-1] + 1, rows[-1] + 1]
    assert len(outline) > 8


def test_a_run_over_the_end_of_a_column_fills_both():
    mask = np.zeros((10, 12), dtype=bool)
    mask[6:, 3] = mask[:4, 4] = True
    outline = outline_of(label([0, 0, 1, 1], run_lengths(mask)))
    assert outline.min(axis=0).tolist() == [3, 0]
    assert outline.max(axis=0).tolist() == [5, 10]


def test_without_a_mask_the_box_is_the_outline():
    outline = outline_of(label([1, 2, 3, 4], [[1, 2, 3, 4, 5, 6]]))
    assert sorted(map(tuple, outline.tolist())) == [(1, 2), (1, 6), (4, 2), (4, 6)]


@pytest.mark.parametrize("content", [None, "{", "[]", '{"images": []}'])
def test_a_folder_without_labels_is_named_with_the_mend(tmp_path, content):
    if content is not None:
        (tmp_path / "train.json").write_text(content)
    with pytest.raises(TrainingDataError, match=r"train\.json.*errand dataset render"):
        read_split(tmp_path, "train")


def test_a_damaged_label_is_named_by_its_place(tmp_path):
    with pytest.raises(TrainingDataError, match=r"train\.json.*annotations\[0\]\.bbox"):
        read_split(write(tmp_path, bbox=[1, 2]), "train")
