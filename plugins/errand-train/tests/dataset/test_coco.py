"""Labels in the COCO form: run lengths, boxes, what is ignored."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from pycocotools import mask as coco_mask

from errand_train.dataset.coco import annotation, box_of, categories, counts, document, is_black, run_lengths
from errand_train.dataset.silhouette import Silhouette
from skills.class_forms import class_forms


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=12)))
def test_run_lengths_give_the_mask_back(mask):
    lengths = run_lengths(mask)
    assert np.array_equal(coco_mask.decode(coco_mask.frPyObjects(lengths, *lengths["size"])), mask)


def test_run_lengths_go_down_the_columns_and_begin_with_zeros():
    mask = np.array([[1, 0], [1, 1]], dtype=bool)
    assert run_lengths(mask) == {"size": [2, 2], "counts": [0, 2, 1, 1]}


@given(st.integers(0, 7), st.integers(0, 7), st.integers(1, 8), st.integers(1, 8))
def test_a_box_holds_its_mask_tightly(x, y, w, h):
    mask = np.zeros((16, 16), dtype=bool)
    mask[y : y + h, x : x + w] = True
    assert box_of(mask) == (x, y, w, h)


def test_an_empty_mask_has_no_box():
    with pytest.raises(ValueError, match="empty"):
        box_of(np.zeros((3, 3), dtype=bool))


def label(seen, inside, whole, side=20):
    """`seen` pixels of a square mask of 20 rows."""
    mask = np.zeros((100, 100), dtype=bool)
    rows = -(-seen // side)
    mask[10 : 10 + rows, 10 : 10 + side] = True
    extra = rows * side - seen
    if extra:
        mask[10 + rows - 1, 10 + side - extra : 10 + side] = False
    return annotation(mask=mask, alone=Silhouette(inside, whole), class_id=4, instance="hammer_001", distance_m=1.0)


# seen, alone in the picture, alone in all -> visibility, truncation, ignored
@pytest.mark.parametrize(
    ("seen", "inside", "whole", "visibility", "truncation", "ignored"),
    [
        (400, 400, 400, 1.0, 0.0, 0),
        (200, 400, 400, 0.5, 0.0, 0),
        (400, 400, 800, 1.0, 0.5, 0),
        (80, 400, 400, 0.2, 0.0, 1),
        (200, 400, 1000, 0.5, 0.6, 1),
        (420, 400, 400, 1.0, 0.0, 0),
    ],
)
def test_visibility_and_truncation(seen, inside, whole, visibility, truncation, ignored):
    found = label(seen, inside, whole)
    assert found is not None
    assert found["visibility"] == pytest.approx(visibility)
    assert found["truncation"] == pytest.approx(truncation)
    assert (found["ignore"], found["iscrowd"]) == (ignored, ignored)
    assert found["area"] == seen


def test_small_objects_are_ignored_and_a_few_pixels_have_no_label():
    small = label(9, 9, 9, side=3)
    assert small is not None
    assert small["ignore"] == 1
    assert label(4, 4, 4, side=2) is None


# share of the rows of the picture -> ignored
@pytest.mark.parametrize(("rows", "ignored"), [(90, 0), (95, 0), (96, 1), (100, 1)])
def test_an_object_that_fills_the_picture_is_ignored(rows, ignored):
    mask = np.zeros((100, 100), dtype=bool)
    mask[:rows] = True
    entry = annotation(mask=mask, alone=Silhouette(rows * 100, 10_000), class_id=4, instance="x", distance_m=0.1)
    assert entry is not None
    assert entry["ignore"] == ignored


def test_categories_have_the_project_s_class_ids():
    assert {entry["name"]: entry["id"] for entry in categories()} == {
        name: form.id for name, form in class_forms().items()
    }
    assert len(categories()) == 9


def test_a_document_numbers_pictures_and_labels_and_joins_them():
    one, two = label(400, 400, 400), label(80, 400, 400)
    assert one is not None
    assert two is not None
    shots = [
        {"image": {"file_name": "a.jpg", "width": 100, "height": 100}, "annotations": [one, two]},
        {"image": {"file_name": "b.jpg", "width": 100, "height": 100}, "annotations": [one]},
    ]
    made = document({"seed": 1}, shots)
    assert [image["id"] for image in made["images"]] == [1, 2]
    assert [(entry["id"], entry["image_id"]) for entry in made["annotations"]] == [(1, 1), (2, 1), (3, 2)]
    needed = {"category_id", "bbox", "area", "segmentation", "iscrowd", "visibility", "truncation", "distance_m"}
    assert all(needed <= set(entry) for entry in made["annotations"])
    assert counts(made["annotations"])["hammer"] == 2


# mean and spread of the thing's pixels -> whether it is lost
@pytest.mark.parametrize(("mean", "spread", "lost"), [(5, 2, True), (60, 2, False), (10, 25, False)])
def test_an_all_black_object_is_recognised(mean, spread, lost):
    noise = np.random.default_rng(1).normal(mean, spread, (20, 20, 3))
    picture = np.clip(noise, 0, 255).astype(np.uint8)
    assert is_black(picture, np.ones((20, 20), dtype=bool)) is lost
