"""`errand dataset refine`: trains the refinement or classifier network on what the earlier stages find."""

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
from errand_train.detector.schedule import REFINEMENT_RATE, RefineOptions, Schedule
from errand_train.libraries import check_libraries
from executive.cli.number_options import quantity_option
from executive.cli.output import console_for
from skills.files.errors import InputError
from skills.perception.detector.model_files import MODEL_FILE
from skills.quantities import Count, Seed

__all__ = ["refine_command"]

DEFAULT_MINUTES: Final = 90.0


def refine_command(
    data: Annotated[Path, typer.Option(help="Folder of a data set that `errand dataset render` made.")],
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
    seed: Annotated[int, quantity_option(Seed, help="Seed of the first weights and of all random draws.")] = 1,
    rate: Annotated[float, quantity_option(LearningRate, help="The highest learning rate.")] = REFINEMENT_RATE,
    resume: Annotated[bool, typer.Option("--resume", help="Continue from the checkpoint in --out.")] = False,
    start: Annotated[
        Path | None,
        typer.Option(help="A checkpoint or an ONNX file of the same network; training starts from its weights."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Trains the refinement network, which takes crops of the proposals, or the classifier network, and exports it."""
    console = console_for(as_json)
    check_folders(data, out, resume)
    check_time(minutes, epochs)
    check_libraries(LIBRARIES)
    options = RefineOptions(
        data,
        out,
        budget_of(data, minutes, epochs, default_minutes=DEFAULT_MINUTES),
        model=_proposal_network(model),
        classifier=classifier,
        seed=seed,
        resume=resume,
        start=start,
        schedule=Schedule(rate),
    )
    file, figures = _refine(options, console)
    print_trained(console, file, figures, as_json=as_json)


def _proposal_network(model: Path | None) -> Path:
    """File of the proposal network. Raises InputError when it is missing."""
    file = model or MODEL_FILE
    if not file.is_file():
        raise InputError("there is no such file", hint="name a detector's ONNX file with --model", file=file)
    return file


def _refine(options: RefineOptions, console: Console) -> tuple[Path, dict[str, float]]:
    """Trains; returns the ONNX file and its figures. Raises InputError."""
    from errand_train.detector.refine import refine

    return with_progress(partial(refine, options), options.out, console)
