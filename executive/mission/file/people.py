"""The key `people` of a mission file: who walks where while the mission runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from executive.words.knowledge import Corner, Knowledge
from skills.files.errors import Problems, suggestion
from skills.files.schema import Name
from skills.quantities import Delay, Speed

if TYPE_CHECKING:
    from executive.mission.file.schema import MissionFile

__all__ = ["RouteFile", "StopFile", "routes_in"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class StopFile(_Strict):
    """A waypoint at which the person stands for a while."""

    at: Corner | Name = Field(description="A point (x, y) in metres, or a place by its name.")
    pause: Delay = Field(0.0, description="How long the person stands there, in seconds.")


class RouteFile(_Strict):
    """A route on which a person walks, around walls and furniture."""

    waypoints: Annotated[tuple[Corner | Name | StopFile, ...], Field(min_length=1)] = Field(
        description="Points (x, y) in metres or names of places, in order; the person begins at the first."
    )
    speed: Speed = Field(1.2, description="How fast the person walks, in m/s.")
    loop: StrictBool = Field(False, description="Whether the first waypoint follows the last; by default, once.")
    start: Delay = Field(0.0, description="When the person sets off, in seconds from the beginning.")
    yields: StrictBool = Field(True, description="Whether the person stops for a robot that is close ahead.")


def routes_in(file: MissionFile, knowledge: Knowledge) -> dict[str, Mapping[str, Any]]:
    """The routes of a mission's people by name, as values in which every place is a point.

    Raises:
        InputError: a place is not known; with the line in the file.
    """
    problems, routes = Problems(), dict[str, Mapping[str, Any]]()
    for name, route in (file.people or {}).items():
        stops = []
        for index, waypoint in enumerate(route.waypoints):
            stop = waypoint if isinstance(waypoint, StopFile) else StopFile(at=waypoint, pause=0.0)
            with problems:
                path = ("people", name, "waypoints", index)
                stops.append({"at": _point(file, path, stop.at, knowledge), "pause": stop.pause})
        routes[name] = {**route.model_dump(exclude={"waypoints"}), "waypoints": stops}
    problems.raise_any()
    return routes


def _point(file: MissionFile, path: tuple[str | int, ...], at: Corner | str, knowledge: Knowledge) -> Corner:
    if not isinstance(at, str):
        return at
    place = knowledge.place(at)
    if place is None:
        hint = suggestion(at, knowledge.spellings(knowledge.place_names()), "give a point [x, y]")
        raise file.error(path, f"unknown place {at!r}", hint)
    pose = knowledge.place_pose(place)
    return pose.x, pose.y
