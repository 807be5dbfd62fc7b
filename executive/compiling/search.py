"""Looking for a thing: which surfaces, in which order, and the subtree that visits them."""

from __future__ import annotations

from executive.behaviours.board import FromBoard
from executive.command import Thing
from executive.compiling.plans import NodePlan, SelectorPlan, SequencePlan
from executive.compiling.recovery import OnlyIfKnownPlan
from executive.compiling.workshop import Workshop, pose_2d
from executive.knowledge import Knowledge
from skills.api import Cause


def surfaces_to_search(knowledge: Knowledge, thing: str, place: str | None) -> tuple[str, ...]:
    """The surfaces to look at, those where the thing usually is first; without a place, all that there are.

    A usual place may be a room: then its surfaces count as usual.
    """
    inside = tuple(knowledge.surfaces) if place is None else knowledge.surfaces_in(place)
    usual = (name for spot in knowledge.usual_surfaces(thing) for name in knowledge.surfaces_in(spot))
    return tuple(dict.fromkeys((*(name for name in usual if name in inside), *inside)))


def look_plans(
    shop: Workshop, thing: Thing, surfaces: tuple[str, ...], key: str
) -> tuple[tuple[str, SequencePlan], ...]:
    """For each surface and viewpoint: drive there and look. The sighting goes to `key`."""
    views = [(name, n) for name in surfaces for n in range(1, len(shop.knowledge.surfaces[name].viewpoints) + 1)]
    return tuple((name, _look_plan(shop.at(f"{name}-{n}"), thing, name, n, key)) for name, n in views)


def _look_plan(shop: Workshop, thing: Thing, surface: str, number: int, key: str) -> SequencePlan:
    view = shop.knowledge.surfaces[surface].viewpoints[number - 1]
    return shop.sequence(
        f"look at {surface}" + (f" ({number})" if number > 1 else ""),
        shop.navigate(pose_2d(view)),
        detect_plan(shop, thing, (surface,), key),
    )


def detect_plan(shop: Workshop, thing: Thing, surfaces: tuple[str, ...], key: str) -> NodePlan:
    """Look for the thing on some surfaces from where the robot stands."""
    ports = {
        "classes": shop.classes(thing.name),
        "attributes": thing.attributes,
        "surfaces": tuple(map(shop.surface, surfaces)),
    }
    return shop.skill("detect", ports, {"observation": key})


def find_again_plan(shop: Workshop, thing: Thing, surfaces: tuple[str, ...], key: str) -> NodePlan:
    """When it was seen before: look from here first. Else passed over."""
    return OnlyIfKnownPlan(
        path_id=shop.path_id,
        name="look from here, if seen before",
        source=shop.source,
        child=detect_plan(shop, thing, surfaces, key),
        key=key,
    )


def search_plan(shop: Workshop, thing: Thing, place: str | None, key: str) -> SelectorPlan:
    """Look from here when it was seen before, else at each surface in turn; the first sighting ends the search.

    Raises:
        InputError: the place has no surfaces.
    """
    surfaces = required_surfaces(shop, thing, place)
    looks = tuple(look for _, look in look_plans(shop, thing, surfaces, key))
    return SelectorPlan(
        path_id=shop.path_id,
        name=f"find {thing}",
        source=shop.source,
        steps=(find_again_plan(shop.at("again"), thing, surfaces, key), *looks),
        exhausted_cause=Cause.PRECONDITION,
        exhausted_message=f"found no {thing} {where(place)}",
    )


def required_surfaces(shop: Workshop, thing: Thing, place: str | None) -> tuple[str, ...]:
    """The surfaces to look at. Raises InputError when there are none."""
    surfaces = surfaces_to_search(shop.knowledge, shop.knowledge.thing(thing.name) or thing.name, place)
    if not surfaces:
        raise shop.error(f"'{place}' has no surface to look at", "add one under 'surfaces' in the knowledge file")
    return surfaces


def where(place: str | None) -> str:
    """The place as the end of a sentence."""
    return "anywhere" if place is None else f"in the {place}"


def sighting(key: str) -> FromBoard:
    """The port value that a search has written."""
    return FromBoard(key)
