"""Figures of a detector against tables worked by hand, and against what pycocotools told of a fixed random set."""

import numpy as np
import pytest

from errand_train.detector.scoring import by_camera, judge_picture, picture_errors, score
from errand_train.detector.scoring_labels import Label, LabelledPicture
from skills.api import Detection


def thing(x, name="hammer", size=50, **more):
    return Label(name, (x, 0.0, x + size, float(size)), **more)


def seen(x, score, name="hammer", width=50, height=50):
    return Detection(name, score, (float(x), 0.0, float(x + width), float(height)))


def scored(labels, found, names=("hammer",)):
    pictures = [LabelledPicture(f"{k}.png", tuple(ones)) for k, ones in enumerate(labels)]
    return score(pictures, [tuple(ones) for ones in found], names)


def test_figures_of_perfect_detections():
    result = scored([[thing(0), thing(100)]], [[seen(0, 0.9), seen(100, 0.6)]])
    assert (result.map50, result.map50_95, result.precision, result.recall) == (
        pytest.approx(1.0),
        pytest.approx(1.0),
        1.0,
        1.0,
    )


def test_average_precision_by_hand():
    # score   0.9    0.8    0.7    0.6          four labels, one of them never found
    # right   yes    no     yes    yes
    # recall  0.25   0.25   0.5    0.75
    # precis. 1      1/2    2/3    3/4          envelope 1, 3/4, 3/4, 3/4
    # 101 recalls: 0.00-0.25 (26) at 1, 0.26-0.75 (50) at 3/4, the rest (25) at 0
    labels = [[thing(0), thing(100), thing(200), thing(300)]]
    found = [[seen(0, 0.9), seen(500, 0.8), seen(100, 0.7), seen(200, 0.6)]]
    result = scored(labels, found)
    assert result.map50 == pytest.approx((26 + 50 * 0.75) / 101)
    assert (result.precision, result.recall) == (3 / 4, 3 / 4)


def test_stricter_overlaps_lower_the_mean():
    # 43 of 50 columns: overlap 0.86, so right at 0.5, 0.55 ... 0.85 (8 of 10)
    result = scored([[thing(0)]], [[seen(0, 0.9, width=43)]])
    assert result.map50 == pytest.approx(1.0)
    assert result.map50_95 == pytest.approx(0.8)


def test_precision_and_recall_are_of_what_is_sure():
    labels = [[thing(0), thing(100)]]
    found = [[seen(0, 0.5), seen(100, 0.49), seen(300, 0.51), seen(400, 0.4)]]
    result = scored(labels, found)
    assert (result.precision, result.recall) == (0.5, 0.5)


def test_each_class_has_its_own_figures():
    labels = [[thing(0), thing(100, "wrench")]]
    found = [[seen(0, 0.9), seen(100, 0.9)]]
    result = scored(labels, found, ("hammer", "wrench", "cube"))
    hammer, wrench, cube = result.classes
    assert (hammer.ap50, hammer.precision, hammer.recall) == (pytest.approx(1.0), 0.5, 1.0)
    assert (wrench.ap50, wrench.precision, wrench.recall) == (0.0, None, 0.0)
    assert (cube.labels, cube.ap50, cube.precision, cube.recall) == (0, None, None, None)
    assert result.map50 == pytest.approx(0.5)
    assert (result.precision, result.recall) == (0.5, 0.5)


@pytest.mark.parametrize(
    "label",
    [thing(0, size=20), thing(0, visibility=0.3), thing(0, ignore=True), thing(0, crowd=True)],
    ids=["small", "hidden", "ignore", "crowd"],
)
@pytest.mark.parametrize("found", [True, False])
def test_ignored_labels_count_neither_as_found_nor_as_missed(label, found):
    size = round(label.box[2])
    ones = [seen(0, 0.9, width=size, height=size)] if found else []
    result = scored([[label, thing(100)]], [[*ones, seen(100, 0.8)]])
    assert (result.classes[0].labels, result.precision, result.recall) == (1, 1.0, 1.0)
    assert result.map50 == pytest.approx(1.0)


def test_small_unmatched_detections_are_ignored_and_larger_ones_are_not():
    small, large = seen(300, 0.9, width=20, height=20), seen(400, 0.9, width=30, height=30)
    assert scored([[thing(0)]], [[seen(0, 0.8), small]]).precision == 1.0
    assert scored([[thing(0)]], [[seen(0, 0.8), large]]).precision == 0.5


def test_no_more_than_a_hundred_detections_of_a_class_in_a_picture_are_taken():
    crowd_of_wrong = [seen(1000 + 60 * k, 0.9) for k in range(100)]
    assert scored([[thing(0)]], [[*crowd_of_wrong, seen(0, 0.8)]]).recall == 0.0


def test_false_detections_are_counted_in_pictures_without_labels():
    labels = [[], [], [thing(0, crowd=True)], [thing(0)]]
    found = [[seen(0, 0.9), seen(0, 0.5, width=10)], [seen(0, 0.4)], [seen(200, 0.9)], []]
    result = scored(labels, found)
    assert result.distractor_pictures == 2
    assert result.false_per_100_distractor_pictures == pytest.approx(100.0)


def test_without_such_pictures_there_is_no_such_figure():
    assert scored([[thing(0)]], [[]]).false_per_100_distractor_pictures is None


def test_recall_by_size_distance_and_visibility():
    labels = [
        [
            thing(0, size=20, visibility=1.0, distance_m=3.5),
            thing(100, visibility=0.3, distance_m=0.7),
            thing(200, visibility=0.9, distance_m=1.0),
            thing(300, visibility=0.9, distance_m=1.5),
            thing(400, visibility=0.9, distance_m=1.5, ignore=True),
        ]
    ]
    result = scored(labels, [[seen(0, 0.9, width=20, height=20), seen(100, 0.9), seen(200, 0.9)]])
    assert _told(result.by_size_px) == {12.0: (1, 1.0), 48.0: (2, 0.5)}
    assert _told(result.by_distance_m) == {3.0: (1, 1.0), 1.0: (2, 0.5)}
    assert _told(result.by_visibility) == {0.25: (1, 1.0), 0.8: (2, 0.5)}


def _told(bins):
    return {one.low: (one.labels, one.recall) for one in bins if one.labels}


def test_files_without_distance_and_visibility_have_no_such_bins():
    result = scored([[thing(0)]], [[]])
    assert (result.by_distance_m, result.by_visibility) == ((), ())
    assert _told(result.by_size_px) == {48.0: (1, 0.0)}


def test_no_labels_and_no_pictures_give_no_figures():
    for result in (scored([], []), scored([[]], [[]])):
        assert (result.map50, result.map50_95, result.precision, result.recall) == (None, None, None, None)


def test_pictures_and_detections_are_of_one_number():
    with pytest.raises(ValueError, match="1 pictures, and detections for 0"):
        score([LabelledPicture("a.png")], [], ("hammer",))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ([], 1.0),
        ([seen(0, 0.9)], 0.1),
        ([seen(300, 0.7)], 1.7),
        ([seen(0, 0.9), seen(0, 0.6, width=45)], 0.7),
        ([seen(0, 0.9, name="wrench")], 1.9),
        ([seen(100, 0.9)], 1.0),
    ],
)
def test_error_of_a_picture(found, expected):
    picture = LabelledPicture("a.png", (thing(0), thing(100, ignore=True)))
    assert picture_errors(picture, tuple(found), ("hammer", "wrench")) == pytest.approx(expected)


def test_right_wrong_and_missed_in_a_picture():
    labels = (thing(0), thing(100), thing(200, ignore=True), thing(300, "wrench"))
    found = (seen(500, 0.6), seen(0, 0.9), seen(200, 0.9), seen(300, 0.8, "wrench"), seen(100, 0.4))
    told = judge_picture(LabelledPicture("a.png", labels), found, ("hammer", "wrench"))
    assert told.right == (found[1], found[3])
    assert told.wrong == (found[0],)
    assert told.missed == (labels[1],)


def random_set(seed=5, pictures=60):
    """Labels and detections of three classes, with crowds, hidden and small things, and equal scores."""
    rng = np.random.default_rng(seed)
    labels, found = [], []
    for k in range(pictures):
        here = [_random_label(rng) for _ in range(rng.integers(0, 6))]
        near = [_near(rng, label) for label in here for _ in range(rng.integers(0, 3))]
        stray = [_near(rng, _random_label(rng)) for _ in range(rng.integers(0, 3))]
        labels.append(LabelledPicture(f"{k}.png", tuple(here)))
        found.append(tuple(near + stray))
    return labels, found


NAMES = ("beer", "coke", "cube")


def _random_label(rng):
    x, y, w, h = rng.integers(0, 500), rng.integers(0, 400), rng.integers(5, 120), rng.integers(5, 120)
    return Label(
        NAMES[rng.integers(3)],
        (float(x), float(y), float(x + w), float(y + h)),
        crowd=bool(rng.random() < 0.1),
        ignore=bool(rng.random() < 0.1),
        visibility=float(rng.random() * 0.9 + 0.1),
    )


def _near(rng, label):
    shift = rng.integers(-6, 7, 4)
    u0, v0, u1, v1 = (value + float(by) for value, by in zip(label.box, shift, strict=True))
    return Detection(label.class_name, float(np.round(rng.random(), 2)), (u0, v0, max(u1, u0 + 1), max(v1, v0 + 1)))


# AP of pycocotools on random_set() when only its own ranges and flags are used, by class: at 0.5 and over all overlaps
COCO_TOLD = {
    "beer": (0.3206174355574077, 0.16125330823833695),
    "coke": (0.2755886028163256, 0.17447454013791844),
    "cube": (0.5497535267844493, 0.3073151343660217),
}


@pytest.mark.parametrize("name", NAMES)
def test_labels_and_detections_that_do_not_count_change_no_figure_of_coco(name):
    labels, found = random_set()
    told = {one.name: one for one in score(labels, found, NAMES).classes}[name]
    assert (told.ap50, told.ap50_95) == pytest.approx(COCO_TOLD[name], abs=1e-9)


def test_the_hand_camera_is_judged_by_all_classes_and_the_body_cameras_by_people():
    person, hammer = thing(0, "person"), thing(100)
    pictures = [
        LabelledPicture("a.png", (person, hammer), camera="hand"),
        LabelledPicture("b.png", (person, hammer), camera="left"),
        LabelledPicture("c.png", (hammer,), camera="back"),
        LabelledPicture("d.png", (hammer,)),
    ]
    both = (seen(0, 0.9, "person"), seen(100, 0.9))
    split = by_camera(pictures, [both, both, both, both])
    assert split["hand"] == (pictures[:1], [both])
    (b, c), found = split["body"]
    assert (b.labels, c.labels) == ((person,), ())
    assert c.only_distractors
    assert found == [both[:1], both[:1]]
    assert by_camera(pictures[3:], [both]) == {}
