"""Checks of options and a progress bar for the commands that train a network."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from errand_train.detector.labels import TrainingDataError, read_split
from errand_train.detector.schedule import Budget, Report
from executive.cli.output import print_json
from skills.files.errors import InputError
from skills.quantities import Quantity

__all__ = [
    "LIBRARIES",
    "LearningRate",
    "Minutes",
    "budget_of",
    "check_folders",
    "check_time",
    "print_trained",
    "with_progress",
]

LearningRate = Annotated[float, Quantity(ge=1e-6, le=0.1)]
Minutes = Annotated[float, Quantity(ge=0.01, le=100_000.0, unit="min")]

LIBRARIES: Final = ("torch", "onnx", "pycocotools")
RENDER: Final = "make one: errand dataset render --out DIR --images 8000"


def check_folders(data: Path, out: Path, resume: bool) -> None:
    """Raises InputError for a folder without a data set, and for one with a training unless `resume`."""
    for name in ("train.json", "val.json"):
        if not (data / name).is_file():
            raise InputError(f"{data / name}: the data set has no such file", hint=RENDER)
    if (out / "checkpoint.pt").exists() and not resume:
        raise InputError(f"{out}: there is a training already", hint="continue it with --resume, or name another --out")


def check_time(minutes: float | None, epochs: int | None) -> None:
    """Raises InputError when both limits are given."""
    if minutes is not None and epochs is not None:
        raise InputError("--minutes and --epochs are both given", hint="give one of them")


def budget_of(data: Path, minutes: float | None, epochs: int | None, *, default_minutes: float) -> Budget:
    """Length of the training. Raises InputError for a broken data set."""
    if epochs is None:
        return Budget(seconds=60.0 * (default_minutes if minutes is None else minutes))
    try:
        return Budget(pictures=epochs * len(read_split(data, "train")))
    except TrainingDataError as error:
        raise InputError(error.message, hint=error.hint) from error


def with_progress(
    work: Callable[[Callable[[Report], None]], Path], out: Path, console: Console
) -> tuple[Path, dict[str, float]]:
    """Runs a training with a progress bar; returns its ONNX file and last figures. Raises InputError."""
    figures = dict[str, float]()
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task("training", total=1.0)

        def show(report: Report) -> None:
            new_percent = int(100 * report.progress) > int(100 * bar.tasks[task].completed)
            bar.update(task, completed=report.progress, description=_progress_text(report))
            if new_percent and not console.is_terminal:
                console.print(f"{report.progress:4.0%}  step {report.steps}, {_progress_text(report)}")
            if report.figures is not None:
                figures.update(report.figures)
                console.print(f"{report.progress:4.0%}  {_line(report.figures)}")

        try:
            return work(show), figures
        except TrainingDataError as error:
            raise InputError(error.message, hint=error.hint) from error
        except OSError as error:
            raise InputError(f"{out}: cannot be written ({error})", hint="name another folder, or make room") from error


def print_trained(console: Console, model: Path, figures: dict[str, float], *, as_json: bool) -> None:
    """Prints the name of the written file and its figures."""
    console.print(f"{model}: {_line(figures)}")
    if as_json:
        print_json({"model": str(model), "figures": figures})


def _progress_text(report: Report) -> str:
    scores, boxes = report.losses
    return f"training, {report.pictures_per_s:.0f}/s, losses {scores:.2f} {boxes:.2f}"


def _line(figures: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in figures.items())
