"""Placement of objects, people and clutter by the seed: pure functions of a world and a seed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from pydrake.math import RigidTransform, RollPitchYaw

from executive.words.mission import Route, Stop
from plant.models.catalogue import ModelClass, ModelForm, load_catalogue
from plant.models.person_figure import Figure, Spot, shade
from plant.worlds.world import Lengths, ObjectRule, PersonRule, Point, SurfaceTop, World, WorldError
from skills.robot import FloatArray


@dataclass(frozen=True)
class PointStop:
    """A waypoint in the world frame, and how long the person pauses there (s)."""

    at_W: Point
    pause_s: float = 0.0


@dataclass(frozen=True)
class Lapse:
    """Lapse of attention after a walked distance (m): the person walks back a distance (m), then stops (s)."""

    after_m: float
    stop_s: float
    back_m: float = 0.0


@dataclass(frozen=True)
class PointRoute:
    """Route of a walking person: begins at `start_s`, and continues from the last stop to the first if it `loops`.

    A person who `yields` stops for a robot close ahead; one who keeps `apart` also for people. `pace` is the fraction
    by which the speed varies. A person who `follows` robots begins once a robot has spoken; one who `wanders` draws
    further stops. `says` is what the person says at the end of the route, `steps_aside` the probability that the person
    lets a robot pass that asks for it. `stream` seeds all draws on the route.
    """

    stops: tuple[PointStop, ...]
    speed_m_s: float = 1.2
    loops: bool = False
    start_s: float = 0.0
    yields: bool = True
    yaw_rad: float | None = None
    apart: bool = False
    pace: float = 0.0
    lapses: tuple[Lapse, ...] = ()
    follows: str | None = None
    wanders: bool = False
    says: str | None = None
    steps_aside: float = 1.0
    stream: tuple[int, ...] = ()

    def from_pose(self, at_W: Point, yaw_rad: float) -> PointRoute:
        """Returns the route for a person who first stands at a pose."""
        return replace(self, stops=(PointStop(at_W), *self.stops), yaw_rad=yaw_rad)

    @property
    def first_yaw_rad(self) -> float:
        """First heading of the person: as given, else towards the second stop."""
        if self.yaw_rad is not None:
            return self.yaw_rad
        (x0, y0), (x1, y1) = self.stops[0].at_W, self.stops[min(1, len(self.stops) - 1)].at_W
        return math.atan2(y1 - y0, x1 - x0)


def point_route(route: Route, standing: Mapping[str, Point], stream: Sequence[int] = (0,)) -> PointRoute:
    """Resolves the places in a route by `standing`, and draws its lapses of attention from the seeds `stream`."""
    stops = (each if isinstance(each, Stop) else Stop(at=each) for each in route.waypoints)
    points = (PointStop(standing[each.at] if isinstance(each.at, str) else each.at, each.pause) for each in stops)
    return PointRoute(
        tuple(points),
        route.speed,
        route.loop,
        route.start,
        route.yields,
        apart=route.apart or route.wanders or route.follows is not None,
        pace=route.pace,
        lapses=_lapses(route, np.random.default_rng(stream)),
        follows=route.follows,
        wanders=route.wanders,
        says=route.says,
        steps_aside=route.steps_aside,
        stream=tuple(stream),
    )


def _lapses(route: Route, rng: np.random.Generator) -> tuple[Lapse, ...]:
    """Lapses of attention on a route: as given, or a requested number, one every few metres."""
    if not isinstance(route.distractions, int):
        return tuple(Lapse(each.after, each.stop, each.back) for each in route.distractions)
    after_m = np.cumsum(rng.uniform(*_LAPSE_EVERY_M, size=route.distractions))
    backs_m = rng.uniform(*_LAPSE_BACK_M, size=route.distractions) * (rng.random(route.distractions) < 0.5)
    return tuple(
        Lapse(float(at_m), float(rng.uniform(*_LAPSE_STOP_S)), float(back_m))
        for at_m, back_m in zip(after_m, backs_m, strict=True)
    )


_LAPSE_EVERY_M = (4.0, 10.0)
_LAPSE_BACK_M = (1.0, 3.0)
_LAPSE_STOP_S = (2.0, 6.0)
ATTEMPTS = 500
BODY_RADIUS_M: Final = 0.2
"""Radius about a standing person's centre in which nothing else is."""
ROUND_SIDES = 16
_OBJECT_STREAM = 1
_PEOPLE_STREAM = 2
_FORM_STREAM = 3
_WALK_STREAM = 13
_FIGURE_STREAM = 16


@dataclass(frozen=True)
class Receiving:
    """Pull (N) of a person on an offered object, and how long the object must be still before the pull (s)."""

    pull_n: float = 15.0
    reaction_s: float = 1.0


@dataclass(frozen=True)
class Placement:
    """A model in the world: X_WO is its pose at the start.

    A loose object rests on `surface`. A person without a `route` is welded to the world. `receiving` says how the
    person takes objects; a `figure` has another posture, gesture or clothes than the form. `answers` maps phrases in
    questions to the person's answers.
    """

    name: str
    class_name: str
    form: ModelForm
    X_WO: RigidTransform
    surface: str | None = None
    route: PointRoute | None = None
    receiving: Receiving | None = None
    figure: Figure | None = None
    answers: Mapping[str, str] = field(default_factory=dict)

    @property
    def model_path(self) -> Path:
        """Path of the SDF file."""
        return self.form.path()


def place_objects(world: World, seed: int) -> tuple[Placement, ...]:
    """Places the world's loose objects at rest on its surfaces. Raises WorldError when they do not fit.

    Form, surface and pose vary with the seed. Each object has its own random streams: adding or removing one moves only
    objects that it touches.
    """
    catalogue, outlines, placed = load_catalogue(), list[FloatArray](), list[Placement]()
    for index, rule in enumerate(world.seed_rules.objects):
        class_name, form = _model(catalogue, rule.model, world, seed, index)
        rng = np.random.default_rng([seed, _OBJECT_STREAM, index])
        placement, outline = place_one(world, rule, (class_name, form), outlines, rng)
        placed.append(placement)
        outlines.append(outline)
    return tuple(placed)


def place_people(world: World, seed: int) -> tuple[Placement, ...]:
    """Places the people: at the start of their routes, or on the floor in front of the start pose, facing the robot."""
    catalogue = load_catalogue()
    return tuple(
        _place_person(world, rule, _form(catalogue, rule.model, world, seed, index), seed, index)
        for index, rule in enumerate(world.seed_rules.people)
    )


def _model(
    catalogue: Mapping[str, ModelClass], name: str, world: World, seed: int, index: int
) -> tuple[str, ModelForm]:
    """Class and form of an object: an imported model with this name, else a form of the class."""
    if name in world.imports:
        found = world.imports[name]
        return found.object.class_name, found.object.form(found.folder)
    return name, _form(catalogue, name, world, seed, index)


def _form(catalogue: Mapping[str, ModelClass], name: str, world: World, seed: int, index: int) -> ModelForm:
    """Form of a class, chosen by the seed. Raises WorldError when the class is unknown."""
    if name not in catalogue:
        raise WorldError(f"{world.folder / 'objects.yaml'}: no model {name!r}; there are {', '.join(catalogue)}")
    forms = tuple(catalogue[name].forms.values())
    return forms[int(np.random.default_rng([seed, _FORM_STREAM, index]).integers(len(forms)))]


def place_one(
    world: World, rule: ObjectRule, model: tuple[str, ModelForm], others: Sequence[FloatArray], rng: np.random.Generator
) -> tuple[Placement, FloatArray]:
    """Places one object at a free pose; returns it with its outline. Raises WorldError when no pose is free."""
    rules, (class_name, form) = world.seed_rules.rules, model
    first = int(rng.integers(len(rule.surfaces)))
    obstacles = np.array([shapely.Polygon(each) for each in (*others, *world.seed_rules.keep_clear)], dtype=np.object_)
    for name in (*rule.surfaces[first:], *rule.surfaces[:first]):
        surface = world.surfaces[name]
        top = shapely.Polygon(surface.polygon_W).buffer(-rules.rim_m)
        for centre, yaw in candidates(world, surface, rng):
            outline = outline_W(form, centre, yaw)
            covered = shapely.polygons(outline)
            if top.covers(covered) and bool(np.all(shapely.distance(covered, obstacles) >= rules.clear_m)):
                z = surface.height_m + form.rest_height_m + rules.drop_m
                X_WO = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), np.array([*centre, z], dtype=np.float64))
                return Placement(rule.name, class_name, form, X_WO, name), outline
    raise WorldError(f"{world.folder / 'objects.yaml'}: {rule.name} finds no free spot on {', '.join(rule.surfaces)}")


def candidates(world: World, surface: SurfaceTop, rng: np.random.Generator) -> Iterator[tuple[Point, float]]:
    """Yields random centres along the front edges of a surface, with random yaws."""
    middle, fronts = np.mean(surface.polygon_W, axis=0), []
    for ends in world.seed_rules.fronts[surface.name]:
        a, b = (np.array(end) for end in ends)
        inward = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        fronts.append((a, b - a, inward * np.sign(inward @ (middle - a))))
    for _ in range(ATTEMPTS):
        a, along, inward = fronts[int(rng.integers(len(fronts)))]
        centre = a + rng.uniform() * along + rng.uniform(*world.seed_rules.rules.from_edge_m) * inward
        yield (float(centre[0]), float(centre[1])), float(rng.uniform(-np.pi, np.pi))


def _place_person(world: World, rule: PersonRule, form: ModelForm, seed: int, index: int) -> Placement:
    stream = (seed, _WALK_STREAM, index)
    route = None if rule.route is None else point_route(rule.route, world.standing, stream)
    rng = np.random.default_rng([seed, _PEOPLE_STREAM, index])
    spot = Spot(x=0.0, y=0.0)
    if rule.stands:
        spot = rule.stands[int(rng.integers(len(rule.stands)))]
        x, y, yaw = spot.x, spot.y, spot.yaw
    elif rule.ranges is not None:
        x, y, yaw = _before_start(world, rule.ranges, rng)
    else:
        assert route is not None
        (x, y), yaw = route.stops[0].at_W, route.first_yaw_rad
    if route is not None and (rule.stands or rule.ranges):
        route, spot = route.from_pose((x, y), yaw), Spot(x=x, y=y)
    X_WO = RigidTransform(
        RollPitchYaw(0.0, 0.0, yaw), np.array([x, y, form.rest_height_m + spot.z_m], dtype=np.float64)
    )
    takes = rule.receives and spot.posture == "standing"
    receiving = Receiving(rule.pull_n, rule.reaction_s) if takes else None
    figure = _figure(rule, spot, np.random.default_rng([seed, _FIGURE_STREAM, index]))
    return Placement(rule.name, rule.model, form, X_WO, None, route, receiving, figure, rule.answers)


def _figure(rule: PersonRule, spot: Spot, rng: np.random.Generator) -> Figure | None:
    """Figure of a person, with gesture, colour and shade by the seed; None where the form shows the person as well."""
    gestures, colours = rule.gestures or ("none",), rule.clothes
    gesture, number = gestures[int(rng.integers(len(gestures)))], int(rng.integers(max(1, len(colours))))
    if not rule.gestures and not colours and spot.posture == "standing":
        return None
    figure = Figure(spot.posture, "none" if spot.posture == "lying" else gesture)
    figure = replace(figure, phase_rad=float(rng.uniform(0.0, math.tau)))
    return replace(figure, clothes=shade(colours[number], rng)) if colours else figure


def _before_start(
    world: World, ranges: tuple[Lengths, Lengths, Lengths], rng: np.random.Generator
) -> tuple[float, float, float]:
    """Pose (x, y, yaw) of a person at a random distance, bearing and turn in front of the start pose."""
    distance_m, bearing_rad, turned_rad = ranges
    direction = world.start.yaw_rad + rng.uniform(*bearing_rad)
    distance = rng.uniform(*distance_m)
    yaw = direction + np.pi + rng.uniform(*turned_rad)
    x = world.start.x_m + distance * np.cos(direction)
    y = world.start.y_m + distance * np.sin(direction)
    return float(x), float(y), float(yaw)


def standing_points_W(world: World) -> FloatArray:
    """Points (N, 2) where people may start under any seed."""
    points = [point for rule in world.seed_rules.people for point in standing_W(world, rule)]
    return np.array(points).reshape(-1, 2)


def standing_W(world: World, rule: PersonRule) -> list[Point]:
    """Points where a person may start under any seed: one, or a grid over the person's ranges."""
    if rule.stands:
        return [(spot.x, spot.y) for spot in rule.stands if spot.posture == "standing"]
    if rule.ranges is None:
        assert rule.route is not None
        return [point_route(rule.route, world.standing).stops[0].at_W] if rule.route.waypoints else []
    distance_m, bearing_rad, _ = rule.ranges
    places = list[Point]()
    for distance, bearing in itertools.product(np.linspace(*distance_m, 3), np.linspace(*bearing_rad, 5)):
        direction = world.start.yaw_rad + bearing
        x, y = world.start.x_m + distance * np.cos(direction), world.start.y_m + distance * np.sin(direction)
        places.append((float(x), float(y)))
    return places


def overlaps(
    world: World, objects: Sequence[Placement], scenery: Sequence[tuple[str, FloatArray]]
) -> Iterator[tuple[PersonRule, str]]:
    """Yields each person who may stand inside another, an object or scenery, with a sentence on it.

    `scenery` has the outlines (K, 2) of furniture and walls, with names. People who walk on pass through each other.
    """
    solid = [(name, shapely.Polygon(outline)) for name, outline in scenery]
    solid += [(each.name, shapely.Polygon(outline_of(each))) for each in objects]
    before = list[tuple[str, shapely.Geometry]]()
    for rule in world.seed_rules.people:
        own = shapely.MultiPoint(standing_W(world, rule))
        walks_on = rule.route is not None and (rule.route.loop or rule.route.wanders or rule.route.follows is not None)
        for name, shape in (*solid, *(() if walks_on else before)):
            if not own.is_empty and shapely.dwithin(own, shape, BODY_RADIUS_M):
                x, y = shapely.shortest_line(own, shape).coords[0]
                yield rule, f"{rule.name} would stand in {name} at ({x:.2f}, {y:.2f})"
                break
        if not walks_on:
            before.append((rule.name, own.buffer(BODY_RADIUS_M)))


def outline_of(placement: Placement) -> FloatArray:
    """Convex outline (K, 2) of a placed object from above, in the world."""
    x, y, _ = placement.X_WO.translation()
    return outline_W(placement.form, (float(x), float(y)), RollPitchYaw(placement.X_WO.rotation()).yaw_angle())


def outline_W(form: ModelForm, centre: Point, yaw_rad: float) -> FloatArray:
    """Convex outline (K, 2) of a form at a pose from above, in the world."""
    half = np.array(form.half_extents_m)
    if form.round:
        angle = np.arange(ROUND_SIDES) * 2 * np.pi / ROUND_SIDES
        corners = np.stack([np.cos(angle), np.sin(angle)], axis=1) * half
    else:
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.asarray(corners @ np.array([[c, s], [-s, c]]) + np.array(centre))


def polygon_distance(a: FloatArray, b: FloatArray) -> float:
    """Distance between two polygons (m); 0 when they overlap."""
    return float(shapely.distance(shapely.Polygon(a), shapely.Polygon(b)))


PAUSE_S = 4.0
_CROWD_APART_M = 1.2
_CROWD_M_S = (0.7, 1.3)
_CLUTTER_STREAM = 11
_PASSING_STREAM = 12
_CROWD_STREAM = 15
_NEVER = frozenset({"person", "extinguisher"})
"""Classes that are never clutter: people, and objects that are too large for most surfaces."""
_STOPS = 4


def place_clutter(
    world: World, objects: Sequence[Placement], count: int, seed: int, *, spared: Collection[str] = ()
) -> tuple[Placement, ...]:
    """Places up to `count` further objects beside the placed ones, except objects in the `spared` classes.

    Each rests on a surface that the rules allow; objects without a free spot are omitted.
    """
    surfaces = tuple(sorted(name for name, fronts in world.seed_rules.fronts.items() if fronts))
    classes = [name for name in load_catalogue() if name not in _NEVER and name not in spared]
    if not surfaces or not classes:
        return ()
    outlines, placed = [outline_of(each) for each in objects], list[Placement]()
    for index in range(count):
        rng = np.random.default_rng([seed, _CLUTTER_STREAM, index])
        model = classes[int(rng.integers(len(classes)))]
        form = [*load_catalogue()[model].forms.values()][int(rng.integers(len(load_catalogue()[model].forms)))]
        rule = ObjectRule(name=f"spare {model} {index + 1}", model=model, surfaces=surfaces)
        try:
            placement, outline = place_one(world, rule, (model, form), outlines, rng)
        except WorldError:
            continue
        placed.append(placement)
        outlines.append(outline)
    return tuple(placed)


def add_passers_by(world: World, count: int, seed: int) -> World:
    """Adds `count` walking people to a world; the seed chooses the places on their looped routes.

    Raises WorldError when the world has fewer than two places.
    """
    places = sorted({place for name, place in world.standing.items() if name in world.rooms})
    if count and len(places) < 2:
        raise WorldError(f"{world.name} has fewer than two places, and a person cannot walk between them")
    walks = {}
    for index in range(count):
        rng = np.random.default_rng([seed, _PASSING_STREAM, index])
        chosen = rng.permutation(len(places))[:_STOPS]
        stops = tuple(Stop(at=places[int(each)], pause=PAUSE_S) for each in chosen)
        walks[f"passer-by {index + 1}"] = Route(waypoints=stops, loop=True, start=float(rng.uniform(0.0, 10.0)))
    return world.with_walks(walks) if walks else world


def add_crowd(world: World, count: int, seed: int) -> World:
    """Adds `count` wandering people; the seed chooses their starts, far from the robot's start.

    Raises WorldError when the world has too few places.
    """
    rng, start_W = np.random.default_rng([seed, _CROWD_STREAM]), (world.start.x_m, world.start.y_m)
    starts_W = list[Point]()
    for place_W in rng.permutation(sorted({*world.standing.values()})) if count else ():
        if all(math.dist(place_W, other_W) > _CROWD_APART_M for other_W in (start_W, *starts_W)):
            starts_W.append((float(place_W[0]), float(place_W[1])))
    if len(starts_W) < count:
        raise WorldError(f"{world.name} has room for a crowd of {len(starts_W)} at its places, not {count}")
    walks = {
        f"wanderer {number + 1}": Route(waypoints=(at_W,), wanders=True, speed=float(rng.uniform(*_CROWD_M_S)))
        for number, at_W in enumerate(starts_W[:count])
    }
    return world.with_walks(walks) if walks else world


def add_answers(world: World, answers: Mapping[str, Mapping[str, str]]) -> World:
    """Adds the answers of people, by name, to the robot's questions."""
    rules = world.seed_rules
    given = {name: {"answers": {**each}} for name, each in answers.items()}
    people = tuple(rule.model_copy(update=given.get(rule.name)) for rule in rules.people)
    return replace(world, seed_rules=rules.model_copy(update={"people": people}))
