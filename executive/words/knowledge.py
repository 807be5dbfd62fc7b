"""Knowledge of a world: places, surfaces, objects and their usual places, people, and the robot's own places."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, PrivateAttr, model_validator

from executive.words.command import NUMBERS, SPEAKER, START
from executive.words.outlines import Corner, Polygon, distance_m, unless_near
from executive.words.robot_config import RobotsFile, check_name
from executive.words.task import Part, Task, basic, installed_tasks
from executive.words.zone import ZoneFacts, with_files
from skills.api import Surface, Tag, Zone
from skills.class_forms import ANY_OBJECT, class_forms
from skills.inputs.errors import InputError, suggestion
from skills.inputs.schema import Name, Strict, validate
from skills.inputs.yaml_source import YamlSource, read_yaml
from skills.quantities import Angle, Coordinate, Height, Opening, Quantity, TagNumber, TagSize, TopHeight
from skills.robot import Pose2D
from skills.world_model import PERSON

ANYTHING: Final = "object"
"""Name that stands for every class of objects."""
EVERYTHING: Final = "everything"
"""Name that stands for all objects at a place, of any class."""
ANYBODY: Final = PERSON
"""Name that stands for any person."""
_UNNAMED: Final = {
    **dict.fromkeys((ANYTHING, ANY_OBJECT, "item", "anything", "something"), ANYTHING),
    EVERYTHING: EVERYTHING,
}
DOCK: Final = "dock"


class Pose(Strict):
    """Planar pose in the world frame: x, y in metres, yaw in radians, counter-clockwise from x."""

    x: Coordinate = Field(description="metres")
    y: Coordinate = Field(description="metres")
    yaw: Angle = Field(default=0.0, description="radians")

    def pose_2d(self) -> Pose2D:
        """Returns the pose in the type of the skills."""
        return Pose2D(self.x, self.y, self.yaw)


class RobotFacts(Strict):
    """Facts about the robot: its name, the names of others, and whether typed sentences must begin with its name."""

    name: Name = Field(description='as in "Hey Alice"')
    others: tuple[Name, ...] = Field(default=(), description="names of other robots that are spoken to")
    require_wake: bool = Field(default=False, description="typed sentences, too, begin with the wake phrase")


class BatteryFacts(Strict):
    """States of charge (0 to 1) at which the robot goes to the dock and leaves it."""

    low: Annotated[float, Quantity(ge=0.0, lt=1.0)] = Field(default=0.15, description="interrupts a mission below it")
    charged: Annotated[float, Quantity(gt=0.0, le=1.0)] = Field(default=0.8, description="at this the mission goes on")

    @model_validator(mode="after")
    def _in_order(self) -> BatteryFacts:
        if self.charged <= self.low:
            raise ValueError("'charged' must be above 'low', or the robot never leaves the dock")
        return self


class Place(Strict):
    """Room, with its outline (world frame, m), or a named pose without one: other names, the pose of a robot there."""

    pose: Pose = Field(description="pose of a robot in it; that of a named pose is taken exactly")
    polygon: Polygon | None = Field(default=None, description="corners (x, y) of a room's outline; none: a named pose")
    aliases: tuple[Name, ...] = Field(default=(), description="other names")
    shows: tuple[Coordinate, Coordinate, Height] | None = Field(
        default=None, description="the point (x, y, z) that a picture from a named pose shows; by default what is ahead"
    )


class Door(Strict):
    """Narrow passage between two rooms: its middle (world frame, m) and clear width (m)."""

    between: tuple[str, str] = Field(description="the rooms on its two sides")
    at: Corner = Field(description="its middle (x, y)")
    width: Opening = Field(description="clear width, m")
    opens: dict[str, Any] | None = Field(
        default=None, description="the plug-in that opens it and its options, as `{plugin: http, url: ..}`"
    )


class SurfaceFacts(Strict):
    """Flat top in a room: other names, height above the floor (m), outline, poses from which a robot sees it whole."""

    place: str = Field(description="the room that it is in")
    height: TopHeight = Field(description="of the top above the floor, m")
    polygon: Polygon = Field(description="outline of the top, corners (x, y)")
    viewpoints: Annotated[tuple[Pose, ...], Field(min_length=1, description="poses from which it is seen whole")]
    aliases: tuple[Name, ...] = Field(default=(), description="other names")
    bin: bool = Field(default=False, description="whether it is a bin for what is thrown away, its rim at `height`")

    def surface(self, name: str) -> Surface:
        """Surface as the skills' own data type; left and right are as seen from the first viewpoint."""
        return Surface(name, self.polygon, self.height, self.viewpoints[0].pose_2d(), self.bin)


class ObjectFacts(Strict):
    """Facts about a class of objects: other names, its categories, the surfaces where such objects usually are."""

    aliases: tuple[Name, ...] = Field(default=(), description="other names")
    categories: tuple[Name, ...] = Field(default=(), description='as in "a drink"')
    usual: tuple[str, ...] = Field(default=(), description="surfaces where it usually is, likeliest first")


class Person(Strict):
    """Person: other names, the usual place, and the exact pose when it is known."""

    at: str = Field(description="the place where they usually are")
    aliases: tuple[Name, ...] = Field(default=(), description="other names")
    pose: Pose | None = Field(default=None, description="exact pose, when it is known")


class TagFacts(Strict):
    """AprilTag of family 36h11 with the side of its black square (m), on an object, at the dock, or on a wall or door.

    For a tag on an object, `on` is the object's class; any other tag has a position and a heading in the world frame.
    """

    id: TagNumber = Field(description="its number in the family")
    size: TagSize = Field(description="side of the black square, m")
    on: str | None = Field(default=None, description="the class of the object that carries it, or `dock`")
    at: tuple[Coordinate, Coordinate, Height] | None = Field(default=None, description="its middle (x, y, z)")
    yaw: Angle = Field(default=0.0, description="direction in which its face looks, radians")

    @model_validator(mode="after")
    def _stands_or_moves(self) -> TagFacts:
        if (self.at is None) is (self.on in (None, DOCK)):
            raise ValueError("give 'at' for a tag at the dock or on a wall, and 'on' alone for one on an object")
        return self


class Knowledge(Strict):
    """All knowledge of one world. Names match without regard to case."""

    robot: RobotFacts = Field(default=RobotFacts(name="Alice"), description="the robot")
    robots: RobotsFile | None = Field(default=None, description="the robots of runs that name none themselves, by name")
    start: Pose = Field(description="its pose at the beginning")
    dock: Pose | None = Field(default=None, description="its pose for charging; without one it cannot charge")
    battery: BatteryFacts = Field(default=BatteryFacts(), description="charge at which it goes to the dock and leaves")
    places: dict[Name, Place] = Field(default_factory=dict, description="the rooms and the named poses by name")
    doors: tuple[Door, ...] = Field(default=(), description="the narrow passages between rooms")
    surfaces: dict[Name, SurfaceFacts] = Field(default_factory=dict, description="flat tops where objects lie, by name")
    things: dict[Name, ObjectFacts] = Field(default_factory=dict, description="the classes of objects by name")
    people: dict[Name, Person] = Field(default_factory=dict, description="the people by name")
    tags: tuple[TagFacts, ...] = Field(default=(), description="the AprilTags that the robot may use")
    zones: dict[Name, ZoneFacts] = Field(default_factory=dict, description="where the robot minds a rule, by name")
    defaults: dict[str, dict[str, str]] = Field(
        default_factory=dict, description="for a task, the room for each class or category when the request names none"
    )

    _file: Path | None = PrivateAttr(default=None)

    @property
    def file(self) -> Path | None:
        """File from which it was loaded, beside which plug-ins find facts of their own; None without a file."""
        return self._file

    def known_tags(self) -> tuple[Tag, ...]:
        """Tags as the skills' own data type."""
        return tuple(Tag(tag.id, tag.size, tag.on, tag.at, tag.yaw) for tag in self.tags)

    def known_zones(self) -> tuple[Zone, ...]:
        """Zones as the skills' own data type, in the file's order."""
        return tuple(facts.zone(name, self.rooms) for name, facts in self.zones.items())

    def with_zones(self, zones: Mapping[str, ZoneFacts]) -> Knowledge:
        """Adds the zones that a mission declares; a zone whose name is taken gets another name."""
        more = {f"{name} (mission)" if name in self.zones else name: facts for name, facts in zones.items()}
        return self.model_copy(update={"zones": {**self.zones, **more}}) if more else self

    @property
    def rooms(self) -> dict[str, tuple[Corner, ...]]:
        """Outlines of the rooms by name."""
        return {name: place.polygon for name, place in self.places.items() if place.polygon is not None}

    @property
    def poses(self) -> tuple[str, ...]:
        """Names of the named poses."""
        return tuple(name for name, place in self.places.items() if place.polygon is None)

    def place(self, name: str) -> str | None:
        """Name in the file of the room, named pose or surface that `name` means; None when `name` is unknown."""
        return _resolve(name, self.places) or _resolve(name, self.surfaces)

    def room(self, place: str) -> str:
        """Room that contains a known place, or is nearest to a named pose or the start; a room contains itself."""
        if place in self.surfaces:
            return self.surfaces[place].place
        rooms, pose = self.rooms, self.start if place == START else self.places[place].pose
        return place if place in rooms else min(rooms, key=lambda name: distance_m(rooms[name], (pose.x, pose.y)))

    @property
    def bins(self) -> tuple[str, ...]:
        """Names of the bins, where objects are thrown away, in the file's order."""
        return tuple(name for name, surface in self.surfaces.items() if surface.bin)

    @property
    def tops(self) -> tuple[str, ...]:
        """Names of the surfaces on which objects lie, all but the bins, in the file's order."""
        return tuple(name for name, surface in self.surfaces.items() if not surface.bin)

    def surfaces_in(self, place: str) -> tuple[str, ...]:
        """Surfaces in a room but its bins, in the file's order; for a surface or bin, only this itself."""
        return tuple(n for n, one in self.surfaces.items() if place == n or (place == one.place and not one.bin))

    def place_pose(self, place: str) -> Pose:
        """Pose of a robot at a known room or named pose, or at a surface (its first viewpoint)."""
        return self.surfaces[place].viewpoints[0] if place in self.surfaces else self.places[place].pose

    def object_name(self, name: str) -> str | None:
        """Name in the file of the class or category that `name` means; None when `name` is unknown.

        "drink except beer and coke" is a category without some of its classes.
        """
        own = _resolve(name, self.things) or next((c for c in self.categories() if c.lower() == name.lower()), None)
        kept, *others = split_exceptions(name)
        if own is None and others:
            return except_for(*map(str, map(self.object_name, (kept, *others)))) if self.classes(name) else None
        return own or _UNNAMED.get(name.lower())

    def classes(self, name: str) -> tuple[str, ...]:
        """Classes that a class, alias or category includes, in the file's order; empty when the name is unknown."""
        known = _resolve(name, self.things)
        kept, *others = split_exceptions(name)
        if known is None and others:
            left_out = [self.classes(one) for one in others]
            return tuple(c for c in self.classes(kept) if all(left_out) and not any(c in each for each in left_out))
        if known is None and self.object_name(name) in _UNNAMED:
            return tuple(self.things)
        return (known,) if known else tuple(c for c, facts in self.things.items() if name.lower() in facts.categories)

    def categories(self) -> tuple[str, ...]:
        """All categories, in the file's order."""
        return tuple(dict.fromkeys(category for facts in self.things.values() for category in facts.categories))

    def usual_surfaces(self, name: str) -> tuple[str, ...]:
        """Surfaces where objects of a class or category usually are, the likeliest first."""
        return tuple(dict.fromkeys(place for c in self.classes(name) for place in self.things[c].usual))

    def person(self, name: str) -> str | None:
        """Name in the file of the person that `name` means; None when `name` is unknown."""
        return _resolve(name, self.people)

    def somebody(self, name: str) -> str | None:
        """Name in the file of the person that `name` means; `ANYBODY` for any person, None for an unknown name."""
        return self.person(name) or (ANYBODY if name.lower() == ANYBODY else None)

    def named(self, kind: Part) -> tuple[str, ...]:
        """Names of the people, rooms or places that a part of a task may be; none for another kind of part."""
        people = (ANYBODY, SPEAKER, *self.people)
        return {Part.PERSON: people, Part.ROOM: (*self.rooms,), Part.PLACE: self.place_names()}.get(kind, ())

    def rooms_to_search(self, person: str, place: str | None) -> tuple[str, ...]:
        """Rooms in which to look for a person: the place's room, or all rooms, the person's usual room first."""
        if place is not None:
            return (self.room(place),)
        usual = (self.room(self.people[person].at),) if person in self.people else ()
        return tuple(dict.fromkeys((*usual, *self.rooms)))

    def default_place(self, task: Task | None, name: str) -> str | None:
        """Place for `task` on an object of a class or category when the speaker names no place.

        The table of defaults decides first, by the task or else by grasp, and by the class or else by its categories;
        if it has no entry, the room where the objects usually are is taken.
        """
        words = [name, *(category for c in self.classes(name) for category in self.things[c].categories)]
        tables = [self.defaults.get(t.word, {}) for t in (task, basic().take) if t is not None]
        said = next((table[word] for table in tables for word in words if word in table), None)
        return said or next((self.room(surface) for surface in self.usual_surfaces(name)), None)

    def object_names(self) -> tuple[str, ...]:
        """Names of all objects: classes, then categories."""
        return (*self.things, *self.categories())

    def place_names(self) -> tuple[str, ...]:
        """Names of all places: rooms and named poses, then surfaces."""
        return (*self.places, *self.surfaces)

    def spellings(self, names: Iterable[str]) -> tuple[str, ...]:
        """Names with all their aliases, from which to guess the meaning of a misspelled name."""
        groups: tuple[Mapping[str, Place | SurfaceFacts | ObjectFacts | Person], ...]
        groups = (self.places, self.surfaces, self.things, self.people)
        aliases = {name: facts.aliases for group in groups for name, facts in group.items()}
        words = (word for name in names for word in (name, *aliases.get(name, ())))
        return tuple(dict.fromkeys(form for word in words for form in (word, *spoken_forms(word))))


@lru_cache(maxsize=4096)
def spoken_forms(name: str) -> tuple[str, ...]:
    """Other forms of a name as it is said, in lower case: "lab 2" and "lab two" for "lab #2", "cafe" for "café"."""
    plain = "".join(c for c in unicodedata.normalize("NFKD", name.lower()) if not unicodedata.combining(c))
    words = re.sub(r"[^\w\s.'-]|_", " ", plain).split()
    numbered = [NUMBERS[int(word)] if word.isdecimal() and int(word) < len(NUMBERS) else word for word in words]
    forms = dict.fromkeys((" ".join(words), " ".join(numbered)))
    return tuple(form for form in forms if form and form != name.lower())


_EXCEPT: Final = " except "


def except_for(kept: str, *left_out: str) -> str:
    """Name of a category without some of its classes: "drink except beer and coke"."""
    return f"{kept}{_EXCEPT}{' and '.join(left_out)}"


def split_exceptions(name: str) -> tuple[str, ...]:
    """Category and the classes that are left out of it; only the name itself if none are."""
    kept, _, left_out = name.partition(_EXCEPT)
    return (kept, *left_out.split(" and ")) if left_out else (name,)


def _resolve(name: str, group: Mapping[str, Place | SurfaceFacts | ObjectFacts | Person]) -> str | None:
    wanted = name.lower()
    own = (known for known in group if known.lower() == wanted)
    alias = (
        known
        for known, facts in group.items()
        if any(wanted in (each.lower(), *spoken_forms(each)) for each in (known, *facts.aliases))
    )
    return next(own, None) or next(alias, None)


def load_knowledge(path: Path | str, own: Collection[str] = ()) -> Knowledge:
    """Reads a world's `knowledge.yaml`; `own` are the names of imported objects, which the file may omit.

    Raises InputError, with file, line and hint, for broken YAML, unknown or missing keys, wrong values, and for names
    that are not defined or mean two things.
    """
    return knowledge_of_source(read_yaml(path), own)


def knowledge_of_source(source: YamlSource, own: Collection[str] = (), below: Knowledge | None = None) -> Knowledge:
    """Reads the knowledge in a parsed document, which may repeat zones from the knowledge `below`.

    Raises InputError like `load_knowledge`.
    """
    knowledge = validate(Knowledge, source)
    for error in _cross_errors(knowledge, source, own):
        raise error
    found = {} if below is None else below.zones
    zones = {name: z if z == found.get(name) else with_files(source, name, z) for name, z in knowledge.zones.items()}
    knowledge = knowledge.model_copy(update={"zones": zones})
    knowledge._file = source.path if below is None else below.file
    return with_own_objects(knowledge, own)


def with_own_objects(knowledge: Knowledge, own: Iterable[str]) -> Knowledge:
    """Adds imported objects by name. Raises InputError if a new name already means another object."""
    new = [name for name in own if name not in knowledge.things]
    for name in new:
        for word in (name, name.replace("_", " ")):
            if (other := knowledge.object_name(word)) is not None:
                what = f"the imported object {name!r} has a name that means {other!r} in this world"
                raise InputError(what, hint="import it under another name")
    facts = {name: ObjectFacts(aliases=(name.replace("_", " "),) if "_" in name else ()) for name in new}
    return knowledge.model_copy(update={"things": {**knowledge.things, **facts}}) if new else knowledge


def _cross_errors(knowledge: Knowledge, source: YamlSource, own: Collection[str]) -> Iterator[InputError]:
    """Yields errors in references between sections of the file."""
    tasks, rooms = [*installed_tasks()], knowledge.rooms
    for name in (knowledge.robot.name, *knowledge.robot.others):
        try:
            check_name(name)
        except InputError as error:
            yield source.error(("robot",), error.message, error.hint)
    for index, door in enumerate(knowledge.doors):
        for side, room in enumerate(door.between):
            yield from _unless_known(source, ("doors", index, "between", side), room, rooms)
            yield from unless_near(source, ("doors", index, "at"), door.at, room, rooms.get(room))
        if len(set(door.between)) == 1:
            what = f"this door has {door.between[0]!r} on both sides"
            yield source.error(("doors", index, "between"), what, "name the two rooms that it joins")
    for name, surface in knowledge.surfaces.items():
        yield from _unless_known(source, ("surfaces", name, "place"), surface.place, rooms)
        at, corner = ("surfaces", name, "polygon"), surface.polygon[0]
        yield from unless_near(source, at, corner, surface.place, rooms.get(surface.place))
        for index, pose in enumerate(surface.viewpoints):
            seen_from = ("surfaces", name, "viewpoints", index)
            yield from unless_near(source, seen_from, (pose.x, pose.y), name, surface.polygon)
    for name, zone in knowledge.zones.items():
        if zone.place is not None:
            yield from _unless_known(source, ("zones", name, "place"), zone.place, knowledge.rooms)
    if knowledge.poses and not knowledge.rooms:
        what = "no place has a polygon, so there is no room around the named poses"
        yield source.error(("places",), what, "give one place the outline of a room")
    for name, person in knowledge.people.items():
        yield from _unless_known(source, ("people", name, "at"), person.at, knowledge.place_names())
    tagged = [tag.on for tag in knowledge.tags if tag.on is not None]
    for name, facts in knowledge.things.items():
        yield from _unless_known(source, ("things", name), name, (*class_forms(), *tagged, *own))
        for index, usual in enumerate(facts.usual):
            yield from _unless_known(source, ("things", name, "usual", index), usual, knowledge.place_names())
    for task, table in knowledge.defaults.items():
        yield from _unless_known(source, ("defaults", task), task, tasks)
        for word, place in table.items():
            yield from _unless_known(source, ("defaults", task, word), word, knowledge.object_names())
            yield from _unless_known(source, ("defaults", task, word), place, knowledge.place_names())
    for index, tag in enumerate(knowledge.tags):
        if tag.on not in (None, DOCK):
            yield from _unless_known(source, ("tags", index, "on"), str(tag.on), (*knowledge.things, DOCK))
        if tag.on == DOCK and knowledge.dock is None:
            yield source.error(("tags", index, "on"), "this world has no dock", "add 'dock', or leave 'on' out")
        if tag.id in (other.id for other in knowledge.tags[:index]):
            yield source.error(("tags", index, "id"), f"tag {tag.id} is listed twice", "print each tag once only")
    yield from _doubles(knowledge, source)


def _unless_known(
    source: YamlSource, path: tuple[str | int, ...], name: str, known: Iterable[str]
) -> Iterator[InputError]:
    names = list(known)
    if name not in names:
        yield source.error(path, f"{name!r} is not known", suggestion(name, names))


def _doubles(knowledge: Knowledge, source: YamlSource) -> Iterator[InputError]:
    """Yields errors for names that mean two things of the same kind."""
    for kinds in (("places", "surfaces"), ("things",), ("people",)):
        seen: dict[str, str] = {}
        for kind in kinds:
            for name, facts in getattr(knowledge, kind).items():
                for word in (form for each in (name, *facts.aliases) for form in (each, *spoken_forms(each))):
                    other = seen.setdefault(word.lower(), name)
                    if other != name:
                        hint = "give one of them another name"
                        yield source.error((kind, name), f"{word!r} means both {other!r} and {name!r}", hint)
