"""`errand detect` finds objects in picture files."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console

from executive.app.report.pictures import draw_detections, open_detector, read_picture, write_picture
from executive.cli.number_options import quantity_option
from executive.cli.output import BAD_INPUT, console_for, finish, progress_bar, show_table
from skills.detection import Detection, Detector
from skills.inputs.errors import InputError
from skills.quantities import Share
from skills.robot import Picture

MOST_TOGETHER: Final = 8
MOST_PIXELS_TOGETHER: Final = 8_000_000


@dataclass(frozen=True)
class PictureResult:
    """Result for a picture file: detections and time (ms), or the error that prevented reading it."""

    file: Path
    drawing: Path | None
    picture: Picture | None = None
    found: tuple[Detection, ...] = ()
    ms: float = 0.0
    error: InputError | None = None

    def to_json(self) -> dict[str, Any]:
        """Returns JSON values; the key `error` is there only if the picture could not be read."""
        found = [
            {"class": one.class_name, "score": round(one.score, 4), "box": [round(value, 2) for value in one.box]}
            for one in self.found
        ]
        values: dict[str, Any] = {"file": str(self.file), "detections": found, "ms": round(self.ms, 3)}
        return values if self.error is None else {**values, "error": str(self.error)}


def detect(
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="Pictures: PNG, JPEG, WebP, TIFF, BMP.")],
    threshold: Annotated[float, quantity_option(Share, help="Least score of a reported detection.")] = 0.5,
    model: Annotated[Path | None, typer.Option(help="ONNX file of another detector, or a stack file.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder for the pictures with boxes.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Finds beer, coke, extinguishers, hammers, screwdrivers, wrenches, people, cylinders and cubes in pictures.

    Another tool's ONNX file finds what it knows. If a picture cannot be read, the others are, and the exit status is 2.
    """
    detector = open_detector(model, threshold)
    names: Sequence[Path | None] = [None] * len(images) if out is None else _drawing_names(images, out)
    results = list[PictureResult]()
    with progress_bar(console_for(as_json), "pictures", len(images)) as advance:
        for group in _groups(zip(images, names, strict=True)):
            for one in _detect(detector, group):
                results.append(one)
                advance()
    for one in results:
        if one.error is not None:
            typer.echo(f"errand: {one.error}", err=True)
    if not as_json:
        if detector.about:
            console_for(as_json).print(f"detector: {detector.about}", markup=False)
        _show(console_for(as_json), results)
    good = all(one.error is None for one in results)
    finish([one.to_json() for one in results], as_json, good=good, otherwise=BAD_INPUT)


def _groups(files: Iterable[tuple[Path, Path | None]]) -> Iterator[list[PictureResult]]:
    """Reads the files, and yields them in batches: several pictures, or a single very large one."""
    group, pixels = list[PictureResult](), 0
    for file, drawing in files:
        try:
            picture = read_picture(file)
            pixels += picture.shape[0] * picture.shape[1]
            group.append(PictureResult(file, drawing, picture))
        except InputError as error:
            group.append(PictureResult(file, drawing, error=error))
        if len(group) >= MOST_TOGETHER or pixels >= MOST_PIXELS_TOGETHER:
            yield group
            group, pixels = [], 0
    if group:
        yield group


def _detect(detector: Detector, group: Sequence[PictureResult]) -> Iterator[PictureResult]:
    """Detects objects in a batch, and writes drawings. Raises InputError if a drawing cannot be written."""
    pictures = [one.picture for one in group if one.picture is not None]
    begun = time.perf_counter()
    found = iter(detector.detect(pictures))
    ms = 1000.0 * (time.perf_counter() - begun) / max(1, len(pictures))
    for one in group:
        if one.picture is None:
            yield one
            continue
        seen = next(found)
        if one.drawing is not None:
            write_picture(one.drawing, draw_detections(one.picture, seen))
        yield replace(one, picture=None, found=seen, ms=ms)


def _drawing_names(images: Sequence[Path], folder: Path) -> Sequence[Path]:
    """Returns a file for each picture's drawing, named like the picture; equal names get numbers."""
    names = list[Path]()
    for image in images:
        stems = [image.stem, *(f"{image.stem}-{k}" for k in range(2, len(images) + 1))]
        names.append(next(folder / f"{stem}.png" for stem in stems if folder / f"{stem}.png" not in names))
    return names


def _show(console: Console, results: Sequence[PictureResult]) -> None:
    """Prints a table of the detections."""
    table = list[tuple[str, ...]]()
    for one in results:
        values = [(d.class_name, f"{d.score:.2f}", ", ".join(f"{value:.0f}" for value in d.box)) for d in one.found]
        rows = values or [("cannot be read" if one.error else "nothing", "", "")]
        for k, row in enumerate(rows):
            table.append((str(one.file) if k == 0 else "", *row, f"{one.ms:.1f}" if k == 0 and not one.error else ""))
    show_table(console, ("picture", "class", "score", "box (u0, v0, u1, v1)", "ms"), table)
