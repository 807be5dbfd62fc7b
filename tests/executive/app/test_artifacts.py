"""Which pictures of a run are kept for an answer."""

import numpy as np

from executive.app.artifacts import Artifacts, draw_answer


def looked(*boxes, grey=False):
    picture = np.full((48, 64) if grey else (48, 64, 3), 90, np.uint8)
    found = [{"class_name": "hammer", "score": 0.9, "box": list(box)} for box in boxes]
    return {"detections": found, "image": picture}


def answered(artifacts, answer):
    artifacts("answer", {"node": "alice/q", "question": "q", "answer": answer, "message": "m"})


def test_a_yes_shows_what_was_found_with_its_box(tmp_path):
    log = []
    artifacts = Artifacts(lambda topic, message: log.append((topic, message)))
    artifacts("detections", looked())
    artifacts("detections", looked((10, 10, 40, 30)))
    artifacts("object_destination", {"class_name": "hammer"})
    answered(artifacts, True)
    assert log[-1][0] == "answer"
    assert log[-1][1]["image"].shape == (48, 64, 3)
    assert np.any(log[-1][1]["image"] != 90)
    assert draw_answer(artifacts, tmp_path).stat().st_size > 100


def test_a_no_shows_all_that_was_looked_at():
    log = []
    artifacts = Artifacts(lambda topic, message: log.append((topic, message)))
    for grey in (False, True, False, False, False):
        artifacts("detections", looked(grey=grey))
    answered(artifacts, False)
    assert log[-1][1]["image"].shape == (480, 1280, 3)


def test_without_a_question_there_is_no_picture(tmp_path):
    artifacts = Artifacts(lambda topic, message: None)
    artifacts("detections", looked((10, 10, 40, 30)))
    assert draw_answer(artifacts, tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_of_many_looks_without_an_answer_only_the_last_are_remembered():
    artifacts = Artifacts(lambda topic, message: None)
    for _ in range(100):
        artifacts("detections", looked())
    assert len(artifacts.of("").looked) == 12
