"""Stack of a robot: its localiser, costmap, planners, controller, detector and locomotion, with their options.

A component fills each slot. It is a frozen dataclass that a distribution registers as an entry point in the slot's
group (`SLOTS`); the project's own are registered in `pyproject.toml` in the same form. Its fields are the options that
a stack file may set, its docstring explains them, and it implements the slot's protocol below.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, get_type_hints

from skills.inputs.errors import InputError, suggestion
from skills.inputs.outside import is_file, is_there
from skills.inputs.plugins import (
    OURS,
    STACKS,
    PluginDefect,
    distribution_of,
    installed_plugins,
    missing_plugin,
    package_folder,
    run_plugin,
)
from skills.inputs.schema import first_error
from skills.quantities import display_text

if TYPE_CHECKING:
    from skills.detection import DetectorComponent
    from skills.grid_map import CostmapComponent, LocaliserComponent
    from skills.path import ControllerComponent, GlobalPlanner
    from skills.robot import RobotBackend

SLOTS: Final[Mapping[str, str]] = {
    "localiser": "errand.localisers",
    "costmap": "errand.costmaps",
    "planner": "errand.planners",
    "controller": "errand.controllers",
    "arm_planner": "errand.arm_planners",
    "grasp_planner": "errand.grasp_planners",
    "detector": "errand.detectors",
    "locomotion": "errand.locomotions",
}
"""Slots of a stack file, each with its entry-point group."""
SKILLS: Final = "skills"
SKILL_GROUP: Final = "errand.skills"
USE, ALSO_USE = "use", "name"
DOORS: Final = "errand.doors"
"""Entry-point group of the plug-ins that open doors (`skills.doorway.DoorOpener`)."""
BACKENDS: Final = "errand.backends"
"""Entry-point group of the backends that drive robots; an entry's name is the URL scheme, as in `spot://HOST`."""
PLUGIN: Final = "plugin"
DEFAULT_FILE: Final = Path(__file__).with_name("default_stack.yaml")


@dataclass(frozen=True)
class RobotStack:
    """Components of one robot, their `names` by slot, and the options of its `skills` by skill name."""

    localiser: LocaliserComponent
    costmap: CostmapComponent
    planner: GlobalPlanner
    controller: ControllerComponent
    arm_planner: Any
    grasp_planner: Any
    detector: DetectorComponent
    locomotion: Any
    names: Mapping[str, str]
    skills: Mapping[str, Any] = field(default_factory=dict)


class StackError(ValueError):
    """Error in a stack file: the `path` of keys to it, what is wrong, and a `hint` at what would fit."""

    def __init__(self, path: tuple[str | int, ...], message: str, hint: str = "") -> None:
        words = [str(each) for each in path if f"a{each}".isidentifier()]  # no kinds, nor the text of a foreign file
        super().__init__(f"{'.'.join(words) or 'the stack'}: {message}")
        self.path, self.message, self.hint = path, message, hint


@cache
def default_stack() -> RobotStack:
    """Returns the stack that the project provides as default."""
    return stack_of(_default_data())


@cache
def _default_data() -> dict[str, Any]:
    from skills.inputs.yaml_source import read_yaml

    data: dict[str, Any] = read_yaml(DEFAULT_FILE).data
    return data


def default_component(slot: str) -> Any:
    """Returns the component that fills a slot in the default stack, without importing those of the other slots."""
    return _component(slot, _default_data()[slot])[1]


def stack_file(given: Path) -> Path:
    """Path of a stack file: the given path, or the file that the project or a plug-in registers by that name.

    Raises InputError for an unknown name.
    """
    if given != Path(given.name) or given.suffix or is_file(given):
        return given
    found = {each.name: each for each in installed_plugins(STACKS)}
    if given.name in found:
        return package_folder(found[given.name]) / f"{given.name}_stack.yaml"
    own = DEFAULT_FILE.with_name(f"{given.name}_stack.yaml")
    if is_there(given) or is_file(own):
        return own if is_file(own) else given
    raise InputError(f"there is no stack '{given.name[:60]}'", hint=suggestion(given.name, ("default", *found)))


def stack_of(data: Any, folder: Path = Path()) -> RobotStack:
    """Builds a stack from a file's data, with defaults for missing slots. Raises StackError for invalid data.

    Relative paths among the options count from `folder`.
    """
    _known((), data, (*SLOTS, SKILLS))
    chosen = {slot: data.get(slot, {}) for slot in SLOTS}
    parts = {slot: _component(slot, given) for slot, given in chosen.items()}
    skills = data.get(SKILLS) or {}
    if not isinstance(skills, Mapping):
        _known((SKILLS,), skills, sorted(skill_options()))
    options = {name: _options(name, given) for name, given in skills.items()}
    return RobotStack(
        **{slot: _located(part, folder) for slot, (_, part) in parts.items()},
        names={slot: name for slot, (name, _) in parts.items()},
        skills=options,
    )


def _located(part: Any, folder: Path) -> Any:
    """Returns a component whose options that are relative paths count from a folder."""
    options = {field.name: getattr(part, field.name) for field in dataclasses.fields(part) if field.init}
    paths: dict[str, Any] = {name: folder / value for name, value in options.items() if isinstance(value, Path)}
    for name, value in options.items():
        if isinstance(value, tuple) and any(isinstance(each, Path) for each in value):
            paths[name] = tuple(folder / each for each in value)
    return dataclasses.replace(part, **paths)


def _component(slot: str, given: Any) -> tuple[str, Any]:
    """Returns the name and the component of one slot. Raises StackError when name or options are invalid."""
    if not isinstance(given, Mapping):
        raise StackError((slot,), "should be a mapping", f"write '{slot}: {{{USE}: NAME}}', then the options")
    if USE not in given and ALSO_USE in given:
        given = {USE if key == ALSO_USE else key: value for key, value in given.items()}
    name = given.get(USE, _default_data()[slot][USE])
    return name, _typed((slot,), component_of(slot, name), {key: each for key, each in given.items() if key != USE})


def component_of(slot: str, name: Any) -> type:
    """Returns the component of a slot by its name. Raises StackError when it is not installed or cannot load."""
    if name in (known := _names(slot)):
        return _loaded(slot, name, SLOTS[slot])
    unknown = f"there is no {slot} {display_text(name)}", suggestion(str(name), known)
    raise StackError((slot, USE), *(missing_plugin(SLOTS[slot], str(name)) or unknown))


@cache
def components(slot: str) -> Mapping[str, type]:
    """Returns the installed components of a slot by name, the default first. Raises StackError when one cannot load."""
    return MappingProxyType({name: _loaded(slot, name, SLOTS[slot]) for name in _names(slot)})


def door_opener(given: Mapping[str, Any]) -> Any:
    """Returns the plug-in that `plugin` names, with its options. Raises StackError when it cannot be used."""
    known = sorted({entry.name for entry in installed_plugins(DOORS)})
    name = given.get(PLUGIN)
    if name not in known:
        raise StackError((PLUGIN,), f"no plug-in {display_text(name)} opens doors", suggestion(str(name), known))
    options = {key: value for key, value in given.items() if key != PLUGIN}
    return _typed((), _loaded(PLUGIN, str(name), DOORS), options)


def robot_backend(scheme: str, given: Mapping[str, Any]) -> RobotBackend:
    """Returns the backend of a URL scheme. Raises StackError unless one plug-in provides it and takes the options."""
    known = [entry.name for entry in installed_plugins(BACKENDS)]
    if known.count(scheme) != 1:
        several = scheme in known
        what = f"{'several plug-ins drive' if several else 'no plug-in drives'} robots of '{scheme[:60]}://'"
        hint = "uninstall all but one; errand plugins names them" if several else suggestion(scheme, sorted(known))
        raise StackError((), what, hint)
    backend: RobotBackend = _typed((), _loaded(scheme, scheme, BACKENDS), given)
    for key in (key for key, value in given.items() if value is True and getattr(backend, key) is not True):
        raise StackError((key,), "has no value", f"write {key}=VALUE")
    return backend


def _names(slot: str) -> list[str]:
    first = _default_data()[slot][USE]
    names = {entry.name for entry in installed_plugins(SLOTS[slot])}
    return sorted(names, key=lambda name: (name != first, name))


@cache
def _loaded(slot: str, name: str, group: str) -> type:
    entry = max(installed_plugins(group).select(name=name), key=_is_ours)
    try:
        component: type = run_plugin(entry, entry.load)
    except PluginDefect as defect:
        what = f"cannot load {entry.value} of distribution {distribution_of(entry)} ({defect})"
        raise StackError((slot,), what, "repair or uninstall that distribution") from defect
    if not is_frozen_dataclass(component):
        raise StackError((slot,), f"{entry.value} is no frozen dataclass", "put @dataclass(frozen=True) above it")
    return component


def is_frozen_dataclass(component: Any) -> bool:
    """Returns whether a component is a frozen dataclass, as every class of options must be."""
    return isinstance(component, type) and bool(
        getattr(getattr(component, "__dataclass_params__", None), "frozen", False)
    )


def _is_ours(entry: EntryPoint) -> bool:
    """Returns whether this project's distribution provides an entry point; its names take precedence."""
    return distribution_of(entry) == OURS


def skill_options() -> Mapping[str, type]:
    """Returns the options class of each installed skill that can be loaded and has options."""
    found = {name: _options_of(name) for name in sorted({entry.name for entry in installed_plugins(SKILL_GROUP)})}
    return MappingProxyType({name: kind for name, kind in found.items() if kind is not None})


def option_kinds() -> Mapping[str, Sequence[tuple[str, type]]]:
    """Returns headings and options classes by the name of a slot, of a component or of a skill; all stand under ""."""
    kinds = [((slot, use), kind) for slot in SLOTS for use, kind in components(slot).items()]
    kinds += [((SKILLS, name), kind) for name, kind in skill_options().items()]
    names = ("", *(name for keys, _ in kinds for name in keys))
    return {name: [(" ".join(keys), kind) for keys, kind in kinds if name in ("", *keys)] for name in names}


def option_fields(record: type, prefix: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yields name, type and default of each field; the fields of an inner dataclass follow with its name and a dot."""
    for each in dataclasses.fields(record):
        value = each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
        if dataclasses.is_dataclass(value):
            yield from option_fields(type(value), f"{prefix}{each.name}.")
        else:
            hint = get_type_hints(record, include_extras=True)[each.name]
            yield f"{prefix}{each.name}", hint, "required" if value is dataclasses.MISSING else value


@cache
def _options_of(name: str) -> type | None:
    """Returns the options class of an installed skill; None when it has no options or cannot be loaded."""
    entry = max(installed_plugins(SKILL_GROUP).select(name=name), key=_is_ours)
    try:
        kind = getattr(run_plugin(entry, entry.load), "Options", None)
    except PluginDefect:
        return None
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return None
    return kind if dataclasses.fields(kind) else None


def _options(name: str, given: Any) -> Any:
    """Returns a skill's options in a stack. Raises StackError when the skill has none or cannot be loaded."""
    entries = installed_plugins(SKILL_GROUP).select(name=name)
    kind = _options_of(name) if entries else None
    if kind is None:
        _known((SKILLS,), {name: given}, sorted(skill_options()))
    assert kind is not None
    return _typed((SKILLS, name), kind, given or {})


def _typed(path: tuple[str | int, ...], kind: type, given: Any) -> Any:
    """Builds an options dataclass from a file's data. Raises StackError when the data are invalid."""
    from pydantic import TypeAdapter, ValidationError

    _check_keys(path, kind, given)
    try:
        return TypeAdapter(kind).validate_python(given)
    except ValidationError as error:
        where, what, hint = first_error(error.errors())
        raise StackError((*path, *where), what, hint) from error


def _check_keys(path: tuple[str | int, ...], kind: type, given: Any) -> None:
    """Raises StackError for keys that are no fields of the dataclass or of the dataclasses nested in it."""
    _known(path, given, [each.name for each in dataclasses.fields(kind)])
    for name, inner in get_type_hints(kind).items():
        if dataclasses.is_dataclass(inner) and isinstance(inner, type) and name in given:
            _check_keys((*path, name), inner, given[name])


def _known(path: tuple[str | int, ...], given: Any, known: Sequence[str]) -> None:
    if not isinstance(given, Mapping):
        raise StackError(path, "should be a mapping of keys to values", suggestion("", known))
    for key in given:
        if key not in known:
            named = f"key {key!r}" if str(key).isidentifier() else "key that is no plain word"
            raise StackError((*path, key), f"unknown {named}", suggestion(str(key), known))


def stack_data(stack: RobotStack) -> dict[str, Any]:
    """Returns the resolved stack with all options, as plain data that `stack_of` accepts."""
    slots = {slot: {USE: stack.names[slot], **_plain(getattr(stack, slot))} for slot in SLOTS}
    skills = {name: _plain(stack.skills.get(name) or kind()) for name, kind in skill_options().items()}
    return {**slots, SKILLS: skills}


def _plain(options: Any) -> dict[str, Any]:
    from pydantic import TypeAdapter

    data: dict[str, Any] = TypeAdapter(type(options)).dump_python(options, mode="json")
    return data
