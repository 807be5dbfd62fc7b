"""Loads a world: a folder with directives, knowledge, maps, and rules for placing objects by the seed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import BaseModel, ConfigDict, Field, model_validator

from executive.words.knowledge import Knowledge
from executive.words.mission import Route, Stop
from plant.models.catalogue import ImportedObject, load_catalogue, read_imported
from plant.models.person_figure import Clothes, Gesture, Spot
from plant.worlds.geometry_files import check_directives, check_model
from skills.inputs.errors import InputError, nearest_name, suggestion
from skills.inputs.outside import is_file
from skills.inputs.plugins import WORLDS, installed_plugins, package_folder
from skills.inputs.schema import validate
from skills.inputs.yaml_source import KeyPath, read_yaml
from skills.robot import Pose2D, quantities

if TYPE_CHECKING:
    from pydrake.multibody.parsing import PackageMap

WORLDS_FOLDER = Path(__file__).resolve().parent
PACKAGE_NAME = "errand"
DIRECTIVES: Final = "world.dmd.yaml"
ROBOTS: Final = "map"  # folder of the grids that robots use
TRUTH: Final = "truth"  # folder of the surveyed grids, if the robot has made its own map

Point = tuple[quantities.Coordinate, quantities.Coordinate]
Polygon = tuple[Point, ...]
Pull = Annotated[float, quantities.Quantity(gt=0.0, le=100.0, unit="N")]
Reaction = Annotated[float, quantities.Quantity(ge=0.0, le=60.0, unit="s")]
Lengths = tuple[quantities.Margin, quantities.Margin]
Distances = tuple[quantities.Length, quantities.Length]
Angles = tuple[quantities.Angle, quantities.Angle]


class WorldError(InputError):
    """Error of world files that do not fit together; `path` is the location in `objects.yaml`."""

    def __init__(self, message: str, *, path: KeyPath = ()) -> None:
        super().__init__(message)
        self.path = path


class UnknownWorldError(WorldError):
    """Error of a name or folder that is no world."""


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


class Rules(_Strict):
    """Distances between objects on surfaces, in metres; see `objects.yaml`."""

    from_edge_m: Lengths = Field(description="least and greatest distance of an object's centre from the front edge")
    clear_m: quantities.Margin = Field(description="between objects, and from an object to a keep-clear outline")
    rim_m: quantities.Margin = Field(description="between an object's outline and the surface's own outline")
    drop_m: quantities.Margin = Field(description="objects start this high above the surface")


class ObjectRule(_Strict):
    """A loose object, its class or imported model, and the surfaces on which it may lie."""

    name: str = Field(description="its name in this world")
    model: str = Field(description="a class of `plant/models/catalogue.yaml`, or the name of an imported object")
    surfaces: tuple[str, ...] = Field(min_length=1, description="surfaces of knowledge.yaml; the seed chooses one")


class PersonRule(_Strict):
    """A person who walks on a route, or stands at a pose or within three ranges in front of the robot's start pose.

    With a route and one of these, the person walks to the waypoints from there.
    """

    name: str = Field(description="the person's name in knowledge.yaml")
    model: str = Field(default="person", description="a class of `plant/models/catalogue.yaml`")
    pose: Spot | None = Field(default=None, description="where the person stands, and the direction that they face")
    poses: tuple[Spot, ...] = Field(default=(), description="poses instead, of which the seed chooses one")
    distance_m: Distances | None = Field(default=None, description="least and greatest distance from the start pose")
    bearing_rad: Angles | None = Field(default=None, description="least and greatest bearing, seen from the start pose")
    turned_rad: Angles | None = Field(default=None, description="least and greatest turn away from facing the robot")
    route: Route | None = Field(default=None, description="where the person walks")
    gestures: tuple[Gesture, ...] = Field(default=(), description="the seed chooses one; none while lying")
    clothes: tuple[Clothes, ...] = Field(default=(), description="colours, of which the seed chooses one")
    receives: bool = Field(default=True, description="whether the person takes offered objects, while standing")
    answers: dict[str, str] = Field(default={}, description="answers to the robot's questions by a part of their text")
    pull_n: Pull = Field(default=15.0, description="the person's pull at an offered object, N")
    reaction_s: Reaction = Field(default=1.0, description="how long an offered object must be still before, s")

    @model_validator(mode="after")
    def _walks_or_stands(self) -> PersonRule:
        given = (self.distance_m, self.bearing_rad, self.turned_rad)
        if self.stands and given != (None, None, None):
            raise ValueError("'pose' says where the person stands; leave out 'distance_m', 'bearing_rad', 'turned_rad'")
        if self.route is None and not self.stands and self.ranges is None:
            raise ValueError("give 'pose', or 'route', or 'distance_m', 'bearing_rad' and 'turned_rad'")
        return self

    @property
    def stands(self) -> tuple[Spot, ...]:
        """Poses of which the seed chooses one; a single one where the file has `pose`."""
        return self.poses if self.pose is None else (self.pose,)

    @property
    def ranges(self) -> tuple[Distances, Angles, Angles] | None:
        """Ranges of distance, bearing and turn; None for a person who has only a route."""
        if self.distance_m is None or self.bearing_rad is None or self.turned_rad is None:
            return None
        return self.distance_m, self.bearing_rad, self.turned_rad


class DoorRule(_Strict):
    """A doorway with a sliding door that opens into the wall; metres in the world frame, seconds.

    The door is open until `closes`, and closed until `opens`; the earlier of both determines its state at the start.
    """

    name: str
    at: Point
    yaw: quantities.Angle = Field(description="direction in which it slides open, along the wall")
    width: quantities.Opening
    closes: quantities.Delay | None = None
    opens: quantities.Delay | None = None


class MoveRule(_Strict):
    """A move of an object by a person: to a free spot on the surface `to`, or with its base at a point."""

    name: str
    at: quantities.Delay = Field(description="s")
    to: str | tuple[quantities.Coordinate, quantities.Coordinate, quantities.Height]


class SeedRules(_Strict):
    """Schema of `objects.yaml`."""

    rules: Rules = Field(description="distances for all objects")
    fronts: dict[str, tuple[tuple[Point, Point], ...]] = Field(
        description="for each surface, the edges (from and to, x and y) that the robot can stand before"
    )
    keep_clear: tuple[Polygon, ...] = Field(default=(), description="outlines where no object may lie, corners (x, y)")
    imports: tuple[str, ...] = Field(
        default=(), description="folders of `errand object import`, as seen from this file's folder"
    )
    objects: tuple[ObjectRule, ...] = Field(description="the loose objects")
    people: tuple[PersonRule, ...] = Field(default=(), description="the people")


NO_SEED_RULES: Final = SeedRules(
    rules=Rules(from_edge_m=(0.0, 0.0), clear_m=0.0, rim_m=0.0, drop_m=0.0), fronts={}, objects=()
)
"""Rules of a world without loose objects and people."""


@dataclass(frozen=True)
class SurfaceTop:
    """A flat top for objects: outline in the world frame as (x, y) corners, height above the floor (m)."""

    name: str
    polygon_W: Polygon
    height_m: float


@dataclass(frozen=True)
class Import:
    """An imported model: the folder with its files, and its facts."""

    folder: Path
    object: ImportedObject


@dataclass(frozen=True)
class World:
    """A world: its files, and the facts that the plant uses. Lengths in metres, world frame.

    Only its geometry and a start are required: dock, rooms, surfaces and seed rules may be missing. `standing` maps
    each room and surface to a point where a person or robot can stand. `maps` is the folder of the robot's grids (None:
    the world's own `map`). `imports` are models outside the catalogue, by name. `doors` and `moves` are its events.
    """

    name: str
    folder: Path
    start: Pose2D
    dock: Pose2D | None
    rooms: dict[str, Polygon]
    surfaces: dict[str, SurfaceTop]
    surface_places: dict[str, str]
    seed_rules: SeedRules
    standing: Mapping[str, Point] = field(default_factory=dict)
    maps: Path | None = None
    imports: Mapping[str, Import] = field(default_factory=dict)
    doors: tuple[DoorRule, ...] = ()
    moves: tuple[MoveRule, ...] = ()

    @property
    def corners(self) -> Polygon:
        """Corners of all rooms; without rooms, corners of a square around the start."""
        x, y, reach_m = self.start.x_m, self.start.y_m, 5.0
        rooms = [corner for room in self.rooms.values() for corner in room]
        return tuple(rooms) or ((x - reach_m, y - reach_m), (x + reach_m, y + reach_m))

    @property
    def own_objects(self) -> Mapping[str, Import]:
        """Imported models that belong to no class of the detector, by name."""
        return {name: each for name, each in self.imports.items() if each.object.class_name == name}

    def with_routes(self, routes: Mapping[str, Route]) -> World:
        """Returns the world with people on these routes, by name; adds people whom it does not have yet.

        Raises WorldError when an object has one of the names, or a waypoint is unknown.
        """
        rules = self.seed_rules
        before = {rule.name: rule for rule in rules.people}
        kept = {"receives", "pull_n", "reaction_s", "answers", "gestures", "clothes"}
        manners = {name: rule.model_dump(include=kept) for name, rule in before.items()}
        walking = {n: PersonRule(name=n, route=route, **manners.get(n, {})) for n, route in routes.items()}
        changed = rules.model_copy(update={"people": tuple({**before, **walking}.values())})
        _check_people(changed, self.standing)
        return replace(self, seed_rules=changed)

    def with_walks(self, walks: Mapping[str, Route]) -> World:
        """Returns the world with walking people: its own people start at their places, others at a waypoint.

        Raises WorldError when a person walks already, an object has one of the names, or a waypoint is unknown.
        """
        before = {rule.name: rule for rule in self.seed_rules.people}
        if walking := [name for name in walks if name in before and before[name].route is not None]:
            raise WorldError(f"{walking[0]} walks already")
        stays = {name: before[name].model_copy(update={"route": walks[name]}) for name in walks if name in before}
        people = tuple({**before, **stays}.values())
        stood = replace(self, seed_rules=self.seed_rules.model_copy(update={"people": people}))
        return stood.with_routes({name: route for name, route in walks.items() if name not in before})

    def with_events(self, doors: Iterable[DoorRule], moves: Iterable[MoveRule]) -> World:
        """Returns the world with more sliding doors and moves of objects."""
        return replace(self, doors=(*self.doors, *doors), moves=(*self.moves, *moves))

    def with_imports(self, folders: Iterable[Path]) -> World:
        """Returns the world with the models in folders. Raises InputError for a missing model or a taken name."""
        return replace(self, imports=_with_imports(self.imports, folders))

    def with_objects(self, objects: Iterable[ObjectRule]) -> World:
        """Returns the world with more loose objects.

        Raises WorldError when a name is taken, a model or surface is unknown, or a surface cannot carry objects.
        """
        rules = self.seed_rules
        changed = rules.model_copy(update={"objects": (*rules.objects, *objects)})
        _check_surfaces(changed, self.surfaces)
        _check_people(changed, self.standing)
        _check_models(changed, self.imports)
        return replace(self, seed_rules=changed)

    def _repr_html_(self) -> str:
        """Returns a plan of the rooms as SVG, with the start; y points up."""
        (x0, y0), (x1, y1) = (tuple(map(pick, zip(*self.corners, strict=True))) for pick in (min, max))
        room = '<polygon points="{}" fill="#dde8f0" stroke="#456" stroke-width="0.05"/><text x="{}" y="{}">{}</text>'
        drawn = "".join(
            room.format(" ".join(f"{x},{-y}" for x, y in outline), outline[0][0] + 0.2, -outline[0][1] - 0.2, name)
            for name, outline in self.rooms.items()
        )
        start = f'<circle cx="{self.start.x_m}" cy="{-self.start.y_m}" r="0.2" fill="#2a7"/>'
        size = f'viewBox="{x0} {-y1} {x1 - x0} {y1 - y0}" width="600" font-size="0.4"'
        return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{drawn}{start}</svg>'

    def without_people(self) -> World:
        """Returns the world without people."""
        return replace(self, seed_rules=self.seed_rules.model_copy(update={"people": ()}))

    @property
    def directives_path(self) -> Path:
        """Path of the Drake model directives of rooms and furniture."""
        return self.folder / DIRECTIVES

    @property
    def knowledge_path(self) -> Path:
        """Path of the robot's knowledge of the world."""
        return self.folder / "knowledge.yaml"

    @property
    def surveyed(self) -> World:
        """Returns the world with the surveyed grids in place of the robot's own, for referees and tests."""
        truth = self.folder / TRUTH
        return replace(self, maps=truth if truth.is_dir() else None)

    @property
    def scan_map_path(self) -> Path:
        """Path of the grid at the height of the LiDAR."""
        return self._maps / "scan.yaml"

    @property
    def scan_map_paths(self) -> tuple[Path, ...]:
        """Paths of the grids at the heights of LiDARs."""
        return tuple(sorted(self._maps.glob("*scan.yaml")))

    def scan_map_seen_from(self, height_m: float | None) -> Path:
        """Path of the grid whose band is nearest to a LiDAR's height; the narrowest when several contain it."""
        bands = {path: _band_m(path) for path in self.scan_map_paths}
        if height_m is None or all(low > high for low, high in bands.values()):
            return self.scan_map_path
        off_m = {path: max(low - height_m, height_m - high, 0.0) for path, (low, high) in bands.items()}
        return min(bands, key=lambda path: (off_m[path], bands[path][1] - bands[path][0]))

    @property
    def keepout_map_path(self) -> Path:
        """Path of the grid with everything that the body could touch."""
        return self._maps / "keepout.yaml"

    @property
    def _maps(self) -> Path:
        return self.maps or self.folder / ROBOTS


def _band_m(path: Path) -> tuple[float, float]:
    """Height band of a grid; an empty band when its file has none."""
    with suppress(InputError, ValueError, TypeError, AttributeError):
        low, high = read_yaml(path).data.get("height_band_m")
        return float(low), float(high)
    return math.inf, -math.inf


def add_package(package_map: PackageMap) -> None:
    """Adds the package `errand` (`package://errand/` in worlds and models), the plant's folder."""
    package_map.Add(PACKAGE_NAME, WORLDS_FOLDER.parent)


def known_worlds() -> tuple[str, ...]:
    """Names of the worlds in the project, then of those in plug-ins."""
    own = sorted(path.parent.name for path in WORLDS_FOLDER.glob(f"*/{DIRECTIVES}"))
    return tuple(dict.fromkeys((*own, *sorted(each.name for each in installed_plugins(WORLDS)))))


def load_world(name_or_path: str | Path) -> World:
    """Loads a world by name or folder. Raises InputError, with file and line, for wrong files and those they name."""
    folder = _find_folder(name_or_path)
    check_directives(folder / DIRECTIVES, folder)
    knowledge = validate(Knowledge, read_yaml(folder / "knowledge.yaml", hint="every world needs this file"))
    objects = folder / "objects.yaml"
    source = read_yaml(objects) if objects.exists() or objects.is_symlink() else None
    rules = NO_SEED_RULES if source is None else validate(SeedRules, source)
    surfaces = {name: SurfaceTop(name, top.polygon, top.height) for name, top in knowledge.surfaces.items()}
    poses = {name: knowledge.place_pose(name) for name in knowledge.place_names()}
    standing = {name: (pose.x, pose.y) for name, pose in poses.items()}
    try:
        _check_surfaces(rules, surfaces)
        _check_people(rules, standing)
        imports = _with_imports({}, (folder / each for each in rules.imports))
        _check_models(rules, imports)
    except WorldError as error:
        raise error if source is None else source.error(error.path, error.message) from error
    except InputError as error:
        raise error if source is None else error.within(source.path, source.line(("imports",))) from error
    return World(
        name=folder.name,
        folder=folder,
        start=knowledge.start.pose_2d(),
        dock=None if knowledge.dock is None else knowledge.dock.pose_2d(),
        rooms=knowledge.rooms,
        surfaces=surfaces,
        surface_places={name: top.place for name, top in knowledge.surfaces.items()},
        seed_rules=rules,
        standing=standing,
        imports=imports,
    )


def _with_imports(known: Mapping[str, Import], folders: Iterable[Path]) -> Mapping[str, Import]:
    """Known models and those in folders, by name. Raises InputError for a folder without a model, or a taken name."""
    found = dict(known)
    for folder in dict.fromkeys(each.resolve() for each in folders):
        imported = read_imported(folder)
        check_model(folder / f"{imported.name}.sdf", folder)
        if imported.name in load_catalogue():
            raise WorldError(f"{folder}: the name {imported.name!r} is that of a class; import it under another name")
        other = found.setdefault(imported.name, Import(folder, imported))
        if other.folder != folder:
            raise WorldError(
                f"{folder} and {other.folder} are both called {imported.name!r}; import one under another name"
            )
    return found


def _find_folder(name_or_path: str | Path) -> Path:
    named, entries = WORLDS_FOLDER / name_or_path, installed_plugins(WORLDS).select(name=str(name_or_path))
    for folder in (named, *(package_folder(each) / each.name for each in entries), Path(name_or_path)):
        if is_file(folder / DIRECTIVES):
            return folder.resolve()
    close = nearest_name(str(name_or_path), known_worlds())
    hint = f" Did you mean {close!r}?" if close else ""
    known = ", ".join(known_worlds())
    what = f"unknown world {str(name_or_path)!r}.{hint} Known worlds: {known}; or give a folder with a world.dmd.yaml"
    raise UnknownWorldError(what)


def _check_surfaces(rules: SeedRules, surfaces: dict[str, SurfaceTop]) -> None:
    """Raises WorldError when the rules name an unknown surface, or a surface for objects has no fronts."""
    for index, rule in enumerate(rules.objects):
        for name in rule.surfaces:
            path = ("objects", index, "surfaces")
            _refuse_unknown(name, surfaces, path)
            if not rules.fronts.get(name):
                what = f"surface {name!r} may carry objects but has no entry under `fronts` in objects.yaml"
                raise WorldError(what, path=path)
    for name in rules.fronts:
        _refuse_unknown(name, surfaces, ("fronts", name))


def _refuse_unknown(name: str, surfaces: Mapping[str, SurfaceTop], path: KeyPath) -> None:
    if name not in surfaces:
        raise WorldError(f"no surface {name!r} in knowledge.yaml; {suggestion(name, surfaces)}", path=path)


def _check_models(rules: SeedRules, imports: Mapping[str, Import]) -> None:
    """Raises WorldError for an object whose model is neither a class nor imported."""
    known = (*load_catalogue(), *imports)
    for index, rule in enumerate(rules.objects):
        if rule.model not in known:
            hint = suggestion(rule.model, known, f"there are {', '.join(known)}")
            raise WorldError(f"no model {rule.model!r} for {rule.name}; {hint}", path=("objects", index, "model"))
        if rule.model in imports and imports[rule.model].object.photographs:
            raise WorldError(f"{rule.model!r} is of photographs: no mesh to place", path=("objects", index, "model"))


def _check_people(rules: SeedRules, standing: Mapping[str, Point]) -> None:
    """Raises WorldError when two people share a name, or a place on a route is unknown."""
    taken = set[str]()
    places = [("objects", index, rule.name) for index, rule in enumerate(rules.objects)]
    places += [("people", index, rule.name) for index, rule in enumerate(rules.people)]
    for kind, index, name in places:
        if name in taken:
            what = f"{name!r} names two objects or people; give one of them another name"
            raise WorldError(what, path=(kind, index, "name"))
        taken.add(name)
    for index, rule in enumerate(rules.people):
        path, waypoints = ("people", index, "route"), () if rule.route is None else rule.route.waypoints
        if not (rule.stands or rule.ranges or waypoints):
            raise WorldError(f"{rule.name} stands nowhere at first; give the route a first waypoint", path=path)
        for at in (each.at if isinstance(each, Stop) else each for each in waypoints):
            if isinstance(at, str) and at not in standing:
                hint = suggestion(at, standing, "give a point (x, y)")
                raise WorldError(f"{rule.name} cannot walk to {at!r}: no place in knowledge.yaml; {hint}", path=path)
