import numpy as np
import pytest

from errand_train.detector.photometry import change_photometry

SHAPE = (60, 80, 3)


def scene():
    return np.random.default_rng(0).integers(0, 256, SHAPE, dtype=np.uint8)


@pytest.mark.parametrize("seed", range(20))
def test_size_and_type_stay(seed):
    changed = change_photometry(scene(), np.random.default_rng(seed))
    assert changed.shape == SHAPE
    assert changed.dtype == np.uint8


def test_the_given_picture_is_left_as_it_is():
    picture = scene()
    for seed in range(20):
        change_photometry(picture, np.random.default_rng(seed))
    assert np.array_equal(picture, scene())


def test_some_become_grey_and_most_do_not():
    picture = np.full(SHAPE, (200, 60, 20), dtype=np.uint8)
    made = [change_photometry(picture, np.random.default_rng(seed)) for seed in range(200)]
    grey = sum(int(np.ptp(np.median(one.reshape(-1, 3), axis=0)) < 3) for one in made)
    assert 15 <= grey <= 75


def test_the_dark_does_not_become_black():
    picture = np.full(SHAPE, 30, dtype=np.uint8)
    made = [change_photometry(picture, np.random.default_rng(seed)) for seed in range(100)]
    assert min(float(np.median(one)) for one in made) > 10
