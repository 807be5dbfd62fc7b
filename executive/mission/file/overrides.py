"""The key `knowledge` of a mission file, laid over what is known of the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from executive.mission.file.schema import MissionFile
from executive.words.knowledge import Knowledge, knowledge_of_source
from skills.files.yaml_source import YamlSource

__all__ = ["overridden"]

_KEY: Final = "knowledge"
_ROBOTS: Final = "robots"


def overridden(file: MissionFile, knowledge: Knowledge) -> Knowledge:
    """The world's knowledge with the file's own laid over it; doing so twice changes nothing more.

    Mappings are merged key by key; lists and single values are replaced.

    Raises:
        InputError: the result is not valid knowledge; with the line in the mission file.
    """
    if not file.knowledge or file.source is None:
        return knowledge
    if _ROBOTS in file.knowledge:
        what = "the robots of a mission do not stand in its knowledge"
        raise file.error((_KEY, _ROBOTS), what, "write 'robots' at the top of the file")
    merged = _merged(knowledge.model_dump(mode="json", exclude_none=True), file.knowledge)
    lines = {path[1:]: line for path, line in file.source.lines.items() if path[0] == _KEY and len(path) > 1}
    return knowledge_of_source(
        YamlSource(file.source.path, merged, lines, first_line=file.source.line((_KEY,))),
    )


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    both = {
        key: _merged(below[key], value) if isinstance(value, dict) and isinstance(below.get(key), dict) else value
        for key, value in above.items()
    }
    return {**below, **both}
