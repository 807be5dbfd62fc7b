"""`errand map`: the robot explores or follows a route, and builds its own map."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from executive.cli.number_options import quantity_option
from executive.cli.options import AS_JSON
from executive.cli.output import console_for, finish
from skills.quantities import LongDuration, Seed

map_group = typer.Typer(name="map", help="Maps that the robot builds itself.", rich_markup_mode=None)


@map_group.callback()
def _group() -> None:
    """Keeps `build` a command of the group, although it is the only one."""


@map_group.command()
def build(
    world: Annotated[str, typer.Option(help="World by name or folder.")],
    out: Annotated[Path, typer.Option("--out", help="The map's folder; an unfinished map in it is continued.")],
    seed: Annotated[int, quantity_option(Seed, help="Seed of the objects and of all noise.")] = 1,
    route: Annotated[
        Path | None,
        typer.Option(help="File of points x y (m) to drive to, from the start: one in each line, or a YAML list."),
    ] = None,
    most_s: Annotated[float, quantity_option(LongDuration, "--max-time", help="Time limit of the drive, s.")] = 7200.0,
    people: Annotated[
        bool, typer.Option(help="Whether the world's people are present; people who stand become part of the map.")
    ] = True,
    as_json: AS_JSON = False,
) -> None:
    """Explores a world, or follows a route, and saves both grids and the pose graph."""
    from errand_make.maps.map_drive import MapDrive, mapper_for, route_points
    from executive.app.prepare.worlds import open_world
    from executive.app.runs.signals import ended_by_signals
    from executive.app.runs.simulated import compile_first
    from executive.run.control import Control

    tell = partial(console_for(as_json).print, markup=False)
    opened = open_world(world) if people else open_world(world).without_people()
    points = None if route is None else route_points(route)
    mapper = mapper_for(opened, out)
    compile_first()
    drive = MapDrive(opened, seed, mapper, points, out, tell)
    with ended_by_signals((control := Control(pace=None)).cancel):
        ended = drive.run(most_s, lambda: control.poll().cancel is not None)
    result = drive.result()
    if ended is not None:
        tell(f"errand: the map is not complete: {ended}")
    tell(f"{result['map']}: {result['distance_m']} m driven, {result['loop_closures']} loops")
    finish(result, as_json, good=ended is None)
