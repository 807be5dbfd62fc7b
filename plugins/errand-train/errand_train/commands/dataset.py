"""`errand dataset`: renders pictures with labels, trains the detector on them, and scores it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from errand_train.commands.learning import refine_command, train_command
from errand_train.commands.score import score_command
from errand_train.dataset.errors import DatasetError
from executive.app.evaluate.workers import Pool, Workers
from executive.cli.number_options import quantity_option
from executive.cli.output import console_for, print_json, show_table
from skills.inputs.errors import InputError
from skills.quantities import Count, Quantity, Seed

if TYPE_CHECKING:
    from errand_train.dataset.shards import Summary

__all__ = ["dataset"]

dataset = typer.Typer(
    name="dataset",
    help="Labelled pictures and the training of the detector.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@dataset.callback()
def _group() -> None:
    """Labelled pictures and the training of the detector."""


dataset.command(name="score")(score_command)
dataset.command(name="train")(train_command)
dataset.command(name="refine")(refine_command)


@dataset.command(name="render")
def render_command(
    out: Annotated[Path, typer.Option(help="Folder for the data set; one that was begun is continued.")],
    images: Annotated[int, quantity_option(Pictures, help="How many pictures.")],
    seed: Annotated[int, quantity_option(Seed, help="The same seed gives the same pictures.")] = 1,
    others: Annotated[
        Path | None, typer.Option(help="Folder of object models without a class; distractors of the training rooms.")
    ] = None,
    jobs: Annotated[int | None, quantity_option(Count, help="Processes; one for each core by default.")] = None,
    workers: Annotated[int | None, quantity_option(Count, help="A local Dask cluster of so many workers.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="The scheduler of a Dask cluster.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="The last line of standard output is the result.")] = False,
) -> None:
    """Renders pictures of objects in random rooms, with boxes and masks as COCO files."""
    console = console_for(as_json)
    began = time.monotonic()
    pool = Pool(jobs or os.cpu_count() or 1, workers, scheduler)
    summary = _render(out, images, seed, others, pool, console)
    _show(console, out, summary, time.monotonic() - began)
    if as_json:
        print_json({"out": str(out), **asdict(summary)})


Pictures = Annotated[int, Quantity(ge=1, le=10_000_000)]


def _render(out: Path, images: int, seed: int, others: Path | None, pool: Pool, console: Console) -> Summary:
    from errand_train.dataset.shards import render

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("scenes", total=None)

        def show(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        try:
            with pool.opened() as workers:
                give_out = partial(_give_out, workers)
                return render(out, images=images, seed=seed, progress=show, give_out=give_out, others=others)
        except DatasetError as error:
            raise InputError(error.message, hint=error.hint) from error


def _give_out(
    workers: Workers, function: Callable[[int], Mapping[str, bytes]], numbers: list[int]
) -> Iterator[tuple[int, Mapping[str, bytes] | None]]:
    """Distributes calls as `errand_train.dataset.shards.GiveOut` says."""
    for finished in workers.map_items(function, numbers):
        yield finished.item, finished.result


def _show(console: Console, out: Path, summary: Summary, seconds: float) -> None:
    names = next(iter(summary.labels.values()))
    rows = [(name, *(str(found[name]) for found in summary.labels.values())) for name in names]
    rows.append(("pictures", *map(str, summary.images.values())))
    show_table(console, ("class", *summary.images), rows)
    console.print(
        f"{out}: {sum(summary.images.values())} pictures, {summary.empty_images} of them without an object, "
        f"{summary.ignored} ignored labels; {seconds:.0f} s"
    )
