"""The schemas for editors are made; every shipped file fits its own, and a wrong key or value does not."""

import dataclasses
import json
import os

import pytest
from jsonschema import Draft202012Validator

from skills.inputs.yaml_source import parse_yaml, read_yaml
from skills.stack import SLOTS, default_stack
from tests.docs.documents import ROOT
from tests.docs.reference import file_schemas, mission_constructs
from tests.docs.test_reference import CONSTRUCTS, SHOWN

MISSION, SCENARIO = "missions/mission.schema.json", "missions/scenarios/scenario.schema.json"
KNOWLEDGE, OBJECTS = "plant/worlds/knowledge.schema.json", "plant/worlds/objects.schema.json"
ROBOT, STACK = "plant/robots/robot.schema.json", "skills/stack.schema.json"
SKILL_TEST = "executive/testing/skilltest.schema.json"
SCHEMAS = file_schemas.schemas()
VALIDATORS = {file: Draft202012Validator(schema) for file, schema in SCHEMAS.items()}
PATTERNS = {
    MISSION: ["missions/*.yaml", "tests/executive/mission/every_block.yaml"],
    SCENARIO: ["missions/scenarios/*.yaml"],
    KNOWLEDGE: ["plant/worlds/*/knowledge.yaml", "tests/executive/knowledge.yaml"],
    OBJECTS: ["plant/worlds/*/objects.yaml"],
    ROBOT: ["plant/robots/*/robot.yaml", "tests/plant/robots/**/robot.yaml"],
    STACK: ["skills/*_stack.yaml", "plant/robots/*/stack.yaml", "tests/plant/robots/**/stack.yaml"],
    SKILL_TEST: ["tests/**/*.skilltest.yaml", "executive/cli/new/**/*.skilltest.yaml.template"],
}
FILES = [
    (schema, str(file.relative_to(ROOT)))
    for schema, patterns in PATTERNS.items()
    for pattern in patterns
    for file in sorted(ROOT.glob(pattern))
]
WRONG = [
    (MISSION, "name: a\nsteps: [{to: hall}]", "name: a\nsteps: [{too: hall}]"),
    (MISSION, "name: a\nsteps: [dock]", "name: a\nsteps: [undock]"),
    (MISSION, "name: a\nsteps: [{dock: {level: 0.8}}]", "name: a\nsteps: [{dock: {level: 80}}]"),
    (MISSION, "name: a\nsteps: [{to: hall, timeout: 5}]", "name: a\nsteps: [{timeout: 5}]"),
    (SCENARIO, "crowd: 3", "crowd: many"),
    (SCENARIO, "events: [{person: Robin, at: 2, to: hall}]", "events: [{persons: Robin, at: 2, to: hall}]"),
    (KNOWLEDGE, "start: {x: 1, y: 2, yaw: 0}", "start: {x: 1, y: 2, yaw: north}"),
    (KNOWLEDGE, "start: {x: 1, y: 2, yaw: 0}", "start: {x: 1, y: 2, yaw: 0}\nrooms: {}"),
    (OBJECTS, "{}", "objects: [{name: can, model: coke, surfaces: []}]"),
    (OBJECTS, "{}", "object: []"),
    (ROBOT, "{}", "lidar: {link: laser, beams: 3}"),
    (ROBOT, "{}", "base: {link: body, height: tall, footprint: 0.3}"),
    (STACK, "planner: {use: lattice}", "planner: {use: astar}"),
    (STACK, "skills: {navigate: {replans: 3}}", "skills: {navigate: {replan: 3}}"),
    (SKILL_TEST, "{}", "tests: [{name: a, expect: {outcome: done}}]"),
    (SKILL_TEST, "{}", "robots: {kind: scripted}"),
]
"""Texts that replace keys of a file that fits: those of the first fit, those of the second do not."""


def document(text):
    return parse_yaml(text, ROOT / "x.yaml").data


def test_the_schemas_are_written_below_a_folder(tmp_path):
    for file in SCHEMAS:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
    file_schemas.write_schemas(tmp_path)
    assert {file: json.loads((tmp_path / file).read_text(encoding="utf-8")) for file in SCHEMAS} == SCHEMAS


def test_the_schema_of_stacks_knows_every_slot_and_option():
    properties = SCHEMAS[STACK]["properties"]
    lattice = next(one for one in properties["planner"]["anyOf"] if one["properties"]["use"]["const"] == "lattice")
    fields = {field.name for field in dataclasses.fields(default_stack().planner)}
    assert set(properties) == {*SLOTS, "skills"}
    assert set(lattice["properties"]) == {*fields, "use"}


@pytest.mark.parametrize("schema", SCHEMAS)
def test_the_schema_is_one_by_the_standard(schema):
    Draft202012Validator.check_schema(SCHEMAS[schema])


@pytest.mark.parametrize(("schema", "file"), FILES)
def test_a_shipped_file_fits_its_schema(schema, file):
    assert [error.message for error in VALIDATORS[schema].iter_errors(read_yaml(ROOT / file).data)] == []


def test_files_of_every_kind_are_tried():
    assert {schema for schema, _ in FILES} == set(SCHEMAS)
    assert len(FILES) > 65


@pytest.mark.parametrize("text", [*map(mission_constructs.file_of, CONSTRUCTS), *SHOWN])
def test_the_missions_of_the_pages_fit_the_schema(text):
    assert [error.message for error in VALIDATORS[MISSION].iter_errors(document(text))] == []


@pytest.mark.parametrize(("schema", "right", "wrong"), WRONG)
def test_a_wrong_key_or_value_is_refused(schema, right, wrong):
    fitting = read_yaml(ROOT / next(file for kind, file in FILES if kind == schema)).data
    assert VALIDATORS[schema].is_valid({**fitting, **document(right)})
    assert not VALIDATORS[schema].is_valid({**fitting, **document(wrong)})


SHIPPED = [(schema, file) for schema, file in FILES if not file.startswith(("tests/", "plugins/", "executive/"))]


@pytest.mark.parametrize(("schema", "file"), SHIPPED)
def test_a_shipped_file_names_its_schema_to_editors(schema, file):
    beside = os.path.relpath(ROOT / schema, (ROOT / file).parent)
    assert (ROOT / file).read_text(encoding="utf-8").startswith(f"# yaml-language-server: $schema={beside}\n")
