"""Which pictures of a run are kept for an answer."""

import numpy as np

from executive.app.artifacts import Artifacts, draw_answer


def looked(*boxes, grey=False):
    picture = np.full((48, 64) if grey else (48, 64, 3), 90, np.uint8)
    found = [{"class_name": "hammer", "score": 0.9, "box": list(box)} for box in boxes]
    return {"detections": found, "image": picture}


def answered(artifacts, answer):
    return artifacts.message("answer", {"node": "alice/q", "question": "q", "answer": answer, "message": "m"})


def test_a_positive_answer_shows_the_found_object_with_its_box(tmp_path):
    artifacts = Artifacts()
    artifacts.message("detections", looked())
    artifacts.message("detections", looked((10, 10, 40, 30)))
    artifacts.message("object_destination", {"class_name": "hammer"})
    told = answered(artifacts, True)
    assert told["image"].shape == (48, 64, 3)
    assert np.any(told["image"] != 90)
    assert draw_answer(artifacts, tmp_path).stat().st_size > 100


def test_a_negative_answer_shows_all_views():
    artifacts = Artifacts()
    for grey in (False, True, False, False, False):
        artifacts.message("detections", looked(grey=grey))
    assert answered(artifacts, False)["image"].shape == (480, 1280, 3)


def test_without_a_question_there_is_no_picture(tmp_path):
    artifacts = Artifacts()
    artifacts.message("detections", looked((10, 10, 40, 30)))
    assert draw_answer(artifacts, tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_only_the_last_views_before_an_answer_are_kept():
    artifacts = Artifacts()
    for _ in range(100):
        artifacts.message("detections", looked())
    assert len(artifacts.of_robot("").looked) == 12
