"""`errand ros2 bag` converts the log of a run to a ROS 2 bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from executive.cli.output import new_folder
from executive.record.history import History, read_history

_FILE_SUFFIX: Final = ".mcap"

ros2 = typer.Typer(name="ros2", help="Logs as ROS 2 bags.", no_args_is_help=True, rich_markup_mode=None)


@ros2.callback()
def _group() -> None:
    """Logs as ROS 2 bags."""


@ros2.command()
def bag(
    file: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run, or its log.mcap.", show_default=False)],
    out: Annotated[Path, typer.Option("-o", "--out", help="New folder for the bag, or its file *.mcap.")],
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Only this one of several robots.")] = None,
) -> None:
    """Writes a ROS 2 bag: map, transforms, scans, joint states, poses, paths and pictures."""
    history = read_history(file)
    history = history if robot is None else history.of_robot(robot)
    typer.echo(f"{_write(history, out)} messages in {out}", err=True)


def _write(history: History, out: Path) -> int:
    """Writes a bag, or one file; returns the number of messages."""
    from errand_ros2.bag import write_bag, write_bag_file

    if out.suffix == _FILE_SUFFIX:
        return write_bag_file(history.events, out)
    with new_folder(out) as folder:
        return write_bag(history.events, folder, out.resolve().name)
