"""Maps in the forms that map_server, map_saver and slam_toolbox write: one small room, made anew in each form."""

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

FREE, UNKNOWN, OCCUPIED = 254, 205, 0
SAVED: Final = "origin: [-1, -2, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def room():
    """A room of 10 x 8 cells with walls around, and unknown ground in its first row below the upper wall."""
    grey = np.full((8, 10), FREE, np.uint8)
    grey[[0, -1]], grey[:, [0, -1]], grey[1, 1:-1] = OCCUPIED, OCCUPIED, UNKNOWN
    return grey


@dataclass(frozen=True)
class MapForm:
    """A map file: its picture, the keys of its YAML file besides `image`, and the reason if it must be refused.

    `note` is a part of the remark that it must cause.
    """

    picture: Callable[[Path], str]
    keys: str = f"resolution: 0.050000\n{SAVED}"
    note: str | None = None
    refused: str | None = None
    image: str = "image: {}\n"

    def write(self, folder):
        """Writes picture and YAML file."""
        path = folder / "m.yaml"
        path.write_text(self.image.format(self.picture(folder)) + self.keys)
        return path


def binary_pgm(most=255, *, head="P5\n10 8\n{}\n", tail=b""):
    """Writer of a P5 picture with a maximum."""

    def write(folder):
        scaled = np.floor(room() / 255.0 * most)
        content = head.format(most).encode() + scaled.astype("u1" if most < 256 else ">u2").tobytes() + tail
        (folder / "m.pgm").write_bytes(content)
        return "m.pgm"

    return write


def text_pgm(most=255, *, end="\n"):
    """Writer of a P2 picture with a maximum."""

    def write(folder):
        rows = (" ".join(str(int(value / 255 * most)) for value in row) for row in room())
        (folder / "m.pgm").write_text(f"P2\n# CREATOR: GIMP\n10 8\n{most}\n" + "\n".join(rows) + end)
        return "m.pgm"

    return write


def picture(name, pixels=lambda grey: grey):
    """Writer of a picture in any format of OpenCV."""

    def write(folder):
        cv2.imwrite(str(folder / name), pixels(room()))
        return name

    return write


def png(kind, depth, samples, **chunks):
    """Writer of a PNG of a colour type and depth that OpenCV does not write."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    def write(folder):
        values = samples(room())
        content = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 10, 8, depth, kind, 0, 0, 0))
        content += b"".join(chunk(name.encode(), data) for name, data in chunks.items())
        rows = b"".join(b"\0" + row.tobytes() for row in values)
        (folder / "m.png").write_bytes(content + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
        return "m.png"

    return write


def _palette(grey):
    return np.searchsorted([OCCUPIED, UNKNOWN, FREE], grey).astype(np.uint8)


def _two_bits(grey):
    indices = np.pad(_palette(grey), ((0, 0), (0, 2))).reshape(8, 3, 4)
    return (indices @ np.array([64, 16, 4, 1])).astype(np.uint8)


def _alpha(grey):
    hidden = grey == UNKNOWN
    return np.dstack([*[np.where(hidden, 128, grey)] * 3, np.where(hidden, 127, 255)]).astype(np.uint8)


def _percent(grey):
    return np.select([grey == OCCUPIED, grey == UNKNOWN], [100, 255], 0).astype(np.uint8)


PLTE: Final = bytes([0] * 3 + [UNKNOWN] * 3 + [FREE] * 3)
SCALE: Final = f"resolution: 0.05\nmode: scale\n{SAVED}"
FORMS: Final[Mapping[str, MapForm]] = {
    "map_saver of ROS 1": MapForm(binary_pgm(head="P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n10 8\n{}\n")),
    "map_saver_cli of ROS 2": MapForm(
        binary_pgm(), "mode: trinary\nresolution: 0.05\n" + SAVED.replace("0.196", "0.25"), note="free_thresh is 0.25"
    ),
    "slam_toolbox with a tiny origin": MapForm(
        binary_pgm(), "resolution: 5e-2\n" + SAVED.replace("[-1, -2, 0]", "[-1e-05, 3.5e-15, 0]")
    ),
    "absolute path of another computer": MapForm(
        binary_pgm(), image="image: /home/robot/maps/{}\n", note="m.pgm beside the file is read"
    ),
    "P5 with 100 greys": MapForm(binary_pgm(100)),
    "P5 with 65535 greys": MapForm(binary_pgm(65535)),
    "P5 with more bytes": MapForm(binary_pgm(tail=b"\n\0\0\0"), note="3 bytes"),
    "P5 cut off": MapForm(binary_pgm(head="P5\n10 9\n{}\n"), refused="10 x 9 pixels, 90 values, and it has 80"),
    "P2 without a last line end": MapForm(text_pgm(end="")),
    "P2 with 1000 greys and more text": MapForm(text_pgm(1000, end="\n# end\nx"), note="after the last pixel"),
    "BMP": MapForm(picture("m.bmp")),
    "grey PNG of 16 bits": MapForm(picture("m.png", lambda grey: grey.astype(np.uint16) * 257)),
    "colour PNG": MapForm(picture("m.png", lambda grey: np.dstack([grey] * 3))),
    "palette PNG": MapForm(png(3, 8, _palette, PLTE=PLTE)),
    "palette PNG of 2 bits": MapForm(png(3, 2, _two_bits, PLTE=PLTE)),
    "palette PNG with transparency": MapForm(png(3, 8, _palette, PLTE=PLTE, tRNS=bytes([255, 0]))),
    "grey PNG with a transparent grey": MapForm(png(0, 8, lambda grey: grey, tRNS=struct.pack(">H", UNKNOWN))),
    "scale mode with alpha": MapForm(picture("m.png", _alpha), SCALE),
    "mode in capitals": MapForm(picture("m.png", _alpha), SCALE.replace("scale", "Scale")),
    "raw mode": MapForm(picture("m.png", _percent), f"resolution: 0.05\nmode: raw\n{SAVED}"),
    "negated": MapForm(picture("m.pgm", lambda grey: 255 - grey), "resolution: 0.05\n" + SAVED.replace("e: 0", "e: 1")),
    "key trinary": MapForm(binary_pgm(), f"resolution: 0.05\ntrinary: true\n{SAVED}"),
    "key of another program": MapForm(binary_pgm(), f"resolution: 0.05\nframe_id: map\n{SAVED}", note="'frame_id'"),
    "resolution twice": MapForm(binary_pgm(), f"resolution: 0.05\n{SAVED}resolution: 0.5\n", refused="stands twice"),
    "origin in UTM": MapForm(
        binary_pgm(), "resolution: 0.05\n" + SAVED.replace("-1, -2", "448262.5, 5411932.8"), refused="origin"
    ),
    "yaw in degrees": MapForm(
        binary_pgm(), "resolution: 0.05\n" + SAVED.replace("2, 0]", "2, 90]"), refused="write 1.57 for 90 degrees"
    ),
    "thresholds in percent": MapForm(
        binary_pgm(), "resolution: 0.05\n" + SAVED.replace("0.65", "65"), refused="occupied_thresh: .*write 0.65"
    ),
    "resolution in centimetres": MapForm(
        binary_pgm(), f"resolution: 5\n{SAVED}", refused="resolution: .*0.05 for 5 cm"
    ),
}
