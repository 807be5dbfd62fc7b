"""Skills of this repository: those of the core, and with them those of errand-people, each with its file of tests."""

import sys
from functools import cache
from pathlib import Path

from executive.tree.registry import GROUP, SkillClass, skills_of
from skills.inputs.plugins import OURS, distribution_of, installed_plugins
from tests.sources import ROOT

sys.path.append(str(ROOT / "docs"))
from file_schemas import project_skills

__all__ = ["core_skills", "project_skills", "skill_tests"]


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
