from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from errand_train.detector.canvases import CanvasMaker, CanvasOptions
from errand_train.detector.labels import Labels, TrainingPicture
from errand_train.detector.store import PictureStore
from skills.perception.detector.boxes import HEIGHT_PX, PADDING, WIDTH_PX

SEEDS = range(12)
BOX = (200, 120, 320, 300)


def labels(x0, y0, x1, y1):
    outline = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=np.float32)
    return Labels((outline,), np.array([3]), np.ones(1, np.float32), np.zeros(1, bool))


@pytest.fixture
def maker():
    """Two grey pictures with one white rectangle each."""
    full = np.full((2, HEIGHT_PX, WIDTH_PX, 3), 60, dtype=np.uint8)
    x0, y0, x1, y1 = BOX
    full[:, y0:y1, x0:x1] = 250
    picture = TrainingPicture(Path("none.jpg"), labels(*BOX))
    return CanvasMaker([picture, picture], PictureStore(full, full[:, ::2, ::2]))


def plain(monkeypatch):
    monkeypatch.setattr("errand_train.detector.canvases.change_photometry", lambda picture, _random: picture)


def bright_box(canvas, around):
    """The box of bright pixels near a target."""
    x0, y0, x1, y1 = np.clip(around + (-6, -6, 6, 6), 0, None).astype(int)
    part = canvas.picture[y0:y1, x0:x1, 0] > 190
    rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
    return np.array([x0 + columns[0], y0 + rows[0], x0 + columns[-1] + 1, y0 + rows[-1] + 1])


def alone(boxes):
    """Which boxes have no other near them."""
    near = (boxes[:, None, :2] < boxes[None, :, 2:] + 16).all(axis=2)
    return (near & near.T).sum(axis=1) == 1


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("mosaic", [0.0, 1.0])
def test_boxes_stay_about_the_objects(maker, monkeypatch, mosaic, whole):
    plain(monkeypatch)
    options = CanvasOptions(320, 256, mosaic=mosaic, whole=whole)
    seen = 0
    for seed in SEEDS:
        canvas = maker.make(0, options, np.random.default_rng(seed))
        for box in canvas.targets.boxes[alone(canvas.targets.boxes) & ~canvas.targets.ignored]:
            assert np.abs(bright_box(canvas, box) - box).max() <= 2.5, seed
            seen += 1
    assert seen >= len(SEEDS) // 2


def test_canvases_have_the_size_that_is_asked_for(maker):
    canvas = maker.make(1, CanvasOptions(448, 352, mosaic=1.0), np.random.default_rng(0))
    assert canvas.picture.shape == (352, 448, 3)
    assert canvas.picture.dtype == np.uint8


def test_boxes_are_within_the_canvas(maker):
    for seed in SEEDS:
        boxes = maker.make(0, CanvasOptions(mosaic=0.5), np.random.default_rng(seed)).targets.boxes
        assert (boxes >= 0).all()
        assert (boxes <= (320, 256, 320, 256)).all()


def test_the_same_random_source_gives_the_same_canvas(maker):
    first, second = (maker.make(0, CanvasOptions(), np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(first.picture, second.picture)
    assert np.array_equal(first.targets.boxes, second.targets.boxes)


def test_windows_mostly_show_an_object(maker):
    options = CanvasOptions(mosaic=0.0, focused=1.0)
    made = [maker.make(0, options, np.random.default_rng(seed)) for seed in SEEDS]
    assert all(len(canvas.targets.boxes) for canvas in made)


def test_beyond_a_picture_there_is_the_letterboxs_grey(maker, monkeypatch):
    plain(monkeypatch)
    options = replace(CanvasOptions(640, 480, whole=True, mosaic=0.0), scales=(0.5, 0.5001))
    canvas = maker.make(0, options, np.random.default_rng(1))
    assert (canvas.picture[:3] == PADDING).all()
