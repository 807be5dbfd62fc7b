"""`errand dataset score`: evaluates the detector on labelled pictures."""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from errand_train.commands.score_report import scores_json, show_scores
from errand_train.commands.worst_sheet import Shown, contact_sheet
from errand_train.detector.scoring import BODY, BODY_CLASSES, by_camera, judge_picture, picture_errors, score
from errand_train.detector.scoring_labels import LabelledPicture, LabelledPictures, pictures_of_coco
from errand_train.libraries import check_libraries
from executive.app.report.pictures import open_detector, read_picture, write_picture
from executive.cli.number_options import quantity_option
from executive.cli.output import console_for, print_json
from skills.api import Detection, Detector
from skills.inputs.errors import InputError, count_text
from skills.inputs.outside import read_text
from skills.perception.detector.augmentation import AugmentedDetector
from skills.perception.detector.camera_images import rotate_180, rotate_boxes_180
from skills.perception.detector.onnx_detector import OnnxDetector
from skills.quantities import Count
from skills.robot import Picture

__all__ = ["score_command"]

LEAST_SCORE: Final = 0.01
USUAL_SCORE: Final = 0.5
TIMED_PICTURES: Final = 200
TOGETHER: Final = 8
WORST: Final = 20
_SHOWN: Final = 3
MOST_BYTES: Final = 2_000_000_000

Found = tuple[Detection, ...]


@dataclass(frozen=True)
class _Work:
    """Labelled pictures, their files, and the detector under evaluation, also with its usual threshold."""

    data: LabelledPictures
    pictures: tuple[LabelledPicture, ...]
    files: tuple[Path, ...]
    detector: Detector
    usual: Detector
    views: bool


def score_command(
    data: Annotated[Path, typer.Option(help="A COCO file; its pictures' names count from its folder.")],
    model: Annotated[Path | None, typer.Option(help="Another detector's file; else the one of Errand.")] = None,
    pictures: Annotated[Path | None, typer.Option(help="Another folder from which the names count.")] = None,
    limit: Annotated[int | None, quantity_option(Count, help="Only so many pictures, the first.")] = None,
    worst: Annotated[int | None, quantity_option(Count, help="How many of the worst pictures to name.")] = None,
    sheet: Annotated[Path | None, typer.Option(help="Draw the worst pictures, 20 unless said, into this PNG.")] = None,
    views: Annotated[
        bool, typer.Option("--views", help="With test-time augmentation, as the detect skill uses it.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Evaluates the detector on labelled pictures: COCO's average precision, precision, recalls, speed."""
    console = console_for(as_json)
    check_libraries(("pycocotools",), "scoring")
    drawing = _png(sheet)
    detectors = open_detector(model, LEAST_SCORE), open_detector(model, USUAL_SCORE)
    work = _work(data, pictures or data.parent, limit, detectors, views)
    found = _all_found(work, console)
    names = work.detector.class_names
    scores = {"all": score(work.pictures, found, names)}
    for camera, (shown, seen) in by_camera(work.pictures, found).items():
        scores[camera] = score(shown, seen, BODY_CLASSES if camera == BODY else names)
    speed = _pictures_per_second(work)
    order = _worst_first(work, found)[: worst or (WORST if drawing else 0)]
    if drawing is not None:
        write_picture(drawing, contact_sheet([_shown(work, found, k) for k in order]))
    named = [{"file": work.pictures[k].file, "error": round(_error(work, found, k), 3)} for k in order]
    if as_json:
        read = {"aliases": dict(work.data.aliases), "left_out": dict(work.data.left_out)}
        read |= {"outside": list(work.data.outside)} if work.data.outside else {}
        print_json({"data": str(data), **scores_json(scores, speed), **read, **({"worst": named} if named else {})})
    else:
        _show_categories(console, work.data)
        show_scores(console, scores, speed)
        for one in named:
            console.print(f"{one['error']:7.3f}  {one['file']}", markup=False)


def _show_categories(console: Console, data: LabelledPictures) -> None:
    """Prints which categories are read as another class, and which categories and labels are left out."""
    for name, ours in data.aliases.items():
        console.print(f"category '{name}' is read as {ours}", markup=False)
    for name, count in data.left_out.items():
        labels = "1 label" if count == 1 else f"{count} labels"
        console.print(f"category '{name}' is left out, with {labels}: the detector has no such class", markup=False)
    if outside := data.outside:
        shown = ", ".join(f"annotations[{k}]" for k in outside[:_SHOWN]) + ", ..." * (len(outside) > _SHOWN)
        what = f"{count_text(len(outside), 'label')} without an area in the picture left out: {shown}"
        console.print(what, markup=False, soft_wrap=True)


def _work(data: Path, folder: Path, limit: int | None, detectors: tuple[Detector, Detector], views: bool) -> _Work:
    """Reads the labels and checks that all pictures exist. Raises InputError."""
    detector, usual = detectors
    if views and not isinstance(detector, OnnxDetector):
        raise InputError("--views needs a cascade", hint="leave out --views, or name a cascade with --model")
    try:
        document = pictures_of_coco(_document(data), detector.class_names)
        labelled = document.pictures[:limit]
    except ValueError as error:
        hint = "correct it, or name another COCO file with --data"
        raise InputError(str(error), hint=hint, file=data) from error
    files = tuple(folder / picture.file for picture in labelled)
    missing = [file for file in files if not file.is_file()]
    if missing:
        what = f"{len(missing)} of {len(files)} pictures are not there"
        raise InputError(what, hint="name the folder from which their names count with --pictures", file=missing[0])
    if not files:
        raise InputError("it names no pictures", hint="name a COCO file with pictures with --data", file=data)
    return _Work(document, labelled, files, detector, usual, views)


def _document(data: Path) -> Any:
    """Parses a JSON file. Raises InputError for an unreadable file, and ValueError for invalid JSON."""
    try:
        return json.loads(read_text(data, most_bytes=MOST_BYTES, hint="name a COCO file with --data"))
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"it is no JSON ({error})") from error


def _all_found(work: _Work, console: Console) -> list[Found]:
    """Detects the objects in each picture, faint ones included."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    found = list[Found]()
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("pictures", total=len(work.files))
        for group in _groups(len(work.files)):
            found += _found(work, group)
            bar.update(task, completed=len(found))
    return found


def _found(work: _Work, group: range) -> list[Found]:
    """Detects the objects in some pictures; turns those that are upside down first, as the robot does."""
    taken, labelled = [_read(work, k) for k in group], [work.pictures[k] for k in group]
    turn = [one.is_upside_down for one in labelled]
    upright = [rotate_180(picture) if turned else picture for picture, turned in zip(taken, turn, strict=True)]
    seen = zip(_looked(work.detector, upright, work.views), taken, turn, strict=True)
    return [rotate_boxes_180(found, *picture.shape[1::-1]) if turned else found for found, picture, turned in seen]


def _looked(detector: Detector, pictures: Sequence[Picture], views: bool) -> list[Found]:
    """Detects the objects in some pictures."""
    if not (views and isinstance(detector, OnnxDetector)):
        return detector.detect(pictures)
    return [AugmentedDetector(detector).detect_in_views(picture) for picture in pictures]


def _groups(count: int) -> list[range]:
    """Numbers of the pictures of each batch."""
    return [range(k, min(k + TOGETHER, count)) for k in range(0, count, TOGETHER)]


def _read(work: _Work, k: int) -> Picture:
    """Reads a picture and checks that its size fits its labels. Raises InputError."""
    picture, expected = read_picture(work.files[k]), work.pictures[k].size_px
    size = picture.shape[1], picture.shape[0]
    if expected is not None and expected != size:
        what = f"it has {size[0]} x {size[1]} pixels, and its labels are for {expected[0]} x {expected[1]}"
        raise InputError(what, hint="label it as it is, or put back the picture that was labelled", file=work.files[k])
    return picture


def _pictures_per_second(work: _Work) -> float:
    """Speed from pictures in memory to final boxes at the usual threshold: one over the median time."""
    times_s = list[float]()
    for group in _groups(min(len(work.files), TIMED_PICTURES)):
        pictures = [_read(work, k) for k in group]
        begun = time.perf_counter()
        _looked(work.usual, pictures, work.views)
        times_s.append((time.perf_counter() - begun) / len(pictures))
    return 1.0 / statistics.median(times_s)


def _worst_first(work: _Work, found: Sequence[Found]) -> list[int]:
    return sorted(range(len(work.files)), key=lambda k: -_error(work, found, k))


def _error(work: _Work, found: Sequence[Found], k: int) -> float:
    return picture_errors(work.pictures[k], found[k], work.detector.class_names)


def _shown(work: _Work, found: Sequence[Found], k: int) -> Shown:
    judgement = judge_picture(work.pictures[k], found[k], work.detector.class_names)
    return Shown(work.pictures[k].file, _read(work, k), judgement)


def _png(sheet: Path | None) -> Path | None:
    """Checks the name of the sheet. Raises InputError unless it ends in .png."""
    if sheet is not None and sheet.suffix.lower() != ".png":
        raise InputError("the sheet is a PNG", hint=f"call it {sheet.with_suffix('.png').name}", file=sheet)
    return sheet
