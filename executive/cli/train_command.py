"""`errand dataset train`: the detector learns from a data set's pictures."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from executive.cli.output import console_for, print_json, refusals
from executive.errors import InputError
from skills.detect.training.labels import TrainingDataError, read_split
from skills.detect.training.options import TrainOptions
from skills.detect.training.schedule import HIGHEST_RATE, REFINING_RATE, Budget, Schedule

if TYPE_CHECKING:
    from skills.detect.training.train import Report

__all__ = ["train_command"]

NEEDED: Final = ("torch", "onnx")
RENDER: Final = "make one: errand dataset render --out DIR --images 8000"
UNLESS_SAID_MINUTES: Final = 240.0


def train_command(
    data: Annotated[Path, typer.Option(help="Folder of a data set that `errand dataset render` made.")],
    out: Annotated[Path, typer.Option(help="Folder for checkpoints, curves and the ONNX file.")],
    minutes: Annotated[
        float | None, typer.Option(min=0.01, help="How long to learn; four hours unless said.", show_default=False)
    ] = None,
    epochs: Annotated[int | None, typer.Option(min=1, help="Instead: how often to see each picture.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the first weights and of all that is drawn by chance.")] = 1,
    rate: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            max=0.1,
            help=f"The highest learning rate; {HIGHEST_RATE} unless said, and {REFINING_RATE} with --start.",
            show_default=False,
        ),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="How many processes; all cores unless said.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the folder's checkpoint stands.")] = False,
    start: Annotated[
        Path | None,
        typer.Option(help="A checkpoint or a detector's ONNX file whose weights are taken over, and refined."),
    ] = None,
    keep_early: Annotated[
        bool, typer.Option("--keep-early", help="Leave the first layers as they are: more steps in the same time.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Train the detector and export it, with checkpoints and curves on the way."""
    console = console_for(as_json)
    with refusals():
        _check_folders(data, out, resume)
        _check_time(minutes, epochs)
        _check_libraries()
        options = TrainOptions(
            data,
            out,
            _budget(data, minutes, epochs),
            seed=seed,
            processes=jobs or os.cpu_count() or 1,
            resume=resume,
            start=start,
            keep_early=keep_early,
            schedule=Schedule.refining(rate or REFINING_RATE) if start else Schedule(rate or HIGHEST_RATE),
        )
        model, figures = _trained(options, console)
    console.print(f"{model}: {_line(figures)}")
    if as_json:
        print_json({"model": str(model), "figures": figures})


def _check_folders(data: Path, out: Path, resume: bool) -> None:
    """Raises InputError."""
    for name in ("train.json", "val.json"):
        if not (data / name).is_file():
            raise InputError(f"{data / name}: there is no such file of a data set", mend=RENDER)
    if (out / "checkpoint.pt").exists() and not resume:
        raise InputError(f"{out}: holds a training already", mend="go on with it by --resume, or name another --out")


def _check_time(minutes: float | None, epochs: int | None) -> None:
    """Raises InputError."""
    if minutes is not None and epochs is not None:
        raise InputError("--minutes and --epochs are both given", mend="give one of them")


def _check_libraries() -> None:
    """Raises InputError."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(f"training needs {' and '.join(missing)}", mend="pip install '.[train]'")


def _trained(options: TrainOptions, console: Console) -> tuple[Path, dict[str, float]]:
    """The ONNX file and its figures. Raises InputError."""
    from skills.detect.training.train import train

    figures = dict[str, float]()
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task("learning", total=1.0)

        def told(report: Report) -> None:
            new_percent = int(100 * report.progress) > int(100 * bar.tasks[task].completed)
            bar.update(task, completed=report.progress, description=_told(report))
            if new_percent and not console.is_terminal:
                console.print(f"{report.progress:4.0%}  step {report.steps}, {_told(report)}")
            if report.figures is not None:
                figures.update(report.figures)
                console.print(f"{report.progress:4.0%}  {_line(report.figures)}")

        try:
            return train(options, told), figures
        except TrainingDataError as error:
            raise InputError(error.message, mend=error.mend) from error
        except OSError as error:
            raise InputError(
                f"{options.out}: cannot be written ({error})", mend="name another folder, or make room"
            ) from error


def _budget(data: Path, minutes: float | None, epochs: int | None) -> Budget:
    """Raises InputError."""
    if epochs is None:
        return Budget(seconds=60.0 * (UNLESS_SAID_MINUTES if minutes is None else minutes))
    try:
        return Budget(pictures=epochs * len(read_split(data, "train")))
    except TrainingDataError as error:
        raise InputError(error.message, mend=error.mend) from error


def _told(report: Report) -> str:
    scores, boxes = report.losses
    return f"learning, {report.pictures_per_s:.0f}/s, losses {scores:.2f} {boxes:.2f}"


def _line(figures: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in figures.items())
