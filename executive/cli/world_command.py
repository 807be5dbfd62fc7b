"""`errand world` builds worlds from maps, and draws worlds."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import typer
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from executive.app.worlds import knowledge_of, open_world
from executive.cli.number_options import quantity_option
from executive.cli.options import START, StartCommand, start_pose
from executive.cli.output import new_folder, writing
from plant.worlds.world import WorldError
from skills.estimate.grid_map import load_grid_map
from skills.files.errors import InputError, count_text
from skills.files.outside import read_text
from skills.files.schema import first_error
from skills.quantities import Angle, Coordinate, Opening, Quantity
from skills.robot import Pose2D

MAX_BYTES: Final = 20_000_000
WallHeight = Annotated[float, Quantity(ge=1.3, le=10.0, unit="m")]
Out = Annotated[Path, typer.Option("--out", help="New folder for the world.")]

world = typer.Typer(name="world", help="Worlds from any map, and drawings of worlds.", rich_markup_mode=None)


class _Cylinders(BaseModel):
    """File of cylinders: x, y, radius and height of each; start (x, y, yaw) and goal (x, y). In metres and radians."""

    model_config = ConfigDict(allow_inf_nan=False)

    cylinders: tuple[tuple[Coordinate, Coordinate, Opening, Opening], ...] = Field(min_length=1, max_length=20_000)
    start: tuple[Coordinate, Coordinate, Angle] | None = None
    goal: tuple[Coordinate, Coordinate] | None = None


@world.callback()
def _group() -> None:
    """Worlds from any map."""


@world.command(cls=StartCommand)
def from_map(
    map_file: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="A map in the format of ROS map_server.")],
    out: Out,
    start: START = None,
    wall_height: Annotated[float, quantity_option(WallHeight, help="Height of the walls, m.")] = 2.5,
) -> None:
    """Builds a world from a map: walls, both grids, and rooms and doors without names."""
    from plant.worlds.builder.own import world_from_grid
    from plant.worlds.builder.rooms import FREE, OCCUPIED, UNKNOWN, Grid

    read = load_grid_map(map_file)
    for note in read.notes:
        typer.echo(f"errand: warning: {map_file}: {note}", err=True)
    cells = read.grey(free=FREE, unknown=UNKNOWN, occupied=OCCUPIED)
    grid, pose = Grid(cells, read.origin_m, read.resolution_m), start_pose(start)
    _made(map_file, out, lambda folder: world_from_grid(folder, grid, start=pose, wall_height_m=wall_height))


@world.command(cls=StartCommand)
def from_cylinders(
    file: Annotated[Path, typer.Argument(metavar="FILE.json", help="Cylinders in the format of BARN worlds.")],
    out: Out,
    start: START = None,
) -> None:
    """Builds a world of upright cylinders from a JSON object: `cylinders` [[x, y, radius, height], ...] and `start`."""
    from plant.worlds.builder.own import world_from_cylinders

    read = _cylinders(file)
    pose = start_pose(start) or (None if read.start is None else Pose2D(*read.start))
    around = [] if pose is None else [(pose.x_m, pose.y_m)]
    around += [] if read.goal is None else [read.goal]
    _made(file, out, lambda folder: world_from_cylinders(folder, read.cylinders, start=pose, around=around))


@world.command()
def show(
    folder: Annotated[str, typer.Argument(metavar="WORLD", help="A world by name or folder.")],
    out: Annotated[Path, typer.Option("--out", help="PNG file of the picture.")] = Path("world.png"),
) -> None:
    """Draws the plan of a world: rooms, doors, walls, surfaces and the start."""
    from plant.scene_pictures import draw_world, save_png

    drawn = open_world(folder)
    facts = knowledge_of(drawn)
    grid = load_grid_map(drawn.surveyed.keepout_map_path)
    picture = draw_world(
        drawn,
        grid.grey(free=255, unknown=150, occupied=0),
        grid.origin_m,
        grid.resolution_m,
        labels={name: (place.pose.x, place.pose.y) for name, place in facts.places.items()},
        doors=[(door.at, door.width) for door in facts.doors],
    )
    with writing(out):
        save_png(out, picture)
    counts = ((facts.places, "room"), (facts.doors, "door"), (facts.surfaces, "surface"))
    typer.echo(f"{out}: {', '.join(count_text(len(each), noun) for each, noun in counts)}")


def _cylinders(path: Path) -> _Cylinders:
    """Reads a file of cylinders. Raises InputError."""
    text = read_text(path, most_bytes=MAX_BYTES, hint="check the path")
    try:
        return TypeAdapter(_Cylinders).validate_python(json.loads(text))
    except json.JSONDecodeError as error:
        raise InputError(f"damaged JSON, {error.msg}", hint="correct it there", file=path, line=error.lineno) from error
    except ValidationError as error:
        where, what, hint = first_error(error.errors())
        form = "it must have 'cylinders': [[x, y, radius, height], ...]"
        raise InputError(f"{'.'.join(map(str, where)) or 'it'}: {what}; {hint}", hint=form, file=path) from error
    except (ValueError, RecursionError) as error:
        what = "it is nested too deep" if isinstance(error, RecursionError) else "a number in it is too long"
        raise InputError(what, hint="correct it", file=path) from error


def _made(source: Path, out: Path, make: Callable[[Path], None]) -> None:
    """Builds a world, loads it again, and prints its facts. Raises InputError."""
    try:
        with new_folder(out) as folder:
            make(folder)
    except WorldError as error:
        raise InputError(str(error), file=source) from error
    made = open_world(str(out))
    facts = knowledge_of(made)
    start = f"{made.start.x_m:.2f} {made.start.y_m:.2f} {made.start.yaw_rad:.2f}"
    rooms, doors = count_text(len(facts.places), "room"), count_text(len(facts.doors), "door")
    typer.echo(f"{out}: {rooms}, {doors}, start at {start} (m, rad)")
