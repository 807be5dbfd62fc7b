"""`errand dataset train` and `errand dataset refine`: train the networks of the detector on a data set."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from errand_train.detector.labels import TrainingDataError, read_split
from errand_train.detector.schedule import (
    HIGHEST_RATE,
    REFINEMENT_RATE,
    REFINING_RATE,
    Budget,
    RefineOptions,
    Report,
    Schedule,
    TrainOptions,
)
from errand_train.libraries import check_libraries
from executive.cli.number_options import quantity_option
from executive.cli.output import console_for, print_json
from skills.inputs.errors import InputError
from skills.perception.detector.model_files import MODEL_FILE
from skills.quantities import Count, Quantity, Seed

__all__ = ["refine_command", "train_command"]

LIBRARIES: Final = ("torch", "onnx", "pycocotools")
RENDER: Final = "make one: errand dataset render --out DIR --images 8000"
TRAIN_MINUTES: Final = 240.0
REFINE_MINUTES: Final = 90.0

LearningRate = Annotated[float, Quantity(ge=1e-6, le=0.1)]
Minutes = Annotated[float, Quantity(ge=0.01, le=100_000.0, unit="min")]
DataFolder = Annotated[Path, typer.Option(help="Folder of a data set that `errand dataset render` made.")]
DrawSeed = Annotated[int, quantity_option(Seed, help="Seed of the first weights and of all random draws.")]
Resume = Annotated[bool, typer.Option("--resume", help="Continue from the checkpoint in --out.")]
AsJson = Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")]


def train_command(
    data: DataFolder,
    out: Annotated[Path, typer.Option(help="Folder for checkpoints, figures and the ONNX file.")],
    minutes: Annotated[
        float | None, quantity_option(Minutes, help="Minutes to train; 240 by default.", show_default=False)
    ] = None,
    epochs: Annotated[int | None, quantity_option(Count, help="Instead of --minutes: passes over the data.")] = None,
    seed: DrawSeed = 1,
    rate: Annotated[
        float | None,
        quantity_option(
            LearningRate,
            help=f"The highest learning rate; {HIGHEST_RATE} by default, {REFINING_RATE} with --start.",
            show_default=False,
        ),
    ] = None,
    resume: Resume = False,
    start: Annotated[
        Path | None,
        typer.Option(help="A checkpoint or a detector's ONNX file; training starts from its weights."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Trains the proposal network and exports it as ONNX; writes checkpoints and figures on the way."""
    console = console_for(as_json)
    options = TrainOptions(
        data,
        out,
        _checked_budget(data, out, minutes, epochs, resume=resume, default_minutes=TRAIN_MINUTES),
        seed=seed,
        resume=resume,
        start=start,
        schedule=Schedule.refining(rate or REFINING_RATE) if start else Schedule(rate or HIGHEST_RATE),
    )
    from errand_train.detector.train import train  # needs torch

    _print_trained(console, *_with_progress(partial(train, options), out, console), as_json=as_json)


def refine_command(
    data: DataFolder,
    out: Annotated[Path, typer.Option(help="Folder for checkpoints, figures and the ONNX files.")],
    model: Annotated[
        Path | None, typer.Option(help="The proposal network's file; Errand's own by default.", show_default=False)
    ] = None,
    classifier: Annotated[
        bool,
        typer.Option("--classifier", help="Train the classifier network, which takes the refinement network's boxes."),
    ] = False,
    minutes: Annotated[
        float | None,
        quantity_option(Minutes, help="Minutes to train; 90 by default.", show_default=False),
    ] = None,
    epochs: Annotated[int | None, quantity_option(Count, help="Instead of --minutes: crops for each picture.")] = None,
    seed: DrawSeed = 1,
    rate: Annotated[float, quantity_option(LearningRate, help="The highest learning rate.")] = REFINEMENT_RATE,
    resume: Resume = False,
    start: Annotated[
        Path | None,
        typer.Option(help="A checkpoint or an ONNX file of the same network; training starts from its weights."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Trains the refinement network, which takes crops of the proposals, or the classifier network, and exports it."""
    console = console_for(as_json)
    options = RefineOptions(
        data,
        out,
        _checked_budget(data, out, minutes, epochs, resume=resume, default_minutes=REFINE_MINUTES),
        model=_proposal_network(model),
        classifier=classifier,
        seed=seed,
        resume=resume,
        start=start,
        schedule=Schedule(rate),
    )
    from errand_train.detector.refine import refine  # needs torch

    _print_trained(console, *_with_progress(partial(refine, options), out, console), as_json=as_json)


def _proposal_network(model: Path | None) -> Path:
    """File of the proposal network. Raises InputError when it is missing."""
    file = model or MODEL_FILE
    if not file.is_file():
        raise InputError("there is no such file", hint="name a detector's ONNX file with --model", file=file)
    return file


def _checked_budget(
    data: Path, out: Path, minutes: float | None, epochs: int | None, *, resume: bool, default_minutes: float
) -> Budget:
    """Length of a training, after checks of folders, limits and libraries. Raises InputError."""
    for name in ("train.json", "val.json"):
        if not (data / name).is_file():
            raise InputError(f"{data / name}: the data set has no such file", hint=RENDER)
    if (out / "checkpoint.pt").exists() and not resume:
        raise InputError(f"{out}: there is a training already", hint="continue it with --resume, or name another --out")
    if minutes is not None and epochs is not None:
        raise InputError("--minutes and --epochs are both given", hint="give one of them")
    check_libraries(LIBRARIES)
    if epochs is None:
        return Budget(seconds=60.0 * (default_minutes if minutes is None else minutes))
    try:
        return Budget(pictures=epochs * len(read_split(data, "train")))
    except TrainingDataError as error:
        raise InputError(error.message, hint=error.hint) from error


def _with_progress(
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


def _print_trained(console: Console, model: Path, figures: dict[str, float], *, as_json: bool) -> None:
    """Prints the name of the written file and its figures."""
    console.print(f"{model}: {_line(figures)}")
    if as_json:
        print_json({"model": str(model), "figures": figures})


def _progress_text(report: Report) -> str:
    scores, boxes = report.losses
    return f"training, {report.pictures_per_s:.0f}/s, losses {scores:.2f} {boxes:.2f}"


def _line(figures: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in figures.items())
