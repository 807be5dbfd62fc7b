"""`errand dataset train`: trains the proposal network of the detector on a data set."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from errand_train.commands.learning import (
    LIBRARIES,
    LearningRate,
    Minutes,
    budget_of,
    check_folders,
    check_time,
    print_trained,
    with_progress,
)
from errand_train.detector.schedule import HIGHEST_RATE, REFINING_RATE, Schedule, TrainOptions
from errand_train.libraries import check_libraries
from executive.cli.number_options import quantity_option
from executive.cli.output import console_for
from skills.quantities import Count, Seed

__all__ = ["train_command"]

DEFAULT_MINUTES: Final = 240.0


def train_command(
    data: Annotated[Path, typer.Option(help="Folder of a data set that `errand dataset render` made.")],
    out: Annotated[Path, typer.Option(help="Folder for checkpoints, figures and the ONNX file.")],
    minutes: Annotated[
        float | None, quantity_option(Minutes, help="Minutes to train; 240 by default.", show_default=False)
    ] = None,
    epochs: Annotated[int | None, quantity_option(Count, help="Instead of --minutes: passes over the data.")] = None,
    seed: Annotated[int, quantity_option(Seed, help="Seed of the first weights and of all random draws.")] = 1,
    rate: Annotated[
        float | None,
        quantity_option(
            LearningRate,
            help=f"The highest learning rate; {HIGHEST_RATE} by default, {REFINING_RATE} with --start.",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue from the checkpoint in --out.")] = False,
    start: Annotated[
        Path | None,
        typer.Option(help="A checkpoint or a detector's ONNX file; training starts from its weights."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Trains the proposal network and exports it as ONNX; writes checkpoints and figures on the way."""
    console = console_for(as_json)
    check_folders(data, out, resume)
    check_time(minutes, epochs)
    check_libraries(LIBRARIES)
    options = TrainOptions(
        data,
        out,
        budget_of(data, minutes, epochs, default_minutes=DEFAULT_MINUTES),
        seed=seed,
        resume=resume,
        start=start,
        schedule=Schedule.refining(rate or REFINING_RATE) if start else Schedule(rate or HIGHEST_RATE),
    )
    model, figures = _train(options, console)
    print_trained(console, model, figures, as_json=as_json)


def _train(options: TrainOptions, console: Console) -> tuple[Path, dict[str, float]]:
    """Trains; returns the ONNX file and its figures. Raises InputError."""
    from errand_train.detector.train import train

    return with_progress(partial(train, options), options.out, console)
