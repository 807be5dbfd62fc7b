"""Registry of the skills that a tree may use, by name: installed distributions register them as entry points.

A distribution registers a skill in the group `errand.skills`, name = skill's name, value = "module:Class". The shipped
skills stand in `pyproject.toml` in the same way. There is no other mechanism: users' skills can do all that the shipped
skills can, and a folder on the path never becomes a skill by accident.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, Final

from executive.tree.port_values import describe_type, field_types
from skills.api import Cause, Skill
from skills.inputs import plugins
from skills.inputs.errors import InputError, suggestion
from skills.inputs.plugins import LIMIT_S, OURS, PluginDefect, distribution_of, installed_plugins, run_plugin

GROUP: Final = "errand.skills"

SkillClass = type[Skill[Any]]


class SkillRegistry(Mapping[str, SkillClass]):
    """Skills by name, each loaded at its first use. Iteration loads all of them; `names` loads none.

    A skill that cannot be loaded, breaks a rule for skills, or has the name of another is broken: it does not affect
    the others, and never replaces a shipped one. A broken shipped skill raises InputError.
    """

    def __init__(self, ours: Mapping[str, Sequence[EntryPoint]], others: Mapping[str, Sequence[EntryPoint]]) -> None:
        """Takes the entry points of this project and of other distributions; several with one name are refused."""
        self._ours, self._others = ours, others
        self._loaded: dict[str, SkillClass | InputError] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All names, including those of broken skills."""
        return tuple(sorted({*self._ours, *self._others}))

    @property
    def broken(self) -> Mapping[str, InputError]:
        """Errors of broken skills by name, with the distribution; loads the skills of all distributions."""
        found = {name: self.why_broken(name) for name in self._others}
        return {name: error for name, error in found.items() if error is not None}

    def why_broken(self, name: str) -> InputError | None:
        """Returns the error of a broken skill from another distribution; None if the skill works or does not exist."""
        found = self._of_others(name)
        return found if isinstance(found, InputError) else None

    def __getitem__(self, name: str) -> SkillClass:
        found = _shipped(*self._ours[name]) if name in self._ours else self._of_others(name)
        if found is None or isinstance(found, InputError):
            raise KeyError(name)
        return found

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self._ours or isinstance(self._of_others(name), type))

    def __iter__(self) -> Iterator[str]:
        return (name for name in self.names if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def _of_others(self, name: str) -> SkillClass | InputError | None:
        """Returns the skill from another distribution, loaded once, or the error that loading it raised."""
        if name not in self._loaded and name in self._others:
            try:
                self._loaded[name] = _only(self._others[name], self._ours)
            except InputError as error:
                self._loaded[name] = error
        return self._loaded.get(name)


def missing_skill(name: str, registry: Mapping[str, SkillClass]) -> tuple[str, str]:
    """Message and hint for a name that the registry does not know."""
    broken = registry.why_broken(name) if isinstance(registry, SkillRegistry) else None
    if broken is not None:
        return broken.message, broken.hint
    known = registry.names if isinstance(registry, SkillRegistry) else registry
    return plugins.missing_plugin(GROUP, name) or (f"there is no skill '{name}'", suggestion(name, known))


def installed_skills() -> SkillRegistry:
    """Returns all registered skills. Raises InputError when the shipped skills are not registered."""
    ours, others = dict[str, tuple[EntryPoint, ...]](), dict[str, tuple[EntryPoint, ...]]()
    for entry in sorted(installed_plugins(GROUP), key=distribution_of):
        named = ours if distribution_of(entry) == OURS else others
        named[entry.name] = (*named.get(entry.name, ()), entry)
    if not ours:
        hint = "install the project that these sources belong to: pip install --editable ."
        raise InputError(f"no skill of {OURS} is registered under '{GROUP}'", hint=hint)
    return SkillRegistry(ours, others)


def skills_of(entries: Iterable[EntryPoint], *, limit_s: float = LIMIT_S) -> dict[str, SkillClass]:
    """Loads and checks the skills behind entry points within a time limit; returns them by name. Raises InputError."""
    named: dict[str, tuple[EntryPoint, ...]] = {}
    for entry in sorted(entries, key=lambda entry: (entry.name, distribution_of(entry))):
        named[entry.name] = (*named.get(entry.name, ()), entry)
    return {name: _only(same, {}, limit_s) for name, same in named.items()}


def _only(entries: Sequence[EntryPoint], ours: Container[str], limit_s: float = LIMIT_S) -> SkillClass:
    """Loads and checks the skill of one name. Raises InputError when it is broken, or another has its name."""
    first, *others = entries
    owners = [OURS] if first.name in ours else []
    owners += [distribution_of(each) for each in (first, *(other for other in others if other.value != first.value))]
    if len(owners) > 1:
        both = f"{owners[0]} and {owners[1]}"
        raise InputError(f"{both} both register a skill '{first.name}'", hint="uninstall one, or rename its skill")
    return _checked(first, limit_s)


@cache
def _shipped(*entries: EntryPoint) -> SkillClass:
    return _only(entries, ())


def _checked(entry: EntryPoint, limit_s: float) -> SkillClass:
    try:
        skill = run_plugin(entry, entry.load, limit_s=limit_s)
        faults = run_plugin(entry, lambda: list(faults_of(skill, registered_as=entry.name)))
    except PluginDefect as defect:
        raise _error(entry, f"cannot load {entry.value} ({defect})", "repair or uninstall it") from defect
    for message, hint in faults:
        raise _error(entry, message, hint)
    return skill  # type: ignore[no-any-return]


def faults_of(skill: Any, *, registered_as: str) -> Iterator[tuple[str, str]]:
    """Yields a message with a hint for each rule for skills that a class breaks."""
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
    if "image" in skill.max_data_age_s:
        hint = "give an output port whose value has the picture's stamp_s, and declare the age of that port"
        yield "its max_data_age_s names 'image', which has no latest reading", hint
    limit_s = skill.default_timeout_s
    if not (isinstance(limit_s, int | float) and math.isfinite(limit_s) and limit_s > 0.0):
        yield f"its default_timeout_s is {limit_s!r}", "give a number of seconds above 0"


def _port_faults(skill: SkillClass) -> Iterator[tuple[str, str]]:
    """Yields the errors in the declarations of a skill's ports, with hints."""
    inputs = getattr(skill, "Inputs", None)
    frozen = dataclasses.is_dataclass(inputs) and inputs.__dataclass_params__.frozen  # type: ignore[union-attr]
    if not (inspect.isclass(inputs) and frozen):
        yield "its Inputs is no frozen dataclass", "put @dataclass(frozen=True) above it, and set Inputs = the class"
        return
    try:
        field_types(skill.Inputs)
    except (NameError, TypeError) as defect:
        yield f"the types of its Inputs cannot be found ({defect})", "import them in the skill's module"
    if not (isinstance(skill.outputs, Mapping) and all(isinstance(port, str) for port in skill.outputs)):
        yield f"its outputs is {skill.outputs!r}", "give a mapping of port names to types"
        return
    for port, kind in skill.outputs.items():
        if not isinstance(kind, type) and not hasattr(kind, "__origin__"):
            yield f"its output port '{port}' has {describe_type(kind)} for a type", "name a class"


def _cause_faults(skill: SkillClass) -> Iterator[tuple[str, str]]:
    """Yields the errors in the documentation of a skill's causes, with hints."""
    if not (isinstance(skill.causes, Mapping) and skill.causes):
        yield "it documents no causes of failure", "set causes = {Cause.PRECONDITION: 'when ...', ...}"
        return
    for cause, sentence in skill.causes.items():
        if not isinstance(cause, Cause):
            yield f"its causes hold {cause!r}", "use members of skills.api.Cause as keys"
        elif not (isinstance(sentence, str) and sentence.strip()):
            yield f"its cause {cause.value} is not explained", "say in one sentence when it fails so"


def _error(entry: EntryPoint, message: str, hint: str) -> InputError:
    return InputError(f"skill '{entry.name}' of distribution {distribution_of(entry)}: {message}", hint=hint)
