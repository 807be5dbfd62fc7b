"""Reads scenario files: faults, random faults and events that disturb a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, model_validator

from executive.mission.request import Request
from executive.mission.scenario import RandomFaults, Scenario
from executive.words.knowledge import Knowledge
from executive.words.mission import Manner, Route, Stop
from executive.words.outlines import Corner
from executive.words.robot_config import named_robot
from plant.robots.spot.kind import spot_capabilities
from plant.worlds.seeding import add_answers, add_crowd
from plant.worlds.world import DoorRule, MoveRule, World, WorldError
from skills.faults.fault_kinds import SUBJECTS
from skills.faults.faulty_robot import parse_fault, random_faults
from skills.grid_map import GridMap, load_grid_map
from skills.inputs.errors import InputError, Problems, nearest_name, suggestion, with_article
from skills.inputs.schema import Name, Strict, Text, validate
from skills.inputs.yaml_source import KeyPath, YamlSource, read_yaml
from skills.quantities import Coordinate, Delay, Height, Quantity
from skills.robot import FloatArray

DIRECTIONS: Final = 36
MOST_PEOPLE: Final = 40  # the simulation takes minutes for the bodies of more
_STEP_M: Final = 0.01
_BEYOND_M: Final = 0.5


def with_scenario(request: Request, world: World, knowledge: Knowledge, robots: Collection[str]) -> Request:
    """Adds the content of a request's scenario files to its scenario, and draws the random faults.

    Raises InputError with the line if a fault is unknown for these `robots`, or if the world lacks what a file names.
    """
    cameras = tuple(camera.source for camera in spot_capabilities().cameras)
    scenario = request.scenario
    for words in scenario.faults:
        check_fault(words, robots, cameras)
    imported = {name: each.object.class_name for name, each in world.imports.items()}
    objects = {rule.name: imported.get(rule.model, rule.model) for rule in world.seed_rules.objects}
    people = {rule.name: rule.route is not None for rule in world.seed_rules.people}
    for path in request.scenario_files:
        read = read_scenario(path, knowledge, robots=robots, cameras=cameras, objects=objects, people=people)
        twice = read.moving & scenario.moving
        if twice:
            raise InputError(f"another scenario has an event of {min(twice)}", hint="keep one of them", file=path)
        scenario = scenario.merge(_with_doorways(read, world))
    drawn = random_faults(scenario.random, request.seed, cameras)
    given = request.given_scenario or (request.scenario, request.scenario_files)
    return replace(request, scenario=scenario.with_drawn(drawn), scenario_files=(), given_scenario=given)


def with_events(world: World, scenario: Scenario, seed: int = 0) -> World:
    """Adds a scenario's events to the world; the seed places its crowd. Raises InputError if they do not fit."""
    try:
        walking = world.with_walks({name: Route.model_validate(each) for name, each in scenario.people.items()})
        walking = add_crowd(add_answers(walking, scenario.answers), scenario.crowd, seed)
    except WorldError as error:
        raise InputError(str(error), hint="change the scenario's events") from error
    doors = [DoorRule.model_validate(door) for door in scenario.doors]
    return walking.with_events(doors, [MoveRule.model_validate(move) for move in scenario.moves])


def _with_doorways(scenario: Scenario, world: World) -> Scenario:
    """Adds the surveyed centre, width and direction of each door. Raises InputError if the map is broken."""
    if not scenario.doors:
        return scenario
    grid = load_grid_map(world.surveyed.scan_map_path)
    return replace(scenario, doors=tuple({**door, **doorway(grid, door["at"])} for door in scenario.doors))


def doorway(grid: GridMap, at_W: tuple[float, float]) -> dict[str, Any]:
    """Returns centre, clear width (m) and direction of the doorway at a point.

    The shortest free line through the point is the doorway. The direction points to the side with the longer wall.
    """
    angles = np.arange(DIRECTIONS) * math.pi / DIRECTIONS
    lengths = [[_free_m(grid, at_W, angle), _free_m(grid, at_W, angle + math.pi)] for angle in angles]
    ahead_m, back_m = lengths[best := int(np.argmin(np.sum(lengths, axis=1)))]
    yaw, width_m = float(angles[best]), ahead_m + back_m
    along = np.array([math.cos(yaw), math.sin(yaw)])
    middle = np.array(at_W) + 0.5 * (ahead_m - back_m) * along
    if _wall_m(grid, middle, -along, width_m) > _wall_m(grid, middle, along, width_m):
        yaw += math.pi
    return {"at": (float(middle[0]), float(middle[1])), "yaw": yaw, "width": width_m}


def _free_m(grid: GridMap, at_W: tuple[float, float], yaw: float) -> float:
    """Distance from a point to the first occupied cell, in metres."""
    away_m = np.arange(0.0, 10.0, _STEP_M)
    met = _occupied(grid, np.array(at_W) + away_m[:, None] * [math.cos(yaw), math.sin(yaw)])
    return float(away_m[int(np.argmax(met))]) if met.any() else float(away_m[-1])


def _wall_m(grid: GridMap, middle_W: FloatArray, along: FloatArray, width_m: float) -> float:
    """Length of the wall beside a doorway in a direction, up to the door's width and `_BEYOND_M`, in metres."""
    away_m = np.arange(0.5 * width_m + _STEP_M, 1.5 * width_m + _BEYOND_M, _STEP_M)
    met = _occupied(grid, middle_W + away_m[:, None] * along)
    return _STEP_M * float(np.count_nonzero(np.logical_and.accumulate(met)))


def _occupied(grid: GridMap, points_W: FloatArray) -> Any:
    """Returns a mask of the points (N, 2) in occupied cells; cells outside the grid count as occupied."""
    rows, columns = grid.cells(points_W).T
    inside = (rows >= 0) & (rows < grid.occupied.shape[0]) & (columns >= 0) & (columns < grid.occupied.shape[1])
    return ~inside | grid.occupied[np.where(inside, rows, 0), np.where(inside, columns, 0)]


_KINDS: Final = ("person", "door", "object")
_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "person": ("at", "to", "from", *Manner.model_fields),
    "door": ("closes", "opens"),
    "object": ("at", "to"),
}


Crowd = Annotated[int, Quantity(ge=0, le=10)]
"""Number of people who wander about."""
Spot = tuple[Coordinate, Coordinate, Height]
Stops = Annotated[tuple[Corner | Name | Stop, ...], Field(min_length=1)]


class EventFile(Manner):
    """Event that concerns exactly one person, door or object."""

    person: Name | None = Field(None, description="A person who walks: one of the world, or a new one.")
    door: tuple[Name, Name] | None = Field(None, description="The two rooms that a door joins.")
    object: Name | None = Field(None, description="An object by its name in the world, or the first object of a class.")
    at: Delay | None = Field(None, description="Time on the robot's clock: `20`, `20 s` or `2 min`.")
    to: Corner | Spot | Name | Stops | None = Field(
        None,
        description="A person: a place, a point [x, y], or a list of them with pauses. An object: a surface, or a "
        "point [x, y, z] in metres, with z the height of the surface.",
    )
    from_: Corner | Name | None = Field(None, alias="from", description="The place where a new person stands at first.")
    closes: Delay | None = Field(None, description="Time when the door begins to close.")
    opens: Delay | None = Field(
        None, description="Time when the door begins to open; without `closes` it is closed at first."
    )

    @model_validator(mode="after")
    def _of_one_kind(self) -> EventFile:
        named = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(named) != 1:
            raise ValueError("give exactly one of 'person', 'door' and 'object'")
        given = {name.removesuffix("_") for name in self.model_fields_set} - {named[0]}
        strange = sorted(given - {*_KEYS[named[0]]})
        if strange:
            keys = ", ".join(_KEYS[named[0]])
            raise ValueError(f"{with_article(named[0])} has no key '{strange[0]}'; its keys are {keys}")
        if named[0] == "door" and self.closes is None and self.opens is None:
            raise ValueError("a door needs 'closes' or 'opens'")
        stays = named[0] == "person" and (self.wanders or self.follows is not None)
        if named[0] != "door" and not stays and (self.at is None or self.to is None):
            raise ValueError(f"{with_article(named[0])} needs 'at' and 'to'")
        spot = isinstance(self.to, tuple) and len(self.to) == 3 and isinstance(self.to[0], float)
        if named[0] == "person" and spot:
            raise ValueError("a person walks to a point [x, y], without a height")
        if named[0] == "object" and not (spot or isinstance(self.to, str)):
            raise ValueError("an object is moved to a surface, or to a point [x, y, z], z of what it is put on")
        return self


class ScenarioFile(Strict):
    """Scenario file: faults and events of a run."""

    faults: tuple[Text, ...] = Field(default=(), description="Faults in words.")
    random: RandomFaults = Field(0, description="Number of further faults that the run's seed draws.")
    events: tuple[EventFile, ...] = Field(default=(), description="Events in the world.")
    crowd: Crowd = Field(0, description="Number of people who wander about between free points that the seed draws.")
    answers: dict[Name, dict[Text, Text]] = Field(
        default={},
        description="Answers of people to a robot within 3 m and in sight, by a part of the question; of the options "
        'of another question they choose by the seed. "Are you Robin?" everybody answers by the name.',
    )


def check_fault(
    words: str, robots: Collection[str], cameras: Sequence[str] = (), refusal: Callable[..., InputError] = InputError
) -> tuple[str | None, str]:
    """Splits words into the robot that they name (None: all) and its fault; raises a `refusal` for unknown ones."""
    robot, said = named_robot(words, robots)
    head = said.partition(":")[0].strip()
    if robots and ":" in said and (nearest_name(head, robots) or not nearest_name(head.partition(".")[0], SUBJECTS)):
        raise refusal(f"there is no robot '{head[:60]}'", hint=suggestion(head, robots))
    try:
        parse_fault(said, cameras=cameras)
    except ValueError as error:
        what, _, hint = str(error).partition("; ")
        raise refusal(what, hint=hint) from error
    return robot, said


def read_scenario(
    path: Path,
    knowledge: Knowledge,
    *,
    robots: Collection[str] = (),
    cameras: tuple[str, ...],
    objects: Mapping[str, str],
    people: Mapping[str, bool],
) -> Scenario:
    """Reads a scenario file for a world; resolves its places to points.

    `robots` are the names of the run's robots, `cameras` are the robot's cameras, `objects` maps the world's objects to
    their classes, and `people` maps each person to True if the world already gives the person a route.

    Raises:
        InputError: a key is wrong, or a fault, place, door, object or person is unknown; with the line.
    """
    source = read_yaml(path)
    file, problems = validate(ScenarioFile, source), Problems()
    for number, words in enumerate(file.faults):
        with problems:
            check_fault(words, robots, cameras, partial(source.error, ("faults", number)))
    walks = [number for number, event in enumerate(file.events) if event.person is not None]
    if len(walks) > MOST_PEOPLE:
        raise source.error(
            ("events", walks[MOST_PEOPLE]), f"at most {MOST_PEOPLE} people have events", "leave some out"
        )
    reader = _EventReader(source, knowledge, objects, people)
    for number, event in enumerate(file.events):
        with problems:
            reader.add(event, ("events", number))
    answers = {knowledge.person(said) or said: each for said, each in file.answers.items()}
    for name in answers.keys() - {*people, *reader.people}:
        with problems:
            hint = suggestion(name, [*people, *reader.people], "add an event of this person")
            raise source.error(("answers", name), f"there is no {name} in the world", hint)
    problems.raise_any()
    moved = (reader.people, tuple(reader.doors), tuple(reader.moves))
    return Scenario(file.faults, file.random, *moved, answers=answers, crowd=file.crowd)


class _EventReader:
    """Reader of the events in a scenario file; checks each event against the world."""

    def __init__(
        self, source: YamlSource, knowledge: Knowledge, objects: Mapping[str, str], known_people: Mapping[str, bool]
    ) -> None:
        self._source, self._knowledge = source, knowledge
        self._objects, self._known_people = objects, known_people
        self.people: dict[str, Mapping[str, Any]] = {}
        self.doors: list[Mapping[str, Any]] = []
        self.moves: list[Mapping[str, Any]] = []

    def add(self, event: EventFile, path: KeyPath) -> None:
        """Adds an event. Raises InputError with the line if the world lacks what the event names."""
        if event.person is not None:
            self._add_walk(event, event.person, path)
        elif event.door is not None:
            self._add_door(event, event.door, path)
        elif event.object is not None:
            self._add_move(event, event.object, path)

    def _add_walk(self, event: EventFile, said: str, path: KeyPath) -> None:
        name = self._knowledge.person(said) or said
        if name in self.people:
            hint = "give its 'to' a list of places, with pauses"
            raise self._source.error((*path, "person"), f"{name} has an event already", hint)
        if self._known_people.get(name, False):
            raise self._source.error((*path, "person"), f"{name} walks already", "name a person who stands")
        if name not in self._known_people and event.from_ is None:
            hint = suggestion(said, self._known_people, f"add 'from', where {name} stands at first")
            raise self._source.error((*path, "person"), f"there is no {said} in the world", hint)
        if name in self._known_people and event.from_ is not None:
            raise self._source.error((*path, "from"), f"{name} stands in the world already", "take 'from' out")
        stops = [] if event.to is None else _stops(event.to)
        stops = stops if event.from_ is None else [Stop(at=event.from_, pause=0.0), *stops]
        route = {"start": event.at or 0.0, "speed": event.speed, "loop": event.loop, "yields": event.yields}
        route |= event.model_dump(include={*Manner.model_fields} - {*route}, exclude_defaults=True, mode="json")
        points = [{"at": self._point(stop.at, (*path, "to")), "pause": stop.pause} for stop in stops]
        self.people[name] = {**route, "waypoints": points}

    def _point(self, at: Corner | str, path: KeyPath) -> Corner:
        """Returns the point of a place. Raises InputError with the line if there is no such place."""
        if not isinstance(at, str):
            return at
        place = self._knowledge.place(at)
        if place is None:
            hint = suggestion(at, self._knowledge.spellings(self._knowledge.place_names()), "give a point [x, y]")
            raise self._source.error(path, f"unknown place {at!r}", hint)
        pose = self._knowledge.place_pose(place)
        return pose.x, pose.y

    def _add_door(self, event: EventFile, rooms: tuple[str, str], path: KeyPath) -> None:
        names = tuple(self._knowledge.place(room) or room for room in rooms)
        doors = [door for door in self._knowledge.doors if set(door.between) == set(names)]
        if not doors:
            known = [" and ".join(door.between) for door in self._knowledge.doors]
            hint = suggestion(" and ".join(names), known) if known else "list it under 'doors' in knowledge.yaml"
            raise self._source.error((*path, "door"), f"no door is known between {rooms[0]} and {rooms[1]}", hint)
        for number, door in enumerate(doors, 1):
            name = f"door between {door.between[0]} and {door.between[1]}" + (f" ({number})" if number > 1 else "")
            if any(other["name"] == name for other in self.doors):
                raise self._source.error((*path, "door"), f"the {name} has an event already", "write one for each door")
            times = {"closes": event.closes, "opens": event.opens}
            self.doors.append({"name": name, "at": door.at, "width": door.width, **times})

    def _add_move(self, event: EventFile, said: str, path: KeyPath) -> None:
        classes = self._knowledge.classes(self._knowledge.object_name(said) or said)
        named = [name for name in self._objects if name.lower() == said.lower()]
        of_class = [name for name, kind in self._objects.items() if kind in classes]
        if not named and not of_class:
            hint = suggestion(said, [*self._objects, *self._objects.values()])
            raise self._source.error((*path, "object"), f"there is no {said!r} in the world", hint)
        self.moves.append({"name": (named or of_class)[0], "at": event.at, "to": self._rest(event.to, (*path, "to"))})

    def _rest(self, to: Any, path: KeyPath) -> str | Spot:
        """Returns the surface or the point where an event puts an object. Raises InputError for an unknown surface."""
        if not isinstance(to, str):
            x, y, z = to
            return x, y, z
        place = self._knowledge.place(to)
        if place is None or place not in self._knowledge.surfaces:
            what = f"{to!r} is no surface" if place is not None else f"unknown surface {to!r}"
            hint = suggestion(to, self._knowledge.spellings(self._knowledge.surfaces), shown=self._knowledge.surfaces)
            raise self._source.error(path, what, hint)
        return place


def _stops(to: Any) -> list[Stop]:
    """Returns the places where a person goes, in order."""
    single = isinstance(to, str) or isinstance(to[0], float | int)
    return [each if isinstance(each, Stop) else Stop(at=each, pause=0.0) for each in ((to,) if single else to)]
