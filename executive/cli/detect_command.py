"""`errand detect`: what the detector sees in pictures."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from executive.cli.detector_choice import detector_of, drawn
from executive.cli.output import BAD_INPUT, console_for, print_json, refusals
from executive.cli.picture_files import read_picture, write_picture
from executive.errors import InputError
from skills.detect.onnx_detector import DetectorOptions
from skills.detection import Detection, Detector

__all__ = ["detect"]


@dataclass(frozen=True)
class Looked:
    """What came of one file: what was found and in how many ms, or why it could not be looked at."""

    file: Path
    found: tuple[Detection, ...] = ()
    ms: float = 0.0
    error: InputError | None = None

    def to_json(self) -> dict[str, Any]:
        """As JSON values; `error` only where there is one."""
        found = [
            {"class": one.class_name, "score": round(one.score, 4), "box": _rounded(one.box)} for one in self.found
        ]
        told: dict[str, Any] = {"file": str(self.file), "detections": found, "ms": round(self.ms, 3)}
        return told if self.error is None else {**told, "error": str(self.error)}


def detect(
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="Pictures: PNG, JPEG, WebP, TIFF, BMP.")],
    threshold: Annotated[float, typer.Option(min=0.0, max=1.0, help="The least score that is told.")] = 0.5,
    model: Annotated[Path | None, typer.Option(help="Another detector's file; else the one of Errand.")] = None,
    draw: Annotated[Path | None, typer.Option(help="A folder for the pictures with boxes drawn.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Find beer, coke, extinguishers, hammers, screwdrivers, wrenches, people, cylinders and cubes in pictures.

    A picture that cannot be read does not keep the others from being looked at; the exit status is 2 then.
    """
    with refusals():
        detector = detector_of(model, DetectorOptions(threshold=threshold))
        names = _drawing_names(images, draw)
        looked = [_look(detector, image, name) for image, name in zip(images, names, strict=True)]
    for one in looked:
        if one.error is not None:
            typer.echo(f"errand: {one.error}", err=True)
    if as_json:
        print_json([one.to_json() for one in looked])
    else:
        _show(console_for(as_json), looked)
    if any(one.error is not None for one in looked):
        raise typer.Exit(BAD_INPUT)


def _look(detector: Detector, file: Path, drawing: Path | None) -> Looked:
    """What is seen in a file, drawn where wished. Raises InputError when the drawing cannot be written."""
    try:
        picture = read_picture(file)
    except InputError as error:
        return Looked(file, error=error)
    begun = time.perf_counter()
    (found,) = detector.detect([picture])
    ms = 1000.0 * (time.perf_counter() - begun)
    if drawing is not None:
        write_picture(drawing, drawn(picture, found))
    return Looked(file, found, ms)


def _drawing_names(images: Sequence[Path], folder: Path | None) -> list[Path | None]:
    """Where each picture is drawn: under its own name, numbered where two have the same."""
    if folder is None:
        return [None] * len(images)
    names = list[Path | None]()
    for image in images:
        stems = [image.stem, *(f"{image.stem}-{k}" for k in range(2, len(images) + 1))]
        names.append(next(folder / f"{stem}.png" for stem in stems if folder / f"{stem}.png" not in names))
    return names


def _show(console: Console, looked: Sequence[Looked]) -> None:
    table = Table("picture", "class", "score", "box (u0, v0, u1, v1)", "ms")
    for one in looked:
        told = [(d.class_name, f"{d.score:.2f}", ", ".join(f"{value:.0f}" for value in d.box)) for d in one.found]
        rows = told or [("cannot be read" if one.error else "nothing", "", "")]
        for k, row in enumerate(rows):
            table.add_row(str(one.file) if k == 0 else "", *row, f"{one.ms:.1f}" if k == 0 and not one.error else "")
    console.print(table, markup=False)


def _rounded(box: tuple[float, float, float, float]) -> list[float]:
    return [round(value, 2) for value in box]
