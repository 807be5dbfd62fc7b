import cv2
import numpy as np
import pytest

from errand_train.detector.labels import Labels, TrainingDataError, TrainingPicture
from errand_train.detector.store import open_store

NOTHING = Labels((), np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros(0, bool))


def picture(file, value):
    cv2.imwrite(str(file), np.full((240, 320), value, dtype=np.uint8))
    return TrainingPicture(file, NOTHING)


def test_pictures_are_kept_at_the_networks_size_and_at_half(tmp_path):
    store = open_store(tmp_path / "kept", [picture(tmp_path / "a.png", 10), picture(tmp_path / "b.png", 200)])
    assert store.full.shape == (2, 480, 640, 3)
    assert store.half.shape == (2, 240, 320, 3)
    assert store.full[:, 0, 0, 0].tolist() == store.half[:, 0, 0, 0].tolist() == [10, 200]


def test_other_pictures_fill_the_store_again_and_the_same_do_not(tmp_path):
    first, second = picture(tmp_path / "a.png", 10), picture(tmp_path / "b.png", 200)
    open_store(tmp_path / "kept", [first])
    first.file.unlink()
    assert open_store(tmp_path / "kept", [first]).full[0, 0, 0, 0] == 10
    assert open_store(tmp_path / "kept", [second]).full[0, 0, 0, 0] == 200


def test_a_damaged_picture_is_named(tmp_path):
    file = tmp_path / "a.jpg"
    file.write_bytes(b"no picture")
    with pytest.raises(TrainingDataError, match=r"a\.jpg"):
        open_store(tmp_path / "kept", [TrainingPicture(file, NOTHING)])
    assert not (tmp_path / "kept" / "pictures.txt").exists()
