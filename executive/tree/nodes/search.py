"""Looking for an object: which surfaces, in which order, and the subtree that visits them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final

from executive.tree.board import FromBoard, SurfaceOfDetection, pose_beside
from executive.tree.goals import surfaces_to_search
from executive.tree.node import NodeSpec
from executive.tree.plan import PlanBuilder, pose_2d
from executive.words.geometry import inside
from executive.words.knowledge import Knowledge, Pose
from skills.api import Cause, Thing
from skills.files.errors import listing

Ports = Mapping[str, object]

NO_PORTS: Final[Ports] = MappingProxyType({})
MOST_ELSEWHERE: Final = 3
MOST_ASIDE: Final = 2
ASIDE_M: Final = 0.45
_TALLY: Final = "observations"
"""The output port of a look for all that it saw."""


def surfaces_elsewhere(
    knowledge: Knowledge, thing: str, place: str | None, avoided: frozenset[str] = frozenset()
) -> tuple[str, ...]:
    """The surfaces to look at when the object is not in its place: where it usually is, then others of the same room,
    then any others, the nearest first; `MOST_ELSEWHERE` at most, and none that are `avoided`."""
    if place is None:
        return ()
    usual = (name for spot in knowledge.usual_surfaces(thing) for name in knowledge.surfaces_in(spot))
    near = knowledge.surfaces_in(knowledge.room(place))
    inside = knowledge.surfaces_in(place)
    here = knowledge.place_pose(place)
    far = sorted(knowledge.surfaces, key=lambda name: _apart_m(here, knowledge.place_pose(name)))
    others = dict.fromkeys(name for name in (*usual, *near, *far) if name not in {*inside, *avoided})
    return tuple(others)[:MOST_ELSEWHERE]


def _apart_m(one: Pose, other: Pose) -> float:
    """As the crow flies (m)."""
    return math.hypot(one.x - other.x, one.y - other.y)


def look_plans(
    builder: PlanBuilder,
    thing: Thing,
    surfaces: tuple[str, ...],
    key: str,
    extra: Ports = NO_PORTS,
    *,
    tallied: bool = False,
) -> tuple[tuple[str, NodeSpec], ...]:
    """For each surface and viewpoint: drive there and look. The detection goes to `key`; `extra` are detect's.

    With `tallied`, all that a look saw goes to a key of its own (see `tally_of`).
    """
    views = [(name, n) for name in surfaces for n in range(1, len(builder.knowledge.surfaces[name].viewpoints) + 1)]
    return tuple(
        (name, _look_plan(builder.at(f"{name}-{n}"), thing, name, n, key, extra, tallied)) for name, n in views
    )


def tally_of(leaf: NodeSpec) -> str:
    """The blackboard key to which the leaf of a tallied look writes all that it saw."""
    key: str = leaf.options["outputs"][_TALLY]
    return key


def _look_plan(
    builder: PlanBuilder, thing: Thing, surface: str, number: int, key: str, extra: Ports, tallied: bool
) -> NodeSpec:
    view = builder.knowledge.surfaces[surface].viewpoints[number - 1]
    return builder.sequence(
        f"look at {surface}" + (f" ({number})" if number > 1 else ""),
        builder.navigate(pose_2d(view), f"the {surface}"),
        detect_plan(builder, thing, (surface,), key, extra, tallied=tallied),
    )


def people_looks(
    builder: PlanBuilder, person: str, place: str | None, key: str, *, tallied: bool
) -> tuple[tuple[str, NodeSpec], ...]:
    """For each room where a person is looked for: go there and look about; as `look_plans` otherwise.

    Raises InputError: the place is a surface, or one of several people is meant, whom nothing tells apart.
    """
    knowledge = builder.knowledge
    if place in knowledge.surfaces:
        raise builder.error(f"people are looked for in rooms, and '{place}' is none", "name the room")
    if person in knowledge.people and len(knowledge.people) > 1:
        hint = "ask whether anybody is there"
        raise builder.error(f"the robot knows nobody by face, and {person} may be any of several people", hint)
    rooms = knowledge.rooms_to_search(person, place)
    return tuple((room, _look_about_plan(builder.at(room), person, room, key, tallied)) for room in rooms)


def _look_about_plan(builder: PlanBuilder, person: str, room: str, key: str, tallied: bool) -> NodeSpec:
    facts = builder.knowledge.places[room]
    ports = {"area_W": facts.polygon, "place": room, "person": person, "count": 0 if tallied else 1}
    tally = {_TALLY: builder.key("all")} if tallied else {}
    look = builder.skill("find_people", ports, {"observation": key, **tally})
    return builder.sequence(f"look about the {room}", builder.navigate(pose_2d(facts.pose), f"the {room}"), look)


def detect_plan(
    builder: PlanBuilder,
    thing: Thing,
    surfaces: tuple[str, ...] | FromBoard,
    key: str,
    extra: Ports = NO_PORTS,
    *,
    tallied: bool = False,
) -> NodeSpec:
    """Look for the object on some surfaces, by name or from the blackboard, from where the robot stands."""
    where_to_look = surfaces if isinstance(surfaces, FromBoard) else tuple(map(builder.surface, surfaces))
    ports = {"classes": builder.sought(thing.name), "attributes": thing.attributes, "surfaces": where_to_look}
    tally = {_TALLY: builder.key("all")} if tallied else {}
    return builder.skill("detect", {**ports, **extra}, {"observation": key, **tally})


def find_again_plan(builder: PlanBuilder, thing: Thing, surfaces: tuple[str, ...], key: str) -> NodeSpec:
    """When it was seen before: look from here first, where it was seen, and at the floor beside. Else passed over."""
    seen_on = SurfaceOfDetection(key, tuple(map(builder.surface, surfaces)))
    floor = {"floor": True} if builder.has_ports("detect", ("floor",)) else NO_PORTS
    look = detect_plan(builder, thing, seen_on, key, floor)
    return builder.node("only if known", "look from here, if seen before", look, key=key)


def search_plan(builder: PlanBuilder, thing: Thing, place: str | None, key: str, *, anywhere: bool = True) -> NodeSpec:
    """Look from here when it was seen before, else at each surface in turn; the first detection ends the search.

    When it is nowhere in its place, look at some of its surfaces from aside, then, with `anywhere`, at surfaces
    elsewhere. Raises InputError: the place has no surfaces.
    """
    surfaces = required_surfaces(builder, thing, place)
    name = builder.knowledge.thing(thing.name) or thing.name
    elsewhere = (
        surfaces_elsewhere(builder.knowledge, name, place, builder.avoided) if anywhere and builder.anywhere else ()
    )
    looks = look_plans(builder, thing, surfaces, key)
    further = look_plans(builder.at("elsewhere"), thing, elsewhere, key)
    looked = where(builder.knowledge, place) + (f", nor on the {listing(elsewhere)}" if elsewhere else "")
    return builder.node(
        "selector",
        f"find {thing}",
        find_again_plan(builder.at("again"), thing, (*surfaces, *elsewhere), key),
        *(look for _, look in looks),
        *_looks_from_aside(builder, thing, surfaces, key),
        *(look for _, look in further),
        exhausted_cause=Cause.PRECONDITION,
        exhausted_message=f"found no {thing} {looked}",
    )


def _looks_from_aside(builder: PlanBuilder, thing: Thing, surfaces: tuple[str, ...], key: str) -> Iterator[NodeSpec]:
    """Look again at surfaces that have only one viewpoint, from beside it."""
    facts = builder.knowledge.surfaces
    single = [name for name in surfaces if len(facts[name].viewpoints) == 1]
    for name in single[:MOST_ASIDE]:
        room = builder.knowledge.places[facts[name].place].polygon
        view = pose_2d(facts[name].viewpoints[0])
        poses = (pose_beside(view, 0.0, left_m) for left_m in (ASIDE_M, -ASIDE_M))
        aside = next((pose for pose in poses if inside(room, (pose.x_m, pose.y_m))), None)
        if aside is not None:
            below = builder.at(f"{name}-aside")
            look = detect_plan(below, thing, (name,), key)
            yield below.sequence(f"look at {name} from aside", below.navigate(aside, f"the side of the {name}"), look)


def required_surfaces(builder: PlanBuilder, thing: Thing, place: str | None) -> tuple[str, ...]:
    """The surfaces to look at. Raises InputError when there are none."""
    surfaces = surfaces_to_search(builder.knowledge, builder.knowledge.thing(thing.name) or thing.name, place)
    if not surfaces:
        raise builder.error(f"'{place}' has no surface to look at", "add one under 'surfaces' in the knowledge file")
    return surfaces


def where(knowledge: Knowledge, place: str | None) -> str:
    """The place as the end of a sentence: in a room, on a surface."""
    if place is None:
        return "anywhere"
    return f"{'on' if place in knowledge.surfaces else 'in'} the {place}"
