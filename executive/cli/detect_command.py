"""`errand detect`: what the detector sees in pictures."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console

from executive.app.pictures import detector_of, drawn, read_picture, write_picture
from executive.cli.number_options import quantity_option
from executive.cli.output import BAD_INPUT, console_for, finish, show_table
from skills.detection import Detection, Detector
from skills.files.errors import InputError
from skills.perception.detector.onnx_detector import DetectorOptions
from skills.quantities import Share

__all__ = ["detect"]

MOST_TOGETHER: Final = 8
MOST_PIXELS_TOGETHER: Final = 8_000_000


@dataclass(frozen=True)
class Looked:
    """What came of one file: what was found, its share of the time (ms), or why it could not be looked at."""

    file: Path
    found: tuple[Detection, ...] = ()
    ms: float = 0.0
    error: InputError | None = None

    def to_json(self) -> dict[str, Any]:
        """As JSON values; `error` only where there is one."""
        found = [
            {"class": one.class_name, "score": round(one.score, 4), "box": _rounded(one.box)} for one in self.found
        ]
        values: dict[str, Any] = {"file": str(self.file), "detections": found, "ms": round(self.ms, 3)}
        return values if self.error is None else {**values, "error": str(self.error)}


def detect(
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="Pictures: PNG, JPEG, WebP, TIFF, BMP.")],
    threshold: Annotated[float, quantity_option(Share, help="The least score that is reported.")] = 0.5,
    model: Annotated[Path | None, typer.Option(help="Another detector's file; else the one of Errand.")] = None,
    draw: Annotated[Path | None, typer.Option(help="A folder for the pictures with boxes drawn.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Find beer, coke, extinguishers, hammers, screwdrivers, wrenches, people, cylinders and cubes in pictures.

    A picture that cannot be read does not keep the others from being looked at; the exit status is 2 then.
    """
    detector = detector_of(model, DetectorOptions(threshold=threshold))
    names = _drawing_names(images, draw) if draw is not None else {}
    looked = [one for group in _groups(images) for one in _look(detector, group, names)]
    for one in looked:
        if one.error is not None:
            typer.echo(f"errand: {one.error}", err=True)
    if not as_json:
        _show(console_for(as_json), looked)
    good = all(one.error is None for one in looked)
    finish([one.to_json() for one in looked], as_json, good=good, otherwise=BAD_INPUT)


@dataclass(frozen=True)
class _Read:
    """A file, which is the k-th, and its picture, or why there is none."""

    k: int
    file: Path
    picture: NDArray[np.uint8] | None = None
    error: InputError | None = None


def _groups(images: Sequence[Path]) -> Iterator[list[_Read]]:
    """The files read, in groups that are looked at together: some pictures, or one that is very large."""
    group, pixels = list[_Read](), 0
    for k, file in enumerate(images):
        group.append(_read(k, file))
        picture = group[-1].picture
        pixels += 0 if picture is None else picture.shape[0] * picture.shape[1]
        if len(group) >= MOST_TOGETHER or pixels >= MOST_PIXELS_TOGETHER:
            yield group
            group, pixels = [], 0
    if group:
        yield group


def _read(k: int, file: Path) -> _Read:
    try:
        return _Read(k, file, read_picture(file))
    except InputError as error:
        return _Read(k, file, error=error)


def _look(detector: Detector, group: Sequence[_Read], drawings: Mapping[int, Path]) -> list[Looked]:
    """What is seen in each file, drawn where wished. Raises InputError when a drawing cannot be written."""
    pictures = [one.picture for one in group if one.picture is not None]
    begun = time.perf_counter()
    found = iter(detector.detect(pictures))
    ms = 1000.0 * (time.perf_counter() - begun) / max(1, len(pictures))
    looked = [
        Looked(one.file, error=one.error) if one.picture is None else Looked(one.file, next(found), ms) for one in group
    ]
    for read, seen in zip(group, looked, strict=True):
        if read.picture is not None and read.k in drawings:
            write_picture(drawings[read.k], drawn(read.picture, seen.found))
    return looked


def _drawing_names(images: Sequence[Path], folder: Path) -> dict[int, Path]:
    """Where each picture is drawn: under its own name, numbered where two have the same."""
    names = list[Path]()
    for image in images:
        stems = [image.stem, *(f"{image.stem}-{k}" for k in range(2, len(images) + 1))]
        names.append(next(folder / f"{stem}.png" for stem in stems if folder / f"{stem}.png" not in names))
    return dict(enumerate(names))


def _show(console: Console, looked: Sequence[Looked]) -> None:
    table = list[tuple[str, ...]]()
    for one in looked:
        values = [(d.class_name, f"{d.score:.2f}", ", ".join(f"{value:.0f}" for value in d.box)) for d in one.found]
        rows = values or [("cannot be read" if one.error else "nothing", "", "")]
        for k, row in enumerate(rows):
            table.append((str(one.file) if k == 0 else "", *row, f"{one.ms:.1f}" if k == 0 and not one.error else ""))
    show_table(console, ("picture", "class", "score", "box (u0, v0, u1, v1)", "ms"), table)


def _rounded(box: tuple[float, float, float, float]) -> list[float]:
    return [round(value, 2) for value in box]
