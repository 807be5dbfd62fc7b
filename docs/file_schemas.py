"""JSON Schemas of the kinds of YAML files, for editors; each is shipped beside the files that it describes."""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from mission_schema import mission_json_schema
from pydantic import BaseModel

from executive.app.prepare.scenarios import ScenarioFile
from executive.testing.skill_test import SkillTestFile
from executive.tree.registry import GROUP, SkillClass, skills_of
from executive.words.knowledge import Knowledge
from plant.robots.urdf_robot.robot_file import RobotFile
from plant.worlds.world import SeedRules
from skills.inputs.plugins import OURS, distribution_of, installed_plugins
from skills.stack import stack_schema

_DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
_MODELS: Final[Mapping[str, type[BaseModel]]] = MappingProxyType(
    {
        "missions/scenarios/scenario.schema.json": ScenarioFile,
        "plant/worlds/knowledge.schema.json": Knowledge,
        "plant/worlds/objects.schema.json": SeedRules,
        "plant/robots/robot.schema.json": RobotFile,
        "executive/testing/skilltest.schema.json": SkillTestFile,
    }
)


def project_skills() -> dict[str, SkillClass]:
    """Returns the skills of the core and of errand-people, which `make env` and `make demo` install, by name."""
    ours = (OURS, "errand-people")
    return skills_of(entry for entry in installed_plugins(GROUP) if distribution_of(entry) in ours)


def schemas() -> dict[str, dict[str, Any]]:
    """Makes every schema, by its file in the repository."""
    inputs = {name: skill.Inputs for name, skill in project_skills().items()}
    found = {"missions/mission.schema.json": mission_json_schema(inputs), "skills/stack.schema.json": stack_schema()}
    found |= {file: model.model_json_schema(by_alias=True) for file, model in _MODELS.items()}
    return {file: {"$schema": _DRAFT, **schema} for file, schema in found.items()}


def write_schemas(root: Path) -> None:
    """Writes the file of every schema."""
    for file, schema in schemas().items():
        (root / file).write_text(schema_text(schema), encoding="utf-8")


def schema_text(schema: Mapping[str, Any]) -> str:
    """Text of a schema's file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
