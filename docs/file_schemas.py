"""JSON Schemas of the kinds of YAML files, for editors; each is shipped beside the files that it describes.

python docs/file_schemas.py [FOLDER]          # writes them, below the folder of the installed package
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from mission_schema import mission_json_schema
from pydantic import BaseModel, TypeAdapter

import executive
from executive.app.prepare.scenarios import ScenarioFile
from executive.testing.skill_test import SkillTestFile
from executive.tree.registry import GROUP, SkillClass, skills_of
from executive.words.knowledge import Knowledge
from plant.robots.urdf_robot.robot_file import RobotFile
from plant.worlds.world import SeedRules
from skills.inputs.plugins import OURS, distribution_of, installed_plugins
from skills.stack import SKILLS, SLOTS, USE, components, skill_options

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


def stack_schema() -> dict[str, Any]:
    """Makes the JSON schema of stack files."""
    defs: dict[str, Any] = {}
    slots = {slot: {"anyOf": [_schema(kind, defs, name) for name, kind in components(slot).items()]} for slot in SLOTS}
    skills = {name: _schema(kind, defs) for name, kind in skill_options().items()}
    properties = {**slots, SKILLS: {"type": "object", "properties": skills, "additionalProperties": False}}
    about = {"title": "RobotStack", "description": "The components of one robot, each with its options."}
    return {**about, "type": "object", "properties": properties, "additionalProperties": False, "$defs": defs}


def _schema(kind: type, defs: dict[str, Any], name: str | None = None) -> dict[str, Any]:
    """Makes the schema of one options class; adds the schemas that it references to `defs`."""
    schema = TypeAdapter(kind).json_schema()
    defs.update({inner: {**part, "additionalProperties": False} for inner, part in schema.pop("$defs", {}).items()})
    chosen = {} if name is None else {USE: {"const": name, "description": "The component's name."}}
    properties = {**chosen, **schema.get("properties", {})}
    return {**schema, "properties": properties, "additionalProperties": False}


def schemas() -> dict[str, dict[str, Any]]:
    """Makes every schema, by its file in the repository."""
    inputs = {name: skill.Inputs for name, skill in project_skills().items()}
    found = {"missions/mission.schema.json": mission_json_schema(inputs), "skills/stack.schema.json": stack_schema()}
    found |= {file: model.model_json_schema(by_alias=True) for file, model in _MODELS.items()}
    return {file: {"$schema": _DRAFT, **schema} for file, schema in found.items()}


def write_schemas(root: Path) -> None:
    """Writes the file of every schema below a folder."""
    for file, schema in schemas().items():
        (root / file).write_text(schema_text(schema), encoding="utf-8")


def schema_text(schema: Mapping[str, Any]) -> str:
    """Text of a schema's file."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    write_schemas(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(executive.__file__).parents[1])
