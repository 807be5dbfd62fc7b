"""The skills that a tree may use, by name: those that installed distributions register as entry points.

A distribution registers a skill in the group `errand.skills`, name = skill's name, value = "module:Class". Our own
skills stand in `pyproject.toml` in the same way. There is only this one mechanism, so that what a user's package
can do is what our own skills do, and so that a folder that happens to lie on the path never becomes a skill.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final

from executive.tree.types import describe_type, field_types
from skills.api import Cause, Skill
from skills.files.errors import InputError, suggestion

GROUP: Final = "errand.skills"
DISTRIBUTION: Final = "spot-errand"

SkillClass = type[Skill[Any]]


@dataclass(frozen=True)
class SkillRegistry(Mapping[str, SkillClass]):
    """The skills that can be used, by name. `broken` says why others cannot, naming the distribution."""

    usable: Mapping[str, SkillClass]
    broken: Mapping[str, InputError]

    def __getitem__(self, name: str) -> SkillClass:
        return self.usable[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.usable)

    def __len__(self) -> int:
        return len(self.usable)


def missing(name: str, registry: Mapping[str, SkillClass]) -> tuple[str, str]:
    """Why a registry has no skill of this name, and the hint."""
    if isinstance(registry, SkillRegistry) and name in registry.broken:
        return registry.broken[name].message, registry.broken[name].hint
    return f"there is no skill '{name}'", suggestion(name, registry)


def installed_skills() -> SkillRegistry:
    """All registered skills, ours and others', in the order of their names.

    One that cannot be loaded, does not keep the rules for skills, or has the name of another is broken: it does not
    harm the others, and never takes the place of ours. Raises InputError: ours are not registered, or one is broken.
    """
    found = tuple(entry_points(group=GROUP))
    if not any(_distribution(entry) == DISTRIBUTION for entry in found):
        hint = "install the project that these sources belong to: pip install --editable ."
        raise InputError(f"no skill of {DISTRIBUTION} is registered under '{GROUP}'", hint=hint)
    ours = skills_of(entry for entry in found if _distribution(entry) == DISTRIBUTION)
    others = _registry_of(found)
    usable = {name: others[name] for name in others if name not in ours} | ours
    return SkillRegistry(dict(sorted(usable.items())), others.broken)


def built_in_skills() -> dict[str, SkillClass]:
    """The skills that come with the project, by name. Raises InputError as `installed_skills` does."""
    return skills_of(entry for entry in entry_points(group=GROUP) if _distribution(entry) == DISTRIBUTION)


def skills_of(entries: Iterable[EntryPoint]) -> dict[str, SkillClass]:
    """The skills of these entry points by name, each checked. Raises InputError."""
    registry = _registry_of(entries)
    for error in registry.broken.values():
        raise error
    return dict(registry)


def _registry_of(entries: Iterable[EntryPoint]) -> SkillRegistry:
    """The skills of these entry points, those apart that cannot be used."""
    owners: dict[str, EntryPoint] = {}
    usable: dict[str, SkillClass] = {}
    broken: dict[str, InputError] = {}
    for entry in sorted(entries, key=lambda entry: (entry.name, _distribution(entry))):
        try:
            _refuse_second(entry, owners.setdefault(entry.name, entry))
            usable[entry.name] = _checked(entry)
        except InputError as error:
            broken[entry.name] = error
    return SkillRegistry({name: skill for name, skill in usable.items() if name not in broken}, broken)


def _refuse_second(entry: EntryPoint, owner: EntryPoint) -> None:
    if owner.value != entry.value:
        both = f"{_distribution(owner)} and {_distribution(entry)}"
        raise InputError(f"{both} both register a skill '{entry.name}'", hint="uninstall one, or rename its skill")


def _checked(entry: EntryPoint) -> SkillClass:
    skill = _loaded(entry)
    for message, hint in faults_of(skill, registered_as=entry.name):
        raise _error(entry, message, hint)
    return skill  # type: ignore[no-any-return]


def _loaded(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except (Exception, SystemExit) as defect:
        what = f"cannot load {entry.value} ({type(defect).__name__}: {defect})"
        raise _error(entry, what, "repair or uninstall that distribution") from defect


def faults_of(skill: Any, *, registered_as: str) -> Iterator[tuple[str, str]]:
    """What a class lacks to be a skill, each with the hint."""
    if not (inspect.isclass(skill) and issubclass(skill, Skill)):
        yield "it is no subclass of skills.api.Skill", "register the skill's class"
        return
    if inspect.isabstract(skill):
        missing = ", ".join(sorted(skill.__abstractmethods__))
        yield f"it does not define {missing}", f"define {missing}"
    name = getattr(skill, "name", None)
    if name != registered_as:
        yield f"it calls itself {name!r}", f"register it under its own name, or set name = {registered_as!r}"
    if not (skill.__dict__.get("__doc__") or "").strip():
        yield "it has no docstring", "say in one sentence what it does"
    yield from _port_faults(skill)
    yield from _cause_faults(skill)
    limit_s = skill.default_timeout_s
    if not (isinstance(limit_s, int | float) and math.isfinite(limit_s) and limit_s > 0.0):
        yield f"its default_timeout_s is {limit_s!r}", "give a number of seconds above 0"


def _port_faults(skill: SkillClass) -> Iterator[tuple[str, str]]:
    """What is wrong with the declarations of the ports."""
    inputs = getattr(skill, "Inputs", None)
    frozen = dataclasses.is_dataclass(inputs) and inputs.__dataclass_params__.frozen  # type: ignore[union-attr]
    if not (inspect.isclass(inputs) and frozen):
        yield (
            "its Inputs is no frozen dataclass",
            "put @dataclass(frozen=True) above it, and set Inputs = the class",
        )
        return
    try:
        field_types(inputs)
    except (NameError, TypeError) as defect:
        yield f"the types of its Inputs cannot be found ({defect})", "import them in the skill's module"
    if not (isinstance(skill.outputs, Mapping) and all(isinstance(port, str) for port in skill.outputs)):
        yield f"its outputs is {skill.outputs!r}", "give a mapping of port names to types"
        return
    for port, kind in skill.outputs.items():
        if not isinstance(kind, type) and not hasattr(kind, "__origin__"):
            yield f"its output port '{port}' has {describe_type(kind)} for a type", "name a class"


def _cause_faults(skill: SkillClass) -> Iterator[tuple[str, str]]:
    """What is wrong with the documentation of the causes."""
    if not (isinstance(skill.causes, Mapping) and skill.causes):
        yield "it documents no causes of failure", "set causes = {Cause.PRECONDITION: 'when ...', ...}"
        return
    for cause, sentence in skill.causes.items():
        if not isinstance(cause, Cause):
            yield f"its causes hold {cause!r}", "use members of skills.api.Cause as keys"
        elif not (isinstance(sentence, str) and sentence.strip()):
            yield f"its cause {cause.value} is not explained", "say in one sentence when it fails so"


def _distribution(entry: EntryPoint) -> str:
    return "an unknown distribution" if entry.dist is None else entry.dist.name


def _error(entry: EntryPoint, message: str, hint: str) -> InputError:
    return InputError(f"skill '{entry.name}' of distribution {_distribution(entry)}: {message}", hint=hint)
