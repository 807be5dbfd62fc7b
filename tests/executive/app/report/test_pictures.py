"""Picture files: what is read, and what is told of the rest."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from executive.app.report.pictures import read_picture, write_picture
from skills.inputs.errors import InputError


def noise(*shape, dtype=np.uint8):
    return np.random.default_rng(3).integers(0, np.iinfo(dtype).max, shape, dtype=dtype)


def written(file, picture):
    file.write_bytes(cv2.imencode(file.suffix, picture)[1].tobytes())
    return file


def refused(file):
    with pytest.raises(InputError) as error:
        read_picture(file)
    assert error.value.file == file
    assert error.value.hint
    return error.value.message


# What is written under which name -> what is read.
READ = [
    *((f"a{ending}", noise(30, 40, 3), lambda picture: picture[:, :, ::-1]) for ending in (".png", ".bmp", ".tiff")),
    ("grey.png", noise(30, 40), lambda picture: np.repeat(picture[:, :, None], 3, axis=2)),
    ("long.png", np.zeros((10, 20_000), np.uint8), lambda picture: np.zeros((10, 20_000, 3), np.uint8)),
    ("one.png", np.zeros((1, 1), np.uint8), lambda picture: np.zeros((1, 1, 3), np.uint8)),
    ("transparent.png", noise(30, 40, 4), lambda picture: picture[:, :, 2::-1]),
]


@pytest.mark.parametrize(("name", "picture", "read"), READ, ids=[name for name, *_ in READ])
def test_a_picture_is_read_as_rgb(tmp_path, name, picture, read):
    assert np.array_equal(read_picture(written(tmp_path / name, picture)), read(picture))


@pytest.mark.parametrize("ending", [".jpg", ".webp"])
def test_lossy_forms_are_read(tmp_path, ending):
    picture = np.full((30, 40, 3), (200, 100, 50), np.uint8)
    read = read_picture(written(tmp_path / f"a{ending}", picture[:, :, ::-1]))
    assert np.abs(read.astype(int) - picture).max() < 12


def test_sixteen_bits_become_eight(tmp_path):
    picture = noise(30, 40, 3, dtype=np.uint16)
    read = read_picture(written(tmp_path / "a.png", picture))
    assert np.abs(read[:, :, ::-1].astype(int) - picture / 257).max() <= 1


@pytest.mark.parametrize("ending", [".png", ".jpg", ".bmp", ".tiff", ".webp"])
def test_a_truncated_file_is_damaged(tmp_path, ending):
    file = written(tmp_path / f"a{ending}", noise(100, 100, 3))
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    assert refused(file) == "the picture is damaged or cut off"


def test_a_wrong_byte_is_damage(tmp_path, capfd):
    content = bytearray(written(tmp_path / "a.png", noise(100, 100, 3)).read_bytes())
    content[len(content) // 2] ^= 255
    (tmp_path / "a.png").write_bytes(content)
    assert (refused(tmp_path / "a.png"), capfd.readouterr().err) == ("the picture is damaged or cut off", "")


# What lies there -> what the refusal says.
NO_PICTURES = [
    ("a.png", lambda file: file.touch(), "it is empty"),
    ("a.png", lambda file: file.write_text("a thousand words"), "it is no picture"),
    ("a.txt", lambda file: file.write_text("a thousand words"), "it is no picture"),
    ("b", lambda file: file.mkdir(), "it is a folder"),
    ("b.png", lambda file: None, "there is no such file"),
]


@pytest.mark.parametrize(("name", "put", "says"), NO_PICTURES)
def test_a_file_without_a_picture_is_refused(tmp_path, name, put, says):
    put(tmp_path / name)
    assert refused(tmp_path / name) == says


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def test_a_png_that_would_fill_the_memory_is_refused_by_its_head(tmp_path):
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 20_000, 20_000, 8, 0, 0, 0, 0))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", b"") + chunk(b"IEND", b""))
    assert "20000 x 20000 pixels" in refused(tmp_path / "a.png")


def test_a_jpeg_that_would_fill_the_memory_is_refused_by_its_head(tmp_path):
    content = written(tmp_path / "a.jpg", np.zeros((16, 16, 3), np.uint8)).read_bytes()
    size = struct.pack(">HH", 16, 16)
    (tmp_path / "a.jpg").write_bytes(content.replace(size, struct.pack(">HH", 30_000, 40_000), 1))
    assert "40000 x 30000 pixels" in refused(tmp_path / "a.jpg")


def test_a_written_picture_is_read_again(tmp_path):
    picture = noise(20, 30, 3)
    write_picture(tmp_path / "new" / "a.png", picture)
    assert np.array_equal(read_picture(tmp_path / "new" / "a.png"), picture)


def test_a_folder_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write it .*; name a folder"):
        write_picture(tmp_path / "file" / "a.png", noise(2, 2, 3))
