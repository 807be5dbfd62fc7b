"""JSON schema of mission files with the installed tasks, and the keys in it that hold steps."""

from __future__ import annotations

import json
from functools import cache
from typing import Any, Final

from executive.words.mission import Mission
from executive.words.steps import add_tasks

_STEP: Final = '"#/$defs/AnyStep"'


@cache
def mission_schema() -> dict[str, Any]:
    """Returns the JSON schema of mission files, with the keys of installed tasks."""
    schema: dict[str, Any] = Mission.model_json_schema(by_alias=True)
    add_tasks(schema["$defs"]["Do"])
    return schema


@cache
def step_list_keys() -> frozenset[str]:
    """Returns the keys whose values are lists of steps, or such lists by name."""
    return _keys_that_hold(_STEP)


@cache
def inner_keys() -> frozenset[str]:
    """Returns the keys whose values have keys with lists of steps, such as `when`."""
    schema, found = mission_schema(), set[str]()
    for name, part in schema["$defs"].items():
        is_step = {"$ref": f"#/$defs/{name}"} in schema["$defs"]["AnyStep"]["anyOf"]
        if not is_step and name != "AnyStep" and _STEP in json.dumps(part):
            found |= _keys_that_hold(f'"#/$defs/{name}"')
    return frozenset(found)


def _keys_that_hold(reference: str) -> frozenset[str]:
    schema = mission_schema()
    parts = [schema, *schema["$defs"].values()]
    pairs = [(key, value) for part in parts for key, value in part.get("properties", {}).items()]
    return frozenset(key for key, value in pairs if reference in json.dumps(value))
