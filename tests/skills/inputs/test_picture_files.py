import cv2
import numpy as np
import pytest

from skills.inputs.errors import InputError
from skills.inputs.picture_files import read_brightness, read_pixels

SHARES = np.linspace(0.0, 1.0, 20 * 30 * 3).reshape(20, 30, 3)


def written(file, values):
    assert cv2.imwrite(str(file), values)
    return file


#   values in the file                        suffix
WIDE = [
    (SHARES.astype(np.float32), "tiff"),
    (SHARES, "tiff"),
    ((255 * SHARES).astype(np.float32), "tiff"),
    ((1e4 * SHARES).astype(np.float32), "tiff"),
    ((2 * SHARES - 1).astype(np.float32), "tiff"),
    ((1000 * SHARES).astype(np.int32), "tiff"),
    ((30_000 * SHARES).astype(np.int16), "tiff"),
    (SHARES.astype(np.float32), "pfm"),
]


@pytest.mark.parametrize(("values", "suffix"), WIDE, ids=[f"{v.dtype} {v.max():.0f} {s}" for v, s in WIDE])
def test_pictures_of_float_and_wide_values_are_read_from_black_to_white(tmp_path, values, suffix, capfd):
    pixels = read_pixels(written(tmp_path / f"a.{suffix}", values), flags=cv2.IMREAD_COLOR)
    assert pixels.dtype == np.uint8
    assert np.abs(pixels - 255 * SHARES).max() <= 1.5
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int32])
def test_grey_of_wide_values_is_read_in_colour_and_as_brightness(tmp_path, kind):
    file = written(tmp_path / "a.tiff", (1000 * SHARES[..., 0]).astype(kind))
    expected = SHARES[..., 0] / SHARES[..., 0].max()
    assert np.abs(read_pixels(file, flags=cv2.IMREAD_COLOR_RGB)[..., 2] - 255 * expected).max() <= 1.5
    assert np.abs(read_brightness(file, most_pixels=1000).shares - expected).max() <= 0.01


def test_values_that_are_no_numbers_are_black(tmp_path):
    values = np.where(SHARES > 0.5, np.nan, SHARES).astype(np.float32)
    pixels = read_pixels(written(tmp_path / "a.tiff", values), flags=cv2.IMREAD_COLOR)
    assert np.abs(pixels - 255 * np.nan_to_num(values)).max() <= 1.5


def test_a_picture_without_any_number_is_refused(tmp_path):
    file = written(tmp_path / "a.tiff", np.full((20, 30), np.nan, np.float32))
    with pytest.raises(InputError, match=r"a\.tiff: none of its values is a number"):
        read_pixels(file)


@pytest.mark.parametrize("brand", [b"heic", b"heix", b"mif1"])
def test_a_photograph_of_a_phone_is_refused_with_a_way_to_convert_it(tmp_path, brand):
    (tmp_path / "a.heic").write_bytes(b"\0\0\0\x1cftyp" + brand + bytes(64))
    with pytest.raises(InputError, match=r"it is HEIC, .*; save it as JPEG: heif-convert a.heic a.jpg"):
        read_pixels(tmp_path / "a.heic")


@pytest.mark.parametrize("suffix", ["png", "tiff"])
def test_bytes_in_a_picture_of_16_bits_are_read_as_bytes(tmp_path, suffix):
    values = np.rint(255 * SHARES).astype(np.uint16)
    assert (read_pixels(written(tmp_path / f"a.{suffix}", values), flags=cv2.IMREAD_COLOR) == values).all()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_usual_values_stay_as_they_are(tmp_path, kind):
    values = (np.iinfo(kind).max * SHARES).astype(kind)
    assert (read_pixels(written(tmp_path / "a.tiff", values)) == values).all()
