"""Reads and writes picture files, loads the detector for them, and draws its detections."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from skills.detection import Detection, Detector, PictureDetectorComponent, with_defaults
from skills.inputs.errors import InputError
from skills.inputs.picture_files import read_pixels
from skills.robot import Picture
from skills.stack import components, default_component

Colour = tuple[int, int, int]

FOUND_COLOUR: Final = (40, 200, 60)
_LINE_PER_PX: Final = 1 / 320


def open_detector(file: Path | None, threshold: float) -> Detector:
    """Loads the detector of an ONNX or stack file, or the shipped one. Raises InputError if it cannot be used."""
    if file is None:
        component = default_component("detector")
    elif file.suffix in (".yaml", ".yml"):
        from executive.mission.load import load_stack  # loads Drake

        component = load_stack(file).detector
    else:
        component = components("detector").get("onnx", type(default_component("detector")))(file)
    if isinstance(component, PictureDetectorComponent):
        return component.build_for_pictures(threshold)
    return with_defaults(component.build())


def draw_detections(picture: Picture, found: Sequence[Detection]) -> Picture:
    """Returns a copy of a picture (H, W, 3) RGB with the boxes of detections, the highest score on top."""
    copy = picture.copy()
    for one in reversed(found):
        draw_box(copy, one.box, f"{one.class_name} {one.score:.2f}", FOUND_COLOUR)
    return copy


def draw_box(picture: Picture, box: tuple[float, float, float, float], text: str, colour: Colour) -> None:
    """Draws a box with its name above it, or inside it at the upper edge of the picture."""
    u0, v0, u1, v1 = (round(value) for value in box)
    line = max(1, round(max(picture.shape[:2]) * _LINE_PER_PX))
    size = 0.4 * line
    cv2.rectangle(picture, (u0, v0), (u1, v1), colour, line)
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size / 2 + 0.25, line)
    top = v0 - height - 2 * line if v0 - height - 2 * line >= 0 else v0
    left = max(0, min(u0, picture.shape[1] - width))
    cv2.rectangle(picture, (left, top), (left + width, top + height + 2 * line), colour, cv2.FILLED)
    place = (left, top + height + line)
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, size / 2 + 0.25, (0, 0, 0), line, cv2.LINE_AA)


def read_picture(file: Path) -> Picture:
    """Reads a picture file as (H, W, 3) RGB uint8; converts grey and 16-bit pictures, and drops transparency.

    Raises InputError if the file cannot be read, is damaged or has too many pixels.
    """
    if file.is_dir():
        raise InputError("it is a folder", hint=f"name the pictures in it, such as {file}/*.png", file=file)
    return np.asarray(read_pixels(file, flags=cv2.IMREAD_COLOR_RGB), dtype=np.uint8)


def write_picture(file: Path, picture: Picture) -> None:
    """Writes (H, W, 3) RGB in the format of the file's ending. Raises InputError if it cannot be written."""
    encoded, content = cv2.imencode(file.suffix, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.tobytes() if encoded else b"")
    except OSError as error:
        hint = "name a folder in which files can be written"
        raise InputError(f"cannot write it ({error.strerror})", hint=hint, file=file) from error
