"""Zones in the knowledge of a world of the user's own: added and removed; comments in the file stay."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from errand_make.worlds.furnish import with_entry, without_entry
from errand_make.worlds.site import Site, restored
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.zone import ZoneFacts
from skills.api import Zone
from skills.inputs.errors import InputError, suggestion
from skills.inputs.schema import first_error


def add_zone(folder: Path, name: str, facts: Mapping[str, Any]) -> Zone:
    """Adds a zone with the facts of the knowledge file, without those that are None; `place` may be any name of a room.

    Raises InputError when the world or the facts are wrong, and leaves the files unchanged.
    """
    site = Site.open(folder)
    given = {key: value for key, value in facts.items() if value is not None}
    if "place" in given:
        given["place"] = site.room(given["place"])
    try:
        ZoneFacts.model_validate(given)
    except ValidationError as error:
        where, what, _ = first_error(error.errors())
        hint = "see `errand world zone add --help`"
        raise InputError(": ".join((*map(str, where), what)), hint=hint) from error
    file = folder / "knowledge.yaml"
    with restored(folder):
        file.write_text(with_entry(file, "zones", name, given), encoding="utf-8")
    (made,) = (each for each in knowledge_of(open_world(str(folder))).known_zones() if each.name == name)
    return made


def remove_zone(folder: Path, name: str) -> None:
    """Removes a zone. Raises InputError when there is none, or the file's form does not allow it."""
    site = Site.open(folder)
    if name not in (zones := site.facts.zones):
        hint = suggestion(name, zones) if zones else "it has no zones"
        raise InputError(f"there is no zone '{name}'", hint=hint, file=folder)
    file = folder / "knowledge.yaml"
    with restored(folder):
        file.write_text(without_entry(file, "zones", name), encoding="utf-8")
