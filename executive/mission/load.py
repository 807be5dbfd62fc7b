"""Reads mission files, with parameters and the locations of steps, and stack files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from pydantic import BaseModel

from executive.mission.parameters import Given, with_parameters
from executive.words.knowledge import Knowledge, knowledge_of_source
from executive.words.mission import Mission, Route, Stop
from executive.words.outlines import Corner
from executive.words.step import Place, Step
from skills.inputs.errors import Problems, suggestion
from skills.inputs.schema import validate
from skills.inputs.yaml_source import KeyPath, YamlSource, parse_yaml, read_yaml
from skills.stack import RobotStack, StackError, default_stack, stack_of

_NONE_GIVEN: Final[Given] = MappingProxyType({})
_KEY: Final = "knowledge"
_ROBOTS: Final = "robots"


def load_mission(path: Path | str, parameters: Given = _NONE_GIVEN, text: str | None = None) -> Mission:
    """Reads a mission file, or its `text`, and replaces its parameters.

    Raises:
        InputError: with file, line and hint, for broken YAML, unknown keys, wrong values and unknown parameters.
    """
    source = read_yaml(path) if text is None else parse_yaml(text, Path(path))
    document = with_parameters(source, parameters)
    mission = validate(Mission, document).with_place(Place(document))
    locate(mission, document, ())
    return mission


def locate(value: Any, document: YamlSource, path: KeyPath) -> None:
    """Sets the location of each step in a value that was read from `path` in a document."""
    if isinstance(value, Step):
        value._place = Place(document, path)
    if isinstance(value, BaseModel):
        for name, field in type(value).model_fields.items():
            locate(getattr(value, name), document, (*path, field.alias or name))
    elif isinstance(value, tuple):
        for index, part in enumerate(value):
            locate(part, document, (*path, index))
    elif isinstance(value, Mapping):
        for key, part in value.items():
            locate(part, document, (*path, key))


def mission_of_robot(mission: Mission, robot: str, part: str | None = None) -> Mission:
    """Returns the mission for one of several robots: the part named `part`, or all steps if there are no parts."""
    own = None if part is None or mission.parts is None else mission.parts[part]
    laid_over = {} if own is None else {key: getattr(own, key) for key in own.model_fields_set - {"after"}}
    alone = mission.model_copy(update={**laid_over, "robot": robot, "robots": None, "parts": None})
    document = mission.document
    if own is None or part is None or document is None:
        return alone
    return alone.with_place(Place(document, ("parts", part), part=True))


def import_folders(mission: Mission) -> tuple[Path, ...]:
    """Folders that a mission imports."""
    folder = Path() if mission.document is None else mission.document.path.parent
    return tuple(folder / each for each in mission.imports or ())


def routes_of_people(mission: Mission, knowledge: Knowledge) -> dict[str, Route]:
    """Returns the routes of a mission's people by name, with each place replaced by a point.

    Raises InputError with the line in the file when a place is unknown.
    """
    problems, routes = Problems(), dict[str, Route]()
    for name, route in (mission.people or {}).items():
        stops = []
        for index, waypoint in enumerate(route.waypoints):
            stop = waypoint if isinstance(waypoint, Stop) else Stop(at=waypoint, pause=0.0)
            with problems:
                path = ("people", name, "waypoints", index)
                stops.append(Stop(at=_point(mission, path, stop.at, knowledge), pause=stop.pause))
        routes[name] = route.model_copy(update={"waypoints": tuple(stops)})
    problems.raise_any()
    return routes


def _point(mission: Mission, path: tuple[str | int, ...], at: Corner | str, knowledge: Knowledge) -> Corner:
    if not isinstance(at, str):
        return at
    place = knowledge.place(at)
    if place is None:
        hint = suggestion(at, knowledge.spellings(knowledge.place_names()), "give a point [x, y]")
        raise mission.error(path, f"unknown place {at!r}", hint)
    pose = knowledge.place_pose(place)
    return pose.x, pose.y


def knowledge_of_mission(mission: Mission, knowledge: Knowledge) -> Knowledge:
    """Merges the knowledge in a mission file into the knowledge of its world.

    Mappings are merged key by key; lists and single values are replaced.

    Raises InputError with the line in the mission file when the result is not valid knowledge.
    """
    document = mission.document
    if not mission.knowledge or document is None:
        return knowledge
    if _ROBOTS in mission.knowledge:
        what = "the robots of a mission do not stand in its knowledge"
        raise mission.error((_KEY, _ROBOTS), what, "write 'robots' at the top of the file")
    merged = _merged(knowledge.model_dump(mode="json", exclude_none=True), mission.knowledge)
    return knowledge_of_source(document.below((_KEY,), merged), tuple(knowledge.things), knowledge)


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    both = {
        key: _merged(below[key], value) if isinstance(value, dict) and isinstance(below.get(key), dict) else value
        for key, value in above.items()
    }
    return {**below, **both}


def load_stack(path: Path | None) -> RobotStack:
    """Reads the stack in a file, or the default stack. Raises InputError with file and line when the file is wrong."""
    if path is None:
        return default_stack()
    source = read_yaml(path)
    try:
        return stack_of({} if source.data is None else source.data, path.parent)
    except StackError as error:
        raise source.error(error.path, str(error), error.hint) from error
