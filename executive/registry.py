"""The skills that a tree may use, by name: each folder under `skills` with a module `skill` gives its own."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import skills
from skills.api import Skill


def built_in_skills() -> dict[str, type[Skill[Any]]]:
    """All skills that come with the project, by name.

    Raises:
        ValueError: two skills of one name.
    """
    found: dict[str, type[Skill[Any]]] = {}
    for module in _skill_modules():
        for skill in _skills_of(module):
            if skill.name in found:
                raise ValueError(f"{found[skill.name].__module__} and {module.__name__} both give skill '{skill.name}'")
            found[skill.name] = skill
    return found


def _skill_modules() -> Iterator[ModuleType]:
    for folder in sorted(pkgutil.iter_modules(skills.__path__), key=lambda module: module.name):
        name = f"skills.{folder.name}.skill"
        if folder.ispkg and importlib.util.find_spec(name) is not None:
            yield importlib.import_module(name)


def _skills_of(module: ModuleType) -> Iterator[type[Skill[Any]]]:
    """The finished skills that are defined in a module."""
    for _, kind in inspect.getmembers(module, inspect.isclass):
        if issubclass(kind, Skill) and not inspect.isabstract(kind) and kind.__module__ == module.__name__:
            yield kind
