"""Filled examples of all kinds of steps, made of the schema of mission files, with names of a world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from errand_studio.mission_schema import mission_schema
from executive.words.knowledge import Knowledge
from executive.words.steps import STEP_KEYS
from executive.words.task import Part, installed_tasks
from skills.inputs.yaml_source import yaml_of

_REF: Final = "#/$defs/"
_STEP: Final = "AnyStep"


@dataclass(frozen=True)
class Example:
    """Step that the palette offers: its key, a sentence, and its YAML as an item of a list."""

    key: str
    about: str
    text: str


@dataclass(frozen=True)
class Names:
    """Names of a world for examples: places of the robot, an object, a person, a surface, two rooms with a door."""

    places: Sequence[str]
    objects: Sequence[str]
    people: Sequence[str]
    surfaces: Sequence[str]
    doors: Sequence[Sequence[str]]

    @classmethod
    def of(cls, knowledge: Knowledge) -> Names:
        """Returns the names that a knowledge file has."""
        doors = [tuple(door.between) for door in knowledge.doors]
        return cls([*knowledge.rooms], [*knowledge.things], [*knowledge.people], [*knowledge.surfaces], doors)


def examples(names: Names) -> list[Example]:
    """Returns an example of each kind of step, in the order of the schema, and of each installed task."""
    schema = mission_schema()
    found = list[Example]()
    for kind in schema["$defs"][_STEP]["anyOf"]:
        if _REF not in kind.get("$ref", ""):
            continue
        part = _resolved(kind)
        about = str(part.get("description", "")).split("\n")[0]
        if "to" in part["properties"]:
            found += [_task_example(word, names) for word in ("to", *installed_tasks())]
            continue
        own = [key for key in part["properties"] if key not in _policy_keys()]
        keys = list(part.get("required") or own[:1]) + [key for key in own if key == "else"]
        keys = list(dict.fromkeys(keys))
        key = next(each for each in own if each in keys)
        found.append(Example(key, about, _item({each: _value(each, part["properties"][each], names) for each in keys})))
    return found


@cache
def _policy_keys() -> frozenset[str]:
    """Returns the keys that steps of every kind have."""
    parts = [_resolved(each) for each in mission_schema()["$defs"][_STEP]["anyOf"] if "$ref" in each]
    return frozenset.intersection(*(frozenset(part["properties"]) for part in parts))


def _item(step: Mapping[str, Any]) -> str:
    """Writes a step as people do: a command in one line, a block with a line for each key and each inner step."""
    if not any(isinstance(value, list) for value in step.values()) and len(step) > 1 and "ask" not in step:
        return f"- {_flow(step)}"
    lines = list[str]()
    for key, value in step.items():
        inner = value if isinstance(value, list) else []
        lines += [f"{key}:", *(f"  - {_flow(each, braces=False)}" for each in inner)] if inner else []
        lines += [] if inner else [f"{key}: {_flow(value)}"]
    return "- " + "\n  ".join(lines)


def _flow(value: Any, *, braces: bool = True) -> str:
    text = yaml_of(value, flow_style=True, width=1_000).removesuffix("\n").removesuffix("\n...")
    return text if braces else text.removeprefix("{").removesuffix("}")


def _task_example(word: str, names: Names) -> Example:
    """Returns the example of going somewhere, or of a task."""
    place = names.places[0] if names.places else "start"
    if word == "to":
        return Example("to", "Goes to a place, a person or the start.", _item({"to": place}))
    task = installed_tasks()[word]
    about = str(type(task).__doc__ or "").split("\n")[0]
    if task.samples and (task.answers or task.object_is is Part.TEXT):  # only words say what is meant
        return Example(word, about, _item({"say": task.samples[0]}))
    step: dict[str, Any] = {"do": word}
    known = {Part.PERSON: names.people, Part.THING: names.objects, Part.TIME: ("10 s",), Part.NUMBER: (2,)}
    if task.goal_is is not Part.NOTHING:
        step = {"to": (names.surfaces or (place,))[0] if task.object_is is Part.THING else place, **step}
    if task.object_is is not Part.NOTHING:
        step["object"] = next(iter(known.get(task.object_is, ())), "anything")
    key = f"do {word}" if word in STEP_KEYS else word
    return Example(key, about, _item(step))


def _resolved(schema: Mapping[str, Any]) -> Mapping[str, Any]:
    while "$ref" in schema:
        schema = mission_schema()["$defs"][schema["$ref"].removeprefix(_REF)]
    return schema


def _value(key: str, schema: Mapping[str, Any], names: Names) -> Any:
    """Returns a value that fits a part of the schema: a name of the world where the key asks for one."""
    known: Mapping[str, Any] = {
        "say": f"go to the {names.places[-1]}" if names.places else "go to the start",
        "speak": "Here I am.",
        "ask": "Shall I go on?",
        "choices": {"yes": None, "no": None},
        "skill": "stow",
        "use": "other.yaml",
        "set": {"count": 1},
        "wait": {"seconds": 5},
        "repeat": {"times": 2},
        "open": {"door": list(names.doors[0])} if names.doors else {"door": ["hall", "kitchen"]},
        "picture": {"of": names.surfaces[0] if names.surfaces else "start"},
        "dock": {"level": 0.9},
    }
    if key in known:
        return known[key]
    schema = _resolved(schema)
    options = [_resolved(each) for each in schema.get("anyOf", [schema])]
    if any(each.get("type") == "array" for each in options):
        array = next(each for each in options if each.get("type") == "array")
        steps = [{"speak": "Here I am."}, {"to": names.places[0] if names.places else "start"}]
        return steps[: max(1, int(array.get("minItems", 1)))]
    return "battery > 0.3"
