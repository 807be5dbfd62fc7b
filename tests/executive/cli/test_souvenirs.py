"""Which pictures of a run are kept for an answer."""

import numpy as np

from executive.cli.souvenirs import Souvenirs, draw_answer


def looked(*boxes, grey=False):
    picture = np.full((48, 64) if grey else (48, 64, 3), 90, np.uint8)
    found = [{"class_name": "hammer", "score": 0.9, "box": list(box)} for box in boxes]
    return {"detections": found, "image": picture}


def answered(souvenirs, answer):
    souvenirs("answer", {"node": "alice/q", "question": "q", "answer": answer, "message": "m"})


def test_a_yes_shows_what_was_found_with_its_box(tmp_path):
    log = []
    souvenirs = Souvenirs(lambda topic, message: log.append((topic, message)))
    souvenirs("detections", looked())
    souvenirs("detections", looked((10, 10, 40, 30)))
    souvenirs("object_destination", {"class_name": "hammer"})
    answered(souvenirs, True)
    assert log[-1][0] == "answer"
    assert log[-1][1]["image"].shape == (48, 64, 3)
    assert np.any(log[-1][1]["image"] != 90)
    assert draw_answer(souvenirs, tmp_path).stat().st_size > 100


def test_a_no_shows_all_that_was_looked_at():
    log = []
    souvenirs = Souvenirs(lambda topic, message: log.append((topic, message)))
    for grey in (False, True, False, False, False):
        souvenirs("detections", looked(grey=grey))
    answered(souvenirs, False)
    assert log[-1][1]["image"].shape == (480, 1280, 3)


def test_without_a_question_there_is_no_picture(tmp_path):
    souvenirs = Souvenirs(lambda topic, message: None)
    souvenirs("detections", looked((10, 10, 40, 30)))
    assert draw_answer(souvenirs, tmp_path) is None
    assert list(tmp_path.iterdir()) == []
