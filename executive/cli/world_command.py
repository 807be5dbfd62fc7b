"""`errand world` builds worlds from maps, and draws worlds."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.cli.number_options import quantity_option
from executive.cli.options import START, StartCommand, start_pose
from executive.cli.output import new_folder
from executive.words.knowledge import Knowledge
from executive.words.outlines import inside
from executive.words.zone import ZoneFacts
from plant.worlds.world import World, WorldError
from skills.api import ZoneKind
from skills.estimate.grid_map import load_grid_map
from skills.inputs.errors import InputError, count_text, listing, suggestion
from skills.inputs.outside import read_text, writing
from skills.inputs.schema import first_error
from skills.quantities import Angle, Coordinate, Opening, Quantity, Share, Speed
from skills.robot import Pose2D

if TYPE_CHECKING:
    from plant.worlds.builder.rooms import Grid

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
    person: Annotated[str, typer.Option(help="Name of a person beside the robot's start; '' for nobody.")] = "Robin",
    dock: Annotated[bool, typer.Option(help="Whether the robot gets a dock, at a wall near its start.")] = True,
) -> None:
    """Builds a world from a map: walls, both grids, rooms and doors without names, a person and a dock."""
    from plant.worlds.builder.own import world_from_grid
    from plant.worlds.builder.rooms import FREE, OCCUPIED, UNKNOWN, Grid

    read = load_grid_map(map_file)
    for note in read.notes:
        typer.echo(f"errand: warning: {map_file}: {note}", err=True)
    cells = read.grey(free=FREE, unknown=UNKNOWN, occupied=OCCUPIED)
    grid, pose = Grid(cells, read.origin_m, read.resolution_m), start_pose(start)
    _made(map_file, out, lambda folder: world_from_grid(folder, grid, start=pose, wall_height_m=wall_height))
    for what, name, wanted in ((Addition.DOCK, None, dock), (Addition.PERSON, person, bool(person))):
        try:
            if wanted:
                add(what, out, name)
        except InputError as error:
            typer.echo(f"errand: warning: no {what.value}: {error}", err=True)


class Addition(StrEnum):
    """Parts that `errand world add` adds to a world."""

    TABLE = "table"
    DESK = "desk"
    SHELF = "shelf"
    OBJECT = "object"
    PERSON = "person"
    DOCK = "dock"
    ROOM = "room"


@world.command()
def add(
    what: Annotated[Addition, typer.Argument(help="room gives a found room its name.")],
    folder: Annotated[Path, typer.Argument(metavar="WORLD", help="Folder of the world.")],
    name: Annotated[
        str | None, typer.Argument(help="Name of the table, person or room; of an object, its class or model.")
    ] = None,
    room: Annotated[str | None, typer.Option("--in", help="The room; of 'room', its former name.")] = None,
    at: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y YAW", help="Middle (m) and direction of the front (rad); by default at a wall."),
    ] = None,
    size: Annotated[
        tuple[float, float, float] | None, typer.Option(metavar="W D H", help="Width, depth and height, m.")
    ] = None,
    surface: Annotated[str | None, typer.Option("--on", help="The surface on which the object lies.")] = None,
) -> None:
    """Adds furniture, an object, a person, a dock, or the name of a room to a world of your own."""
    site = _site(folder)
    if name is None and what is not Addition.DOCK:
        raise InputError(f"a {what.value} needs a name", hint=f"write errand world add {what.value} {folder} NAME")
    if not all(map(math.isfinite, (*(at or ()), *(size or ())))):
        raise InputError("--at and --size are numbers", hint="write them in metres and radians")
    with _restored(folder):
        said = _ADDED.get(what, _add_furniture)(site, _Wanted(what, name or "", room, at, size, surface))
    typer.echo(f"{folder}: {said}")


@dataclass(frozen=True)
class _Wanted:
    """Options of `errand world add`."""

    what: Addition
    name: str
    room: str | None
    at: tuple[float, float, float] | None
    size: tuple[float, float, float] | None
    surface: str | None


@dataclass(frozen=True)
class _Site:
    """World that gets an addition, with its folder."""

    folder: Path
    world: World

    @cached_property
    def facts(self) -> Knowledge:
        """Knowledge of the world."""
        return knowledge_of(self.world)

    @property
    def doors(self) -> list[tuple[float, float]]:
        """Middles of the doors, m."""
        return [door.at for door in self.facts.doors]

    def grid(self, name: str = "keepout") -> Grid:
        """Reads a grid of the robot's map."""
        from plant.worlds.builder.rooms import FREE, OCCUPIED, UNKNOWN, Grid

        read = load_grid_map(self.folder / "map" / f"{name}.yaml")
        return Grid(read.grey(free=FREE, unknown=UNKNOWN, occupied=OCCUPIED), read.origin_m, read.resolution_m)

    def room(self, said: str | None) -> str:
        """Returns the room of a name; without one, the room of the start. Raises InputError."""
        places, start = self.facts.places, (self.world.start.x_m, self.world.start.y_m)
        if said is None:
            return next((name for name, each in places.items() if inside(each.polygon, start)), next(iter(places), ""))
        if (found := self.facts.place(said)) in places:
            return str(found)
        raise InputError(f"there is no room '{said}'", hint=suggestion(said, places), file=self.folder)


def _add_furniture(site: _Site, wanted: _Wanted) -> str:
    """Adds a piece of furniture; returns a sentence. Raises WorldError."""
    from plant.worlds.builder.furnish import SIZES, Furniture, add_furniture, place_in, refusal
    from plant.worlds.builder.rooms import BANDS_M

    grid, facts = site.grid(), site.facts
    rooms = {name: Pose2D(each.pose.x, each.pose.y, each.pose.yaw) for name, each in facts.places.items()}
    room = site.room(wanted.room)
    pose = Pose2D(*(wanted.at or (0.0, 0.0, 0.0)))
    piece = Furniture(wanted.what.value, wanted.name, wanted.size or SIZES[wanted.what.value], pose)
    if not (min(piece.size) >= 0.3 and max(piece.size) <= 3.0 and piece.size[2] <= 1.2):
        raise WorldError("width and depth are 0.3 to 3 m, and the height is 0.3 to 1.2 m")
    if wanted.at is None:
        piece = place_in(site.world, grid, piece, facts.places[room].polygon, site.doors, rooms)
    elif (why := refusal(site.world, grid, piece, rooms)) is not None:
        raise WorldError(f"{wanted.name} cannot stand at ({pose.x_m:g}, {pose.y_m:g}, {pose.yaw_rad:g}): {why}")
    else:
        room = next((name for name, each in facts.places.items() if inside(each.polygon, (pose.x_m, pose.y_m))), room)
    grids = {name: site.grid(name) for name in BANDS_M if (site.folder / "map" / f"{name}.yaml").is_file()}
    add_furniture(site.folder, piece, room, grids)
    at = f"({piece.pose.x_m:.2f}, {piece.pose.y_m:.2f}, {piece.pose.yaw_rad:.2f})"
    return f"{wanted.name} in the {room} at {at}, {piece.size[2]:g} m high"


def _add_object(site: _Site, wanted: _Wanted) -> str:
    from plant.worlds.builder.furnish import add_object

    surfaces = site.facts.surfaces
    found = site.facts.place(wanted.surface or "")
    if found not in surfaces:
        what = f"there is no surface '{wanted.surface}'" if wanted.surface else "an object lies on a surface"
        raise InputError(what, hint=f"name it by --on: {listing(surfaces)}" if surfaces else "add a table first")
    add_object(site.folder, wanted.name, wanted.name, str(found))
    return f"{wanted.name} on the {found}"


def _add_person(site: _Site, wanted: _Wanted) -> str:
    from plant.worlds.builder.furnish import add_person

    if wanted.room is not None or wanted.at is not None:
        raise InputError("a person stands beside the robot's start", hint="leave --in and --at out")
    add_person(site.folder, site.world, site.grid(), wanted.name, site.room(None))
    return f"{wanted.name} stands beside the robot's start"


def _add_dock(site: _Site, wanted: _Wanted) -> str:
    from plant.worlds.builder.furnish import add_dock, dock_pose

    pose = Pose2D(*wanted.at) if wanted.at else dock_pose(site.world, site.grid(), site.doors)
    add_dock(site.folder, pose)
    return f"a dock at ({pose.x_m:.2f}, {pose.y_m:.2f}, {pose.yaw_rad:.2f})"


def _name_room(site: _Site, wanted: _Wanted) -> str:
    from plant.worlds.builder.furnish import with_room_name

    if wanted.room is None:
        raise InputError("the former name is missing", hint=f"name it by --in: {listing(site.facts.places)}")
    if site.facts.place(wanted.name) is not None:
        raise InputError(f"there is a '{wanted.name}' already", hint="choose another name", file=site.folder)
    former, file = site.room(wanted.room), site.folder / "knowledge.yaml"
    file.write_text(with_room_name(file, former, wanted.name), encoding="utf-8")
    return f"{former} is now {wanted.name}"


_ADDED: Final[Mapping[Addition, Callable[[_Site, _Wanted], str]]] = {
    Addition.OBJECT: _add_object,
    Addition.PERSON: _add_person,
    Addition.DOCK: _add_dock,
    Addition.ROOM: _name_room,
}
"""Additions other than furniture."""


@contextmanager
def _restored(folder: Path) -> Iterator[None]:
    """Restores the text files of a world if the block raises, or leaves a world that cannot be opened."""
    kept = {file: file.read_bytes() for pattern in ("*.yaml", "map/*") for file in folder.glob(pattern)}
    try:
        yield
        knowledge_of(open_world(str(folder)))
    except BaseException as error:
        for file in {*folder.glob("*.yaml")} - kept.keys():
            file.unlink()
        for file, data in kept.items():
            file.write_bytes(data)
        if isinstance(error, WorldError):
            raise InputError(str(error), hint="see `errand world show`", file=folder) from error
        raise


zone = typer.Typer(name="zone", help="Zones of a world: keep-out, speed limit and so on.", rich_markup_mode=None)
world.add_typer(zone)
_WORLD: Final = typer.Argument(metavar="WORLD", help="Folder of the world.", show_default=False)
_ZONE: Final = typer.Argument(metavar="NAME", help="Name of the zone.", show_default=False)


@zone.command("add")
def add_zone(
    folder: Annotated[Path, _WORLD],
    name: Annotated[str, _ZONE],
    kind: Annotated[ZoneKind, typer.Option(help="What holds in it.")],
    place: Annotated[str | None, typer.Option("--in", metavar="ROOM", help="The room that it covers.")] = None,
    polygon: Annotated[
        str | None, typer.Option(metavar='"X Y, X Y, X Y"', help="Its outline: three or more corners, m.")
    ] = None,
    mask: Annotated[
        Path | None, typer.Option(help="YAML file of a Nav2 filter mask, in the folder of the world.")
    ] = None,
    info: Annotated[
        Path | None, typer.Option(help="Nav2 parameters that say what the values of the mask mean.")
    ] = None,
    speed: Annotated[float | None, quantity_option(Speed, help="Speed limit, m/s.")] = None,
    share: Annotated[float | None, quantity_option(Share, help="Speed limit as a share of full speed.")] = None,
    direction: Annotated[float | None, quantity_option(Angle, help="Direction of a one-way zone, rad.")] = None,
) -> None:
    """Adds a zone to the knowledge of a world of your own: a room, an outline, or a filter mask of Nav2."""
    from plant.worlds.builder.furnish import with_entry

    site = _site(folder)
    room = None if place is None else site.room(place)
    files = {key: relpath(file, folder) for key, file in (("mask", mask), ("info", info)) if file is not None}
    given = {"place": room, "polygon": None if polygon is None else _corners(polygon), "speed": speed, "share": share}
    values = {**given, **files, "direction": direction}
    facts = {"kind": kind.value, **{key: value for key, value in values.items() if value is not None}}
    try:
        ZoneFacts.model_validate(facts)
    except ValidationError as error:
        where, what, _ = first_error(error.errors())
        hint = "see `errand world zone add --help`"
        raise InputError(": ".join((*map(str, where), what)), hint=hint) from error
    file = folder / "knowledge.yaml"
    with _restored(folder):
        file.write_text(with_entry(file, "zones", name, facts), encoding="utf-8")
    (made,) = (each for each in knowledge_of(open_world(str(folder))).known_zones() if each.name == name)
    typer.echo(f"{folder}: {made.words}")


def _corners(text: str) -> list[list[float]]:
    """Parses the corners of an outline. Raises InputError."""
    try:
        return [[float(number) for number in corner.split()] for corner in text.split(",")]
    except ValueError as error:
        raise InputError(f"--polygon {text[:60]}: no corners", hint='write --polygon "0 0, 2 0, 2 1.5"') from error


@zone.command("remove")
def remove_zone(folder: Annotated[Path, _WORLD], name: Annotated[str, _ZONE]) -> None:
    """Removes a zone from the knowledge of a world of your own."""
    from plant.worlds.builder.furnish import without_entry

    site = _site(folder)
    if name not in (zones := site.facts.zones):
        hint = suggestion(name, zones) if zones else "it has no zones"
        raise InputError(f"there is no zone '{name}'", hint=hint, file=folder)
    file = folder / "knowledge.yaml"
    with _restored(folder):
        file.write_text(without_entry(file, "zones", name), encoding="utf-8")
    typer.echo(f"{folder}: no zone '{name}' any more")


@zone.command("list")
def list_zones(folder: Annotated[str, typer.Argument(metavar="WORLD", help="A world by name or folder.")]) -> None:
    """Lists the zones of a world."""
    zones = knowledge_of(open_world(folder)).known_zones()
    for each in zones:
        typer.echo(each.words)
    if not zones:
        typer.echo(f"{folder} has no zones", err=True)


def _site(folder: Path) -> _Site:
    """Opens the world of a folder. Raises InputError."""
    if not folder.is_dir():
        raise InputError("there is no such folder", hint="`errand world from-map` makes a world", file=folder)
    return _Site(folder, open_world(str(folder)))


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
    from skills.navigate.zone_map import zone_messages

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
        zones=zone_messages(facts.known_zones()),
    )
    with writing(out):
        save_png(out, picture)
    counts = ((facts.places, "room"), (facts.doors, "door"), (facts.surfaces, "surface"), (facts.zones, "zone"))
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
