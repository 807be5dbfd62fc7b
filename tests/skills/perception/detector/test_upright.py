import numpy as np

from skills.detection import Detection
from skills.perception.detector.upright import turned, turned_back


def test_a_turned_picture_begins_with_its_last_pixel():
    picture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    assert turned(picture)[0, 0].tolist() == [21, 22, 23]
    assert turned(picture).flags.c_contiguous


def test_boxes_are_turned_back_to_where_the_picture_was_taken():
    # in 640 x 480: u 100 to 200 and v 50 to 80 of the turned picture
    (found,) = turned_back([Detection("hammer", 0.9, (100.0, 50.0, 200.0, 80.0))], 640, 480)
    assert (found.class_name, found.score, found.box) == ("hammer", 0.9, (440.0, 400.0, 540.0, 430.0))
