"""`errand dataset train`: the detector is trained on a data set's pictures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console

from errand_train.commands.learning import LIBRARIES, budget_of, check_folders, check_time, print_trained, trained
from errand_train.detector.schedule import HIGHEST_RATE, REFINING_RATE, Schedule, TrainOptions
from errand_train.libraries import check_libraries
from executive.cli.number_options import LearningRate, Minutes, quantity_option
from executive.cli.output import console_for, refusals
from skills.quantities import Count, Seed

__all__ = ["train_command"]

UNLESS_SAID_MINUTES: Final = 240.0


def train_command(
    data: Annotated[Path, typer.Option(help="Folder of a data set that `errand dataset render` made.")],
    out: Annotated[Path, typer.Option(help="Folder for checkpoints, figures and the ONNX file.")],
    minutes: Annotated[
        float | None, quantity_option(Minutes, help="How long to train; four hours unless said.", show_default=False)
    ] = None,
    epochs: Annotated[int | None, quantity_option(Count, help="Instead: how often to see each picture.")] = None,
    seed: Annotated[int, quantity_option(Seed, help="Of the first weights and of all random draws.")] = 1,
    rate: Annotated[
        float | None,
        quantity_option(
            LearningRate,
            help=f"The highest learning rate; {HIGHEST_RATE} unless said, and {REFINING_RATE} with --start.",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the folder's checkpoint stands.")] = False,
    start: Annotated[
        Path | None,
        typer.Option(help="A checkpoint or a detector's ONNX file whose weights are taken over, and refined."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Train the detector and export it, with checkpoints and figures on the way."""
    console = console_for(as_json)
    with refusals():
        check_folders(data, out, resume)
        check_time(minutes, epochs)
        check_libraries(LIBRARIES)
        options = TrainOptions(
            data,
            out,
            budget_of(data, minutes, epochs, unless_said_minutes=UNLESS_SAID_MINUTES),
            seed=seed,
            resume=resume,
            start=start,
            schedule=Schedule.refining(rate or REFINING_RATE) if start else Schedule(rate or HIGHEST_RATE),
        )
        model, figures = _trained(options, console)
    print_trained(console, model, figures, as_json=as_json)


def _trained(options: TrainOptions, console: Console) -> tuple[Path, dict[str, float]]:
    """The ONNX file and its figures. Raises InputError."""
    from errand_train.detector.train import train

    return trained(partial(train, options), options.out, console)
