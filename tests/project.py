"""Worlds and skills of this repository: those of the core; and the skills of errand-people, each with its tests."""

import sys
from functools import cache
from pathlib import Path

from executive.tree.registry import GROUP, SkillClass, skills_of
from plant.worlds.world import WORLDS_FOLDER
from skills.inputs.plugins import OURS, distribution_of, installed_plugins
from tests.sources import ROOT

sys.path.append(str(ROOT / "docs"))
from file_schemas import project_skills

__all__ = ["NEEDS_FIGURES", "core_skills", "project_skills", "shipped_worlds", "skill_tests"]

NEEDS_FIGURES = ("find_person", "read_person")
"""Skills that need figures of people, which scripted scenes do not have; in the plant they succeed."""


def shipped_worlds() -> tuple[str, ...]:
    """Returns the names of the project's own worlds."""
    return tuple(sorted(path.parent.name for path in WORLDS_FOLDER.glob("*/world.dmd.yaml")))


def core_skills() -> dict[str, SkillClass]:
    """Returns the skills of the core by name."""
    return skills_of(entry for entry in installed_plugins(GROUP) if distribution_of(entry) == OURS)


@cache
def skill_tests(name: str) -> Path:
    """Returns the file of a skill's tests, beside the tests of the skill."""
    (path,) = (
        path for folder in ("tests/skills", "plugins") for path in (ROOT / folder).rglob(f"{name}.skilltest.yaml")
    )
    return path
