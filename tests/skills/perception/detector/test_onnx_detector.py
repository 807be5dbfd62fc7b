"""The detector, with small networks that read detections from the pictures."""

import threading

import numpy as np
import pytest
from tiny_detector import CLASSES, picture_of, write_cascade, write_model, write_pair

from skills.detection import Detection
from skills.perception.detector.model_files import CROP_PX, ModelFileError
from skills.perception.detector.onnx_detector import (
    DetectorOptions,
    ProposalOptions,
    crop_map,
    load_detector,
    logits,
    select_proposals,
    transform_boxes,
)

WHOLE, MOST, BESIDE, EMPTY = (0, 0, 100, 100), (0, 0, 90, 100), (200, 0, 300, 50), (10, 10, 10, 20)


def found(*rows, **options):
    boxes, scores = zip(*rows, strict=True)
    return select_proposals(np.array(boxes, np.float32), np.array(scores, np.float32), ProposalOptions(**options))


def test_boxes_of_any_class_on_one_object_become_one_proposal_with_the_best_ones_logits():
    regions = found((MOST, (0.3, 0.1)), (WHOLE, (0.2, 0.8)), (BESIDE, (0.4, 0.0)))
    assert regions.boxes.tolist() == [list(WHOLE), list(BESIDE)]
    assert regions.logits == pytest.approx(logits(np.array([[0.2, 0.8], [0.4, 0.0]], np.float32)))


def test_faint_and_empty_boxes_are_no_proposals():
    assert len(found((WHOLE, (0.008, 0.002)), (EMPTY, (0.9, 0.0)), ((0, 0, float("nan"), 5), (0.9, 0.0)))) == 0


def test_the_number_of_proposals_is_limited():
    assert found((WHOLE, (0.3,)), (BESIDE, (0.4,)), most=1).boxes.tolist() == [list(BESIDE)]


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ((100, 100, 184, 184), (22, 22, 106, 106)),  # as large as in the crop
        ((0, 0, 168, 84), (22, 43, 106, 85)),  # twice as large
        ((50, 50, 60, 60), (43, 43, 85, 85)),  # very small
    ],
)
def test_a_proposal_is_in_the_middle_of_its_crop_and_fills_two_thirds_of_it(box, expected):
    crop = crop_map(np.array(box, np.float32))
    assert transform_boxes(np.array([box]), crop)[0].tolist() == pytest.approx(expected, abs=1e-3)
    assert CROP_PX == 128


def test_a_mirrored_crop_shows_the_left_at_the_right():
    crop = crop_map(np.array((100, 100, 184, 184), np.float32), mirrored=True)
    assert transform_boxes(np.array([(100, 100, 110, 184)]), crop)[0].tolist() == pytest.approx(
        (96, 22, 106, 106), abs=1e-3
    )


def test_boxes_under_a_rotation_hold_their_corners():
    quarter = np.array([[0.0, -1.0, 50.0], [1.0, 0.0, 0.0]])
    assert transform_boxes(np.array([(0, 0, 10, 20)]), quarter)[0].tolist() == [30.0, 0.0, 50.0, 10.0]


def test_each_box_may_have_a_map_of_its_own():
    boxes = np.array([WHOLE, BESIDE], np.float32)
    maps = np.stack([crop_map(box) for box in boxes])
    one_by_one = [transform_boxes(box[None], one)[0].tolist() for box, one in zip(boxes, maps, strict=True)]
    assert transform_boxes(boxes, maps).tolist() == one_by_one


HAMMER = ("hammer", 0.9, (100, 50, 200, 80))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model") / "tiny.onnx")


@pytest.fixture(scope="module")
def detector(file):
    return load_detector(file)


def test_a_detection_has_class_score_and_box(detector):
    (found,) = detector.detect([picture_of(HAMMER)])
    assert found == (Detection("hammer", pytest.approx(0.9), (100.0, 50.0, 200.0, 80.0)),)
    assert detector.class_names == CLASSES


def test_a_detection_has_alternative_classes(detector):
    other = ("coke", 0.3, (100, 50, 200, 78)), ("beer", 0.4, (100, 50, 200, 80)), ("beer", 0.05, (0, 0, 9, 9))
    (found,) = detector.detect([picture_of(HAMMER, *other)])
    assert [one.alternatives for one in found] == [(("beer", pytest.approx(0.4)), ("coke", pytest.approx(0.3)))]


def seen(detector, *things, **picture):
    """Classes and scores of the detections in a picture of things."""
    (found,) = detector.detect([picture_of(*things, **picture)])
    return [(one.class_name, round(one.score, 2)) for one in found]


def test_detections_are_sorted_by_score_and_cut_at_the_threshold(detector):
    things = [("beer", 0.6, (0, 0, 50, 50)), ("coke", 0.8, (300, 0, 350, 50)), ("hammer", 0.48, (100, 100, 200, 200))]
    assert [name for name, _ in seen(detector, *things)] == ["coke", "beer"]


def test_two_boxes_on_one_object_become_one_detection(detector):
    assert [name for name, _ in seen(detector, HAMMER, ("coke", 0.7, (100, 50, 200, 77.5)))] == ["hammer"]


def test_a_lower_threshold_gives_more_detections(file):
    faint = ("beer", 0.2, (0, 0, 50, 50))
    assert len(seen(load_detector(file, DetectorOptions(threshold=0.1)), faint)) == 1
    ((found,),) = load_detector(file).detect([picture_of(faint)], 0.1)
    assert found.class_name == "beer"


def test_boxes_are_in_the_pictures_own_pixels_and_inside_it(detector):
    # 320x480 fills the left 320 of 640 columns at scale 1: what reaches beyond is clipped
    picture = picture_of(("beer", 0.9, (300, 100, 400, 200)), size=(480, 320))
    assert detector.detect([picture])[0][0].box == (300.0, 100.0, 320.0, 200.0)


def test_boxes_in_the_padding_are_no_detections(detector):
    assert detector.detect([picture_of(("beer", 0.9, (400, 100, 500, 200)), size=(480, 320))]) == [()]


def test_grey_pictures_are_accepted(detector):
    assert detector.detect([picture_of(HAMMER)[:, :, 0]])[0][0].class_name == "hammer"


def test_no_pictures_give_no_detections(detector):
    assert detector.detect([]) == []


def test_pictures_of_several_sizes_at_once_are_each_judged_alone(file):
    pictures = [picture_of(HAMMER), np.zeros((7, 900), np.uint8), picture_of(("beer", 0.7, (0, 0, 50, 50)))]
    detector = load_detector(file)
    together = detector.detect(pictures)
    assert [len(found) for found in together] == [1, 0, 1]
    assert together == [detector.detect([picture])[0] for picture in pictures]


def test_with_a_refinement_network_one_picture_gives_the_same_as_several(looks_again):
    pictures = [
        red_picture((50, 50, 250, 250), things=[("hammer", 0.2, LARGE)]),
        red_picture((250, 150, 450, 450), things=[("coke", 0.3, (300, 200, 400, 400))]),
    ]
    assert looks_again.detect(pictures) == [looks_again.detect([one])[0] for one in pictures]


@pytest.mark.parametrize("picture", [np.zeros((1, 1), np.uint8), np.zeros((480, 640, 3), np.uint8)])
def test_black_and_tiny_pictures_have_no_detections(detector, picture):
    assert detector.detect([picture]) == [()]


@pytest.mark.parametrize("picture", [np.zeros((4, 4, 4), np.uint8), np.zeros((4, 4)), np.empty((0, 5), np.uint8), None])
def test_anything_but_a_picture_is_refused(detector, picture):
    with pytest.raises(ValueError, match="a picture is"):
        detector.detect([picture])


def test_one_invalid_picture_among_others_is_refused(detector):
    with pytest.raises(ValueError, match="a picture is"):
        detector.detect([picture_of(HAMMER), np.zeros((4, 4)), picture_of(HAMMER)])


def test_threads_that_share_it_find_the_same(detector):
    found = []
    threads = [threading.Thread(target=lambda: found.append(detector.detect([picture_of(HAMMER)]))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert all(one == found[0] for one in found)


def test_the_detector_of_a_missing_file_says_so(tmp_path):
    with pytest.raises(ModelFileError, match=r"missing\.onnx: there is no such model"):
        load_detector(tmp_path / "missing.onnx")


@pytest.fixture(scope="module")
def looks_again(tmp_path_factory):
    """A detector whose refinement network scores a beer by the share of red in a crop."""
    return load_detector(write_pair(tmp_path_factory.mktemp("pair") / "tiny.onnx"))


LARGE, FLAT = (100, 100, 200, 200), (100, 100, 200, 150)


def red_picture(*boxes, things=(("hammer", 0.6, LARGE),)):
    """Picture of things with red boxes over it."""
    picture = picture_of(*things)
    for u0, v0, u1, v1 in boxes:
        picture[v0:v1, u0:u1, 0] = 255
    return picture


def test_the_refinement_network_judges_uncertain_proposals(looks_again):
    (found,) = looks_again.detect([red_picture((50, 50, 250, 250), things=[("hammer", 0.2, LARGE)])])
    assert [(one.class_name, round(one.score, 2)) for one in found] == [("beer", 1.0)]


def test_the_refinement_network_can_reject_a_sure_proposal(looks_again):
    assert looks_again.detect([picture_of(HAMMER)]) == [()]


def test_the_refinement_network_is_not_run_without_proposals(looks_again):
    assert looks_again.detect([red_picture((50, 50, 250, 250), things=())]) == [()]


# each network says boxes a tenth smaller than those that it gets
# 100 wide, 50 high -> 90, 45 -> 81, 40.5 about the same middle (150, 125)
@pytest.mark.parametrize(
    ("write", "box"), [(write_pair, (105.0, 102.5, 195.0, 147.5)), (write_cascade, (109.5, 104.75, 190.5, 145.25))]
)
def test_each_later_network_refines_the_boxes_of_the_one_before(tmp_path, write, box):
    picture = red_picture((0, 2, 300, 300), things=[("hammer", 0.2, FLAT)])
    (found,) = load_detector(write(tmp_path / "tiny.onnx")).detect([picture])
    assert found[0].box == pytest.approx(box, abs=0.01)


RIGHT_HALF = (150, 2, 400, 400)


# The refinement network sees red only in the left half: 1.0 in the crop, 0.0 in its mirror image.
@pytest.mark.parametrize(("mirrored_from", "score"), [(None, 1.0), (0.3, 0.5)])
def test_a_crop_and_its_mirror_image_are_judged_together(tmp_path, mirrored_from, score):
    options = DetectorOptions(0.05, proposals=ProposalOptions(mirrored_from=mirrored_from))
    detector = load_detector(write_pair(tmp_path / "tiny.onnx", left_only=True), options)
    (found,) = detector.detect([red_picture((0, 2, 150, 400))])
    assert round(found[0].score, 1) == score


def test_the_mirror_image_of_a_faint_proposal_is_not_judged(tmp_path):
    options = DetectorOptions(0.05, proposals=ProposalOptions(mirrored_from=0.3))
    detector = load_detector(write_pair(tmp_path / "tiny.onnx", left_only=True), options)
    assert detector.detect([red_picture(RIGHT_HALF)]) == [()]


def classes_right(file, **options):
    """Classes that the networks of a file find in a picture that is red in the right half alone."""
    (found,) = load_detector(file, DetectorOptions(0.05, **options)).detect([red_picture(RIGHT_HALF)])
    return [one.class_name for one in found]


# The classifier network sees red in the left half alone, where there is none.
def test_a_classifier_network_judges_what_the_refinement_network_sees(tmp_path):
    assert classes_right(write_pair(tmp_path / "two.onnx")) == ["beer"]
    assert classes_right(write_cascade(tmp_path / "three.onnx", left_only=True)) == []


# least score that is judged -> 1.0 of the refinement network is above or below it
@pytest.mark.parametrize(("least_score", "classes"), [(0.12, []), (1.1, ["beer"])])
def test_unclassified_boxes_keep_the_result_of_the_refinement_network(tmp_path, least_score, classes):
    options = ProposalOptions(least_score=least_score, mirrored_from=None)
    file = write_cascade(tmp_path / "three.onnx", left_only=True)
    assert classes_right(file, reclassified=options) == classes


# of two places that the refinement network sees, the third judges so many
@pytest.mark.parametrize(("most", "count"), [(1, 1), (2, 0)])
def test_the_best_boxes_are_classified(tmp_path, most, count):
    things = ("hammer", 0.6, LARGE), ("hammer", 0.6, (400, 100, 500, 200))
    picture = red_picture((150, 2, 300, 400), (450, 2, 600, 400), things=things)
    options = DetectorOptions(0.05, reclassified=ProposalOptions(same=1.0, most=most, mirrored_from=None))
    (found,) = load_detector(write_cascade(tmp_path / "three.onnx", left_only=True), options).detect([picture])
    assert len(found) == count


def test_the_quick_search_finds_the_objects_of_one_class(detector):
    picture = picture_of(HAMMER, ("coke", 0.9, (200, 150, 300, 180)))
    found = (Detection("hammer", pytest.approx(0.9), (100.0, 50.0, 200.0, 80.0)),)
    assert detector.detect_class([picture], "hammer") == [found]


# The refinement network takes red for a beer; it is not asked about a hammer.
@pytest.mark.parametrize(("proposal", "found"), [(("hammer", 0.9), []), (("beer", 0.2), ["beer"])])
def test_the_quick_search_refines_only_proposals_of_the_class(looks_again, proposal, found):
    picture = red_picture((60, 60, 240, 240), things=[(*proposal, LARGE)])
    assert [one.class_name for one in looks_again.detect_class([picture], "beer")[0]] == found


@pytest.mark.parametrize(
    ("shape", "class_name", "message"), [((0, 0, 3), "beer", "picture"), ((240, 320), "screwdriver", "screwdriver")]
)
def test_the_quick_search_refuses_unknown_classes_and_anything_but_pictures(detector, shape, class_name, message):
    with pytest.raises(ValueError, match=message):
        detector.detect_class([np.zeros(shape, np.uint8)], class_name)
