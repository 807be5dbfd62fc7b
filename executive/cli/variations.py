"""Puts a variation into a request's world and plant."""

from __future__ import annotations

from executive.cli.requests import Prepared
from executive.mission.request import Request
from plant.variation import Variation
from plant.worlds.clutter import with_passers_by
from plant.worlds.lights import LIGHTS, Light, light_of
from plant.worlds.world import World, WorldError
from skills.files.errors import InputError, suggestion

__all__ = ["plant_variation", "with_people"]


def with_people(world: World, request: Request) -> World:
    """The world with the people of the request's variation. Raises InputError: the light is none, or none fits."""
    _light(request.variation.light)
    try:
        return with_passers_by(world, request.variation.people, request.seed)
    except WorldError as error:
        raise InputError(str(error), hint="take --people out") from error


def plant_variation(prepared: Prepared) -> Variation:
    """The variation for the plant: clutter is of classes that the mission does not speak of."""
    varied, spared = prepared.request.variation, set[str]()
    for command in prepared.tree.commands:
        for thing in (command.item, command.object):
            name = None if thing is None else thing.name
            spared |= set() if name is None else set(prepared.knowledge.classes(prepared.knowledge.thing(name) or name))
    return Variation(_light(varied.light), varied.clutter, frozenset(spared), varied.friction)


def _light(words: str) -> Light:
    try:
        return light_of(words)
    except ValueError as error:
        hint = suggestion(words, LIGHTS, f"known are {', '.join(LIGHTS)}, or give a brightness of 0 to 5")
        raise InputError(f"unknown light '{words[:40]}'", hint=hint) from error
