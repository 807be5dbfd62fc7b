"""Additions to a world of the user's own: furniture, objects, a person, a dock, names of rooms, and named poses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from errand_make.worlds import furnish
from errand_make.worlds.rooms import BANDS_M, body_margin_m, clearance_m, grid_of
from errand_make.worlds.site import Site, restored
from errand_make.worlds.wanted import Addition, Wanted
from executive.app.prepare.worlds import knowledge_of, open_world, refuse_unusable
from plant.models.catalogue import load_catalogue, read_imported
from plant.worlds.world import World, WorldError
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError, listing, nearest_name, suggestion
from skills.inputs.yaml_source import read_yaml
from skills.robot import Pose2D


def add(folder: Path, wanted: Wanted) -> str:
    """Adds a part to the world of a folder; returns a sentence on it.

    Raises InputError when it cannot be added, and leaves the files of the world unchanged.
    """
    site = Site.open(folder)
    with restored(folder):
        said = _ADDED.get(wanted.what, _add_furniture)(site, wanted)
        if wanted.what is Addition.PERSON or wanted.what not in _ADDED:
            refuse_unusable(open_world(str(folder)))
    return said


def _add_furniture(site: Site, wanted: Wanted) -> str:
    """Adds a piece of furniture; returns a sentence. Raises WorldError."""
    grid, facts = site.grid(), site.facts
    rooms, room = site.room_poses, site.room(wanted.room)
    pose = Pose2D(*(wanted.at or (0.0, 0.0, 0.0)))
    piece = furnish.Furniture(wanted.what.value, wanted.name, wanted.size or furnish.SIZES[wanted.what.value], pose)
    if not (min(piece.size) >= 0.3 and max(piece.size) <= 3.0 and piece.size[2] <= 1.2):
        raise WorldError("width and depth are 0.3 to 3 m, and the height is 0.3 to 1.2 m")
    if wanted.at is None:
        piece = furnish.place_in(site.world, grid, piece, facts.rooms[room], site.doors, rooms)
    elif (why := furnish.refusal(site.world, grid, piece, rooms)) is not None:
        raise WorldError(f"{wanted.name} cannot stand at ({pose.x_m:g}, {pose.y_m:g}, {pose.yaw_rad:g}): {why}")
    else:
        room = site.room_at((pose.x_m, pose.y_m)) or room
    grids = {name: site.grid(name) for name in BANDS_M if (site.folder / "map" / f"{name}.yaml").is_file()}
    furnish.add_furniture(site.folder, piece, room, grids)
    at = f"({piece.pose.x_m:.2f}, {piece.pose.y_m:.2f}, {piece.pose.yaw_rad:.2f})"
    return f"{wanted.name} in the {room} at {at}, {piece.size[2]:g} m high"


def _add_object(site: Site, wanted: Wanted) -> str:
    surfaces = site.facts.surfaces
    found = site.facts.place(wanted.surface or "")
    if found not in surfaces:
        what = f"there is no surface '{wanted.surface}'" if wanted.surface else "an object lies on a surface"
        raise InputError(what, hint=f"name it by --on: {listing(surfaces)}" if surfaces else "add a table first")
    thing, folder = _model(site, wanted.name)
    own = furnish.add_object(site.folder, site.world, wanted.name, str(found), thing=thing, model=folder)
    return f"{wanted.name} on the {found}" + ("" if own == wanted.name else f", as '{own}'")


def _model(site: Site, name: str) -> tuple[str, Path | None]:
    """Returns the class of a model, and the folder of one that the world does not import yet. Raises InputError."""
    if name in site.world.imports or name in load_catalogue():
        imported = site.world.imports.get(name)
        return (name if imported is None else imported.object.class_name), None
    found: dict[str, Path] = {}
    for beside in (site.folder, site.folder.resolve().parent, Path.cwd()):
        for folder in sorted(each for each in beside.iterdir() if each.is_dir()):
            with suppress(InputError):
                found.setdefault(read_imported(folder).name, folder)
    if name not in found:
        models = (*load_catalogue(), *site.world.imports, *found)
        near = nearest_name(name, models)
        meant = "" if near is None else f"did you mean '{near}'? "
        hint = f"{meant}there are {listing(dict.fromkeys(models))}; `errand object import` makes others"
        raise InputError(f"there is no model '{name}'", hint=hint)
    return read_imported(found[name]).class_name, found[name]


def _add_person(site: Site, wanted: Wanted) -> str:
    """Adds a person: at a pose, in a room, near a place, or else before the robot's start."""
    world, grid, name, facts = site.world, site.grid(), wanted.name, site.facts
    near = None if wanted.near is None else facts.place(wanted.near)
    if wanted.near is not None and near is None:
        hint = suggestion(wanted.near, facts.place_names())
        raise InputError(f"there is no place '{wanted.near}'", hint=hint, file=site.folder)
    if [wanted.room, wanted.near, wanted.at].count(None) < 2:
        raise InputError("--in, --near and --at each say where the person stands", hint="give one of them")
    if wanted.at is None and wanted.room is None and near is None:
        before = furnish.person_before_start(world, grid)
        if before is not None:
            furnish.add_person(site.folder, name, site.room(None), before)
            return f"{name} stands beside the robot's start"
    pose = Pose2D(*(wanted.at or (0.0, 0.0, 0.0)))
    piece = furnish.Furniture(furnish.PERSON, name, furnish.PERSON_SIZE, pose)
    surfaces = ((each, enumerate(surface.viewpoints)) for each, surface in facts.surfaces.items())
    views = {f"{each} {number}": view.pose_2d() for each, seen in surfaces for number, view in seen}
    kept = {**site.room_poses, **views}
    if wanted.at is None:
        room = facts.room(near) if near is not None else site.room(wanted.room)
        about = facts.place_pose(near or room) if near or wanted.room else facts.start
        spot = (about.x, about.y)
        piece = furnish.place_person(world, grid, name, facts.rooms[room], site.doors, kept, spot)
    elif (why := furnish.refusal(world, grid, piece, kept)) is not None:
        raise WorldError(f"{name} cannot stand at ({pose.x_m:g}, {pose.y_m:g}, {pose.yaw_rad:g}): {why}")
    x, y, yaw = piece.pose.x_m, piece.pose.y_m, piece.pose.yaw_rad
    room = site.room_at((x, y))
    furnish.add_person(site.folder, name, room, {"pose": {"x": x, "y": y, "yaw": yaw}})
    return f"{name} stands in the {room} at ({x:.2f}, {y:.2f}, {yaw:.2f})"


def _add_dock(site: Site, wanted: Wanted) -> str:
    pose = Pose2D(*wanted.at) if wanted.at else furnish.dock_pose(site.world, site.grid(), site.doors)
    furnish.add_dock(site.folder, pose)
    return f"a dock at ({pose.x_m:.2f}, {pose.y_m:.2f}, {pose.yaw_rad:.2f})"


def _name_room(site: Site, wanted: Wanted) -> str:
    if wanted.room is None:
        raise InputError("the former name is missing", hint=f"name it by --in: {listing(site.facts.rooms)}")
    if site.facts.place(wanted.name) is not None:
        raise InputError(f"there is a '{wanted.name}' already", hint="choose another name", file=site.folder)
    former, file = site.room(wanted.room), site.folder / "knowledge.yaml"
    file.write_text(furnish.with_room_name(file, former, wanted.name), encoding="utf-8")
    return f"{former} is now {wanted.name}"


def _add_place(site: Site, wanted: Wanted) -> str:
    if wanted.at is None:
        raise InputError("a named pose needs its pose", hint=f"write --at X Y YAW after {wanted.name}")
    if site.facts.place(wanted.name) is not None:
        raise InputError(f"there is a '{wanted.name}' already", hint="choose another name", file=site.folder)
    file, pose = site.folder / "knowledge.yaml", dict(zip(("x", "y", "yaw"), wanted.at, strict=True))
    file.write_text(furnish.with_entry(file, "places", wanted.name, {"pose": pose}), encoding="utf-8")
    x, y, yaw = wanted.at
    knowledge_of(open_world(str(site.folder)))
    refuse_blocked_places(open_world(str(site.folder)), [wanted.name])
    return f"{wanted.name} at ({x:.2f}, {y:.2f}, {yaw:.2f})"


def refuse_blocked_places(world: World, names: Collection[str] | None = None) -> None:
    """Raises InputError for the first place, or the first of `names`, where the robot's body has no space on the map.

    People who stand at a pose of their own take space, too.
    """
    if not world.keepout_map_path.is_file():
        return
    facts, source = knowledge_of(world), read_yaml(world.knowledge_path)
    grid, hint = grid_of(load_grid_map(world.keepout_map_path)), "give a free pose; `errand world show` draws the world"
    stands = {rule.name: rule.stands for rule in world.seed_rules.people if rule.route is None}
    people = [(name, Pose2D(spot.x, spot.y, spot.yaw)) for name, spots in stands.items() for spot in spots]
    bodies = [(name, furnish.Furniture(furnish.PERSON, name, furnish.PERSON_SIZE, at)) for name, at in people]
    grids = [(f"touches {name}", furnish.with_furniture(grid, each, BANDS_M["keepout"])) for name, each in bodies]
    tried = [(what, each, clearance_m(each)) for what, each in (("stands in an obstacle", grid), *grids)]
    for place in facts.places if names is None else names:
        pose = facts.place_pose(place).pose_2d()
        at = f"places.{place}: at ({pose.x_m:g}, {pose.y_m:g}, {pose.yaw_rad:g}) the robot's body"
        blocked = next((what for what, each, clear in tried if body_margin_m(each, clear, pose) <= 0.0), None)
        if blocked is not None:
            raise source.error(("places", place), f"{at} {blocked}", hint)


_ADDED: Final[Mapping[Addition, Callable[[Site, Wanted], str]]] = {
    Addition.OBJECT: _add_object,
    Addition.PERSON: _add_person,
    Addition.DOCK: _add_dock,
    Addition.ROOM: _name_room,
    Addition.PLACE: _add_place,
}
"""Additions other than furniture."""
