"""`errand world` builds worlds from maps, changes them, and draws worlds."""

from __future__ import annotations

import math
from collections.abc import Callable
from os.path import relpath
from pathlib import Path
from typing import Annotated, Final

import typer

from errand_make.worlds.wanted import Addition, Wanted
from executive.app.prepare.worlds import knowledge_of, open_world, refuse_unusable, unsayable_names
from executive.cli.number_options import quantity_option
from executive.cli.options import START, StartCommand, start_pose
from executive.cli.output import console_for, new_folder, show_table
from plant.worlds.world import WorldError, known_worlds
from skills.api import ZoneKind
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError, count_text
from skills.inputs.outside import writing
from skills.inputs.yaml_source import read_yaml
from skills.quantities import Angle, Quantity, Share, Speed
from skills.robot import Pose2D

WallHeight = Annotated[float, Quantity(ge=1.3, le=10.0, unit="m")]
PixelLength = Annotated[float, Quantity(gt=0.0, le=10.0, unit="m")]
Out = Annotated[Path, typer.Option("--out", help="New folder for the world.")]

world = typer.Typer(name="world", help="Worlds from any map, and drawings of worlds.", rich_markup_mode=None)
zone = typer.Typer(name="zone", help="Zones of a world: keep-out, speed limit and so on.", rich_markup_mode=None)
world.add_typer(zone)
_WORLD: Final = typer.Argument(metavar="WORLD", help="Folder of the world.", show_default=False)
_ZONE: Final = typer.Argument(metavar="NAME", help="Name of the zone.", show_default=False)


@world.callback()
def _group() -> None:
    """Worlds from any map."""


@world.command("list")
def list_worlds(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder whose worlds are listed, too.", show_default=".")
    ] = Path(),
) -> None:
    """Lists the worlds that come with Errand, and those in a folder, with rooms and robots."""
    if not folder.is_dir():
        raise InputError("there is no such folder", hint="name the folder of your worlds", file=folder)
    own = sorted(str(file.parent) for file in folder.glob("*/world.dmd.yaml"))
    rows = []
    for name in (*known_worlds(), *own):
        try:
            rows.append(_facts_of(name))
        except InputError as error:
            typer.echo(f"errand: warning: {error}", err=True)
    show_table(console_for(as_json=False), ("world", "metres", "surfaces", "robots", "people", "rooms"), rows)


def _facts_of(name: str) -> tuple[str, ...]:
    """Facts of a world for a list: extents, rooms, number of surfaces, robots and people. Raises InputError."""
    opened = open_world(name)
    facts = knowledge_of(opened)
    across, along = (max(values) - min(values) for values in zip(*opened.corners, strict=True))
    robots = {facts.robot.name: "spot"} if facts.robots is None else {n: each.kind for n, each in facts.robots.items()}
    people = [rule.name for rule in opened.seed_rules.people]
    said = ", ".join(f"{robot} ({kind})" for robot, kind in robots.items())
    rooms = ", ".join(facts.places)
    return name, f"{across:.0f} x {along:.0f}", str(len(facts.surfaces)), said, ", ".join(people), rooms


@world.command(cls=StartCommand)
def from_map(
    map_file: Annotated[
        Path, typer.Argument(metavar="MAP.yaml", help="A map of ROS map_server, or a building of Open-RMF.")
    ],
    out: Out,
    start: START = None,
    wall_height: Annotated[float, quantity_option(WallHeight, help="Height of the walls, m.")] = 2.5,
    person: Annotated[str, typer.Option(help="Name of a person beside the robot's start; '' for nobody.")] = "Robin",
    dock: Annotated[bool, typer.Option(help="Whether the robot gets a dock, at a wall near its start.")] = True,
    level: Annotated[str | None, typer.Option(help="Level of a building; by default its first.")] = None,
    scale: Annotated[
        float | None, quantity_option(PixelLength, help="Length of a pixel of a building's drawing, m.")
    ] = None,
) -> None:
    """Builds a world from a map: walls, both grids, rooms and doors without names, a person and a dock.

    A building.yaml of Open-RMF's traffic editor gives doors, names and preferred lanes, too.
    """
    from errand_make.worlds.additions import add as add_to_world
    from errand_make.worlds.building import building_grid, building_plan, building_start, is_building, read_building
    from errand_make.worlds.own import Plan, found_plan, world_from_grid
    from errand_make.worlds.rooms import grid_of

    def warn(note: str) -> None:
        typer.echo(f"errand: warning: {map_file}: {note}", err=True)

    plan: Plan = found_plan
    pose, source = start_pose(start), read_yaml(map_file)
    if is_building(source):
        building = read_building(source, level=level, scale_m=scale)
        notes, grid, plan = building.notes, building_grid(building), building_plan(building, warn)
        pose = pose or building_start(building, grid)
    elif level is not None or scale is not None:
        raise InputError("--level and --scale are for a building of Open-RMF", hint="leave them out", file=map_file)
    else:
        read = load_grid_map(map_file)
        notes, grid = read.notes, grid_of(read)
    for each in notes:
        warn(each)
    _made(map_file, out, lambda folder: world_from_grid(folder, grid, start=pose, wall_height_m=wall_height, plan=plan))
    for what, name, wanted in ((Addition.DOCK, None, dock), (Addition.PERSON, person, bool(person))):
        try:
            if wanted:
                typer.echo(f"{out}: {add_to_world(out, Wanted(what, name or ''))}")
        except InputError as error:
            typer.echo(f"errand: warning: no {what.value}: {error}", err=True)


@world.command()
def add(
    what: Annotated[Addition, typer.Argument(help="room gives a found room its name; place names a pose.")],
    folder: Annotated[Path, typer.Argument(metavar="WORLD", help="Folder of the world.")],
    name: Annotated[
        str | None, typer.Argument(help="Name of the table, person, room or place; of an object, its class or model.")
    ] = None,
    room: Annotated[str | None, typer.Option("--in", help="The room; of 'room', its former name.")] = None,
    near: Annotated[str | None, typer.Option(metavar="PLACE", help="The place near which a person stands.")] = None,
    at: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y YAW", help="Middle (m) and direction of the front (rad)."),
    ] = None,
    size: Annotated[
        tuple[float, float, float] | None, typer.Option(metavar="W D H", help="Width, depth and height, m.")
    ] = None,
    surface: Annotated[str | None, typer.Option("--on", help="The surface on which the object lies.")] = None,
) -> None:
    """Adds furniture, an object, a person, a dock, the name of a room, or a named pose to a world of your own."""
    from errand_make.worlds.additions import add as add_to_world

    if name is None and what is not Addition.DOCK:
        raise InputError(f"a {what.value} needs a name", hint=f"write errand world add {what.value} {folder} NAME")
    if not all(map(math.isfinite, (*(at or ()), *(size or ())))):
        raise InputError("--at and --size are numbers", hint="write them in metres and radians")
    typer.echo(f"{folder}: {add_to_world(folder, Wanted(what, name or '', room, at, size, surface, near))}")
    _warn_of_names(folder)


def _warn_of_names(folder: Path | str) -> None:
    """Warns of names of a world that no sentence can say, or that mean two things."""
    changed = open_world(str(folder))
    for each in unsayable_names(changed, knowledge_of(changed)):
        typer.echo(f"errand: warning: {each}", err=True)


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
    from errand_make.worlds.zones import add_zone as add_to_world

    files = {key: relpath(file, folder) for key, file in (("mask", mask), ("info", info)) if file is not None}
    corners = None if polygon is None else _corners(polygon)
    limits = {"speed": speed, "share": share}
    facts = {"kind": kind.value, "place": place, "polygon": corners, **limits, **files, "direction": direction}
    typer.echo(f"{folder}: {add_to_world(folder, name, facts).words}")


def _corners(text: str) -> list[list[float]]:
    """Parses the corners of an outline. Raises InputError."""
    try:
        return [[float(number) for number in corner.split()] for corner in text.split(",")]
    except ValueError as error:
        raise InputError(f"--polygon {text[:60]}: no corners", hint='write --polygon "0 0, 2 0, 2 1.5"') from error


@zone.command("remove")
def remove_zone(folder: Annotated[Path, _WORLD], name: Annotated[str, _ZONE]) -> None:
    """Removes a zone from the knowledge of a world of your own."""
    from errand_make.worlds.zones import remove_zone as remove_from_world

    remove_from_world(folder, name)
    typer.echo(f"{folder}: no zone '{name}' any more")


@zone.command("list")
def list_zones(folder: Annotated[str, typer.Argument(metavar="WORLD", help="A world by name or folder.")]) -> None:
    """Lists the zones of a world."""
    zones = knowledge_of(open_world(folder)).known_zones()
    for each in zones:
        typer.echo(each.words)
    if not zones:
        typer.echo(f"{folder} has no zones", err=True)


@world.command(cls=StartCommand)
def from_cylinders(
    file: Annotated[Path, typer.Argument(metavar="FILE.json", help="Cylinders in the format of BARN worlds.")],
    out: Out,
    start: START = None,
) -> None:
    """Builds a world of upright cylinders from a JSON object: `cylinders` [[x, y, radius, height], ...] and `start`."""
    from errand_make.worlds.cylinders import read_cylinders
    from errand_make.worlds.own import world_from_cylinders

    read = read_cylinders(file)
    pose = start_pose(start) or (None if read.start is None else Pose2D(*read.start))
    around = [] if pose is None else [(pose.x_m, pose.y_m)]
    around += [] if read.goal is None else [read.goal]
    _made(file, out, lambda folder: world_from_cylinders(folder, read.cylinders, start=pose, around=around))


@world.command()
def show(
    folder: Annotated[str, typer.Argument(metavar="WORLD", help="A world by name or folder.")],
    out: Annotated[Path, typer.Option("--out", help="PNG file of the picture.")] = Path("world.png"),
    grid: Annotated[bool, typer.Option("--grid", help="Draw lines of coordinates each metre.")] = False,
    view: Annotated[
        bool, typer.Option("--view", help="Also write a page, in which a click gives a pose and the command for it.")
    ] = False,
) -> None:
    """Draws the plan of a world with coordinates: rooms, doors, walls, surfaces, zones, people, dock and start."""
    from errand_make.worlds.plan_picture import draw_world
    from plant.scene_pictures import save_png

    drawn = open_world(folder)
    facts = knowledge_of(drawn)
    picture = draw_world(drawn, facts, grid=grid)
    with writing(out):
        save_png(out, picture)
        if view:
            from errand_make.worlds.plan_page import plan_page

            page = out.with_suffix(".html")
            page.write_text(plan_page(drawn, folder, picture), encoding="utf-8")
            typer.echo(f"{page}: open it in a browser")
    refuse_unusable(drawn)
    counts = [(facts.rooms, "room"), (facts.doors, "door"), (facts.surfaces, "surface"), (facts.zones, "zone")]
    counts += [(facts.poses, "named pose")] if facts.poses else []
    typer.echo(f"{out}: {', '.join(count_text(len(each), noun) for each, noun in counts)}")


@world.command("check")
def check_world(folder: Annotated[str, typer.Argument(metavar="WORLD", help="A world by name or folder.")]) -> None:
    """Checks the files of a world: maps, models, knowledge, names, and that people and places are free."""
    from errand_make.worlds.additions import refuse_blocked_places

    checked = open_world(folder)
    _warn_of_names(folder)
    refuse_unusable(checked)
    refuse_blocked_places(checked)
    typer.echo(f"{folder}: can be used")


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
    rooms, doors = count_text(len(facts.rooms), "room"), count_text(len(facts.doors), "door")
    typer.echo(f"{out}: {rooms}, {doors}, start at {start} (m, rad)")
    _warn_of_names(out)
