from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")

from skills.perception.detector.scales import Scales, halved
from skills.perception.training.crop_batches import changed_map
from skills.perception.training.crop_store import CropStore, written_crops

CHIP = (128, 128)


def smooth_picture() -> Scales:
    """A picture of soft colours, which compression hardly changes."""
    coarse = np.random.default_rng(3).integers(60, 200, (12, 16, 3), dtype=np.uint8)
    full = np.asarray(cv2.resize(coarse, (640, 480), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    return Scales(full, halved(full))


def kept(folder: Path, scales: Scales, *boxes: tuple[float, float, float, float]) -> CropStore:
    with written_crops(folder) as writer:
        writer.add(scales, np.array(boxes, np.float32))
    return CropStore.read(folder)


# of 640 x 480: tiny, small, at a corner, where a crop's scale is just above and below a half, the whole picture
BOXES = [
    (300.0, 200.0, 306.0, 212.0),
    (311.0, 203.0, 345.0, 259.0),
    (0.0, 0.0, 51.0, 80.0),
    (200.0, 100.0, 366.0, 190.0),
    (200.0, 100.0, 378.0, 190.0),
    (0.0, 0.0, 640.0, 480.0),
]


@pytest.mark.parametrize("box", BOXES)
def test_every_crop_is_as_if_cut_from_the_whole_picture(tmp_path: Path, box: tuple[float, float, float, float]) -> None:
    scales = smooth_picture()
    about, place = kept(tmp_path, scales, box), np.array(box, np.float32)
    for seed in range(300):
        affine, _ = changed_map(place, np.random.default_rng(seed))
        whole, small = scales.cut(affine, CHIP), about.cut(0, affine)
        assert np.abs(whole.astype(int) - small).max() <= 12


def test_little_is_kept_of_a_small_things_picture(tmp_path: Path) -> None:
    assert len(kept(tmp_path, smooth_picture(), BOXES[1]).data) < len(kept(tmp_path, smooth_picture(), BOXES[-1]).data)


def test_each_place_has_its_own(tmp_path: Path) -> None:
    scales = smooth_picture()
    about = kept(tmp_path, scales, *BOXES)
    assert len(about) == len(BOXES)
    affine, _ = changed_map(np.array(BOXES[-1], np.float32), np.random.default_rng(0))
    assert np.abs(about.cut(len(BOXES) - 1, affine).astype(int) - scales.cut(affine, CHIP)).max() <= 12


def test_what_was_kept_before_stays_when_writing_is_broken_off(tmp_path: Path) -> None:
    before = kept(tmp_path, smooth_picture(), BOXES[0])
    data = bytes(before.data)
    with pytest.raises(KeyboardInterrupt), written_crops(tmp_path) as writer:
        writer.add(smooth_picture(), np.array(BOXES, np.float32))
        raise KeyboardInterrupt
    again = CropStore.read(tmp_path)
    assert (len(again), bytes(again.data)) == (1, data)
    assert {file.name for file in tmp_path.iterdir()} == {"chips.u8", "chips.npz"}
