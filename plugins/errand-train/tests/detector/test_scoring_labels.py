"""COCO files as labels, and which labels count."""

import pytest

from errand_train.detector.scoring_labels import Label, pictures_of_coco

CLASSES = ("hammer", "person")
BOX = [1, 2, 3, 4]


def coco(**changes):
    document = {
        "images": [{"id": 7, "file_name": "b.jpg", "width": 64, "height": 48}, {"id": 3, "file_name": "a.jpg"}],
        "annotations": [
            {"id": 1, "image_id": 7, "category_id": 90, "bbox": [10, 20, 30, 40], "visibility": 0.5, "distance_m": 2.5},
            {"id": 2, "image_id": 7, "category_id": 4, "bbox": [1, 2, 3, 4], "iscrowd": 1},
            {"id": 3, "image_id": 7, "category_id": 1, "bbox": [0, 0, 9, 9]},
        ],
        "categories": [{"id": 90, "name": "Hammer"}, {"id": 1, "name": "cat"}, {"id": 4, "name": "person"}],
    }
    return {**document, **changes}


def test_categories_go_by_name_and_pictures_by_their_ids():
    first, second = pictures_of_coco(coco(), CLASSES).pictures
    assert (first.file, first.labels, first.only_distractors) == ("a.jpg", (), True)
    assert (first.size_px, second.size_px) == (None, (64, 48))
    assert second.labels == (
        Label("hammer", (10.0, 20.0, 40.0, 60.0), visibility=0.5, distance_m=2.5),
        Label("person", (1.0, 2.0, 4.0, 6.0), crowd=True),
    )


@pytest.mark.parametrize(
    # width, height, visibility, crowd, ignore -> counts
    ("width", "height", "visibility", "crowd", "ignore", "counts"),
    [
        (24, 8, 0.4, False, False, True),
        (8, 24, None, False, False, True),
        (23.9, 23.9, 1.0, False, False, False),
        (100, 7.9, 1.0, False, False, False),
        (100, 100, 0.39, False, False, False),
        (100, 100, 1.0, True, False, False),
        (100, 100, 1.0, False, True, False),
    ],
)
def test_labels_that_count(width, height, visibility, crowd, ignore, counts):
    label = Label("hammer", (5.0, 5.0, 5.0 + width, 5.0 + height), crowd, ignore, visibility)
    assert label.counts == counts


@pytest.mark.parametrize(
    # visibility, truncation -> share of the whole thing that is seen
    ("told", "share"),
    [
        ({"visibility": 0.8, "truncation": 0.5}, 0.4),
        ({"visibility": 0.8}, 0.8),
        ({"truncation": 0.25}, 0.75),
        ({}, None),
    ],
)
def test_parts_beyond_the_edge_are_hidden(told, share):
    entry = {"id": 1, "image_id": 3, "category_id": 90, "bbox": [10, 20, 30, 40], **told}
    first, _ = pictures_of_coco(coco(annotations=[entry]), CLASSES).pictures
    assert first.labels[0].visibility == (None if share is None else pytest.approx(share))


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"images": None}, "images"),
        ({"annotations": [1]}, r"annotations\[0\]"),
        ({"categories": [{"id": 1, "name": "cat"}]}, "categories: none of 'cat'"),
        ({"categories": []}, "categories: none"),
        ({"images": [{"file_name": "a.jpg"}]}, r"images\[0\]\.id"),
        ({"images": [{"id": [7], "file_name": "a.jpg"}]}, r"images\[0\]\.id"),
        ({"annotations": [{"image_id": None, "category_id": 90}]}, r"annotations\[0\]\.image_id"),
        ({"images": [{"id": 7, "file_name": "a.jpg", "roll_deg": "over"}]}, r"images\[0\]\.roll_deg"),
        ({"images": [{"id": 7}], "annotations": []}, r"images\[0\]\.file_name"),
        ({"annotations": [{"image_id": 8, "category_id": 90, "bbox": BOX}]}, r"annotations\[0\]\.image_id"),
        ({"annotations": [{"image_id": 7, "category_id": 5, "bbox": BOX}]}, r"annotations\[0\]\.category_id"),
        ({"annotations": [{"image_id": 7, "category_id": 90}]}, r"annotations\[0\]\.bbox"),
        ({"annotations": [{"image_id": 7, "category_id": 90, "bbox": [1, 2]}]}, r"annotations\[0\]\.bbox"),
        ({"annotations": [{"image_id": 7, "category_id": 90, "bbox": "abcd"}]}, r"annotations\[0\]\.bbox"),
    ],
)
def test_anything_but_a_coco_file_is_refused_with_the_wrong_entry(changes, place):
    with pytest.raises(ValueError, match=f"^{place}"):
        pictures_of_coco(coco(**changes), CLASSES)


FILES = [{"id": 7, "file_name": "b.jpg"}, {"id": 3, "file_name": "a.jpg"}]
CATS = [{"id": 90, "name": "hammer"}, {"id": 4, "name": "person"}]


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"categories": [*CATS, {"id": 90, "name": "coke"}]}, r"categories\[2\].id: 90 \(coke\) is also the id of cat"),
        (
            {"categories": [*CATS, {"id": "90", "name": "coke"}]},
            r"categories\[2\].id: 90 \(coke\) is also the id of cat",
        ),
        (
            {"images": [*FILES, {"id": 3, "file_name": "c.jpg"}]},
            r"images\[2\].id: 3 \(c.jpg\) is also the id of images\[1",
        ),
        (
            {"images": [*FILES, {"id": 3, "file_name": "a.jpg"}]},
            r"images\[2\].id: 3 \(a.jpg\) is also the id of images\[1",
        ),
        ({"images": [*FILES, {"id": 9, "file_name": "a.jpg"}]}, r"images\[2\].file_name: a.jpg is also the file of"),
    ],
)
def test_a_label_that_is_there_twice_is_refused_with_both_places(changes, what):
    with pytest.raises(ValueError, match=what):
        pictures_of_coco(coco(**changes), CLASSES)


def test_a_category_that_is_listed_twice_alike_is_one():
    assert len(pictures_of_coco(coco(categories=[*coco()["categories"], *CATS[1:]]), CLASSES).pictures[1].labels) == 2


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("side", range(4))
def test_a_box_with_a_value_that_is_no_number_is_refused(value, side):
    box = [10, 20, 30, 40]
    box[side] = value
    with pytest.raises(ValueError, match=rf"annotations\[0\]\.bbox\[{side}\]: .*{value}"):
        pictures_of_coco(coco(annotations=[{"image_id": 7, "category_id": 90, "bbox": box}]), CLASSES)


@pytest.mark.parametrize(
    "box", [[1, 2, 0, 4], [1, 2, 3, -4], [64, 2, 3, 4], [1, 48, 3, 4], [-9, 2, 9, 4], [1, -9, 3, 8]]
)
def test_labels_without_an_area_in_their_picture_are_left_out_and_named(box):
    entries = [{"image_id": 7, "category_id": 90, "bbox": each} for each in ([10, 20, 30, 20], box)]
    found = pictures_of_coco(coco(annotations=entries), CLASSES)
    assert (len(found.pictures[1].labels), found.outside) == (1, (1,))


def test_a_box_at_the_edge_counts_and_so_does_any_in_a_picture_of_unknown_size():
    entries = [
        {"image_id": 7, "category_id": 90, "bbox": [-5, -5, 10, 10]},
        {"image_id": 3, "category_id": 90, "bbox": [640, 480, 10, 10]},
    ]
    assert pictures_of_coco(coco(annotations=entries), CLASSES).outside == ()


def test_ids_that_are_written_as_text_are_numbers():
    categories = [{"id": "90", "name": "hammer"}, {"id": "4", "name": "person"}, {"id": "cat-1", "name": "cat"}]
    entries = [
        {"image_id": "7", "category_id": 90, "bbox": BOX},
        {"image_id": 7, "category_id": "4", "bbox": BOX},
        {"image_id": 7, "category_id": "cat-1", "bbox": BOX},
    ]
    found = pictures_of_coco(coco(categories=categories, annotations=entries), CLASSES)
    assert [label.class_name for label in found.pictures[1].labels] == ["hammer", "person"]


@pytest.mark.parametrize("document", [[], "coco", None, 3])
def test_anything_but_a_json_object_is_refused(document):
    with pytest.raises(ValueError, match="the file"):
        pictures_of_coco(document, CLASSES)


def test_a_category_may_have_a_synonym_of_one_class():
    categories = [{"id": 90, "name": "coke can"}, {"id": 1, "name": "cat"}, {"id": 4, "name": "person"}]
    found = pictures_of_coco(coco(categories=categories), ("coke", "person"))
    assert (found.aliases, found.left_out) == ({"coke can": "coke"}, {"cat": 1})
    assert [label.class_name for label in found.pictures[1].labels] == ["coke", "person"]


def test_backslashes_in_names_of_files_are_slashes():
    images = [{"id": 7, "file_name": "a\\b.jpg"}, {"id": 3, "file_name": "c.jpg"}]
    assert pictures_of_coco(coco(images=images), CLASSES).pictures[1].file == "a/b.jpg"


@pytest.mark.parametrize(
    ("box", "what"),
    [([0.1, 0.2, 0.3, 0.4], "shares of the pictures' sides"), ([40, 30, 60, 45], "the boxes are corners")],
)
def test_boxes_in_another_form_are_refused_as_such(box, what):
    with pytest.raises(ValueError, match=what):
        pictures_of_coco(coco(annotations=[{"image_id": 7, "category_id": 90, "bbox": box}]), CLASSES)
