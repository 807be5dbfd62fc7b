"""The pages of the reference can be made, and explain every key, step and condition."""

import json
import sys

import pytest
from pydantic import TypeAdapter
from typer.testing import CliRunner

from executive.cli.entry import app
from executive.words.condition import Condition
from executive.words.mission import Mission
from executive.words.steps import BLOCKS
from tests.docs.documents import DOCS, blocks
from tests.docs.reference import PAGES, file_schemas, make_reference, mission_constructs, mission_schema


def test_the_pages_are_written_as_markdown(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["make_reference.py", str(tmp_path)])
    make_reference.main()
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == PAGES


def test_each_page_has_a_title_and_tables_or_code():
    assert [name for name, text in PAGES.items() if not text.startswith("# ")] == []
    assert [name for name, text in PAGES.items() if "\n|---|" not in text and "```" not in text] == []


@pytest.mark.parametrize("page", make_reference.SCHEMA_PAGES, ids=lambda page: page.name)
def test_every_key_of_a_schema_is_explained(page):
    schema = page.model.model_json_schema(by_alias=True)
    parts = [schema, *(part for part in schema.get("$defs", {}).values() if "properties" in part)]
    mute = [key for part in parts for key, facts in part["properties"].items() if not facts.get("description")]
    assert mute == []


def test_the_schema_of_mission_files_has_the_ranges_of_the_ports():
    rules = file_schemas.schemas()["missions/mission.schema.json"]["$defs"]["CallSkill"]["allOf"]
    (navigate,) = (rule["then"] for rule in rules if rule["if"]["properties"]["skill"]["const"] == "navigate")
    speed, *_ = navigate["properties"]["with"]["properties"]["max_speed"]["anyOf"]
    assert speed == {"type": "number", "exclusiveMinimum": 0.0, "maximum": 3.0}


CONSTRUCTS = (*mission_constructs.DECIDING, *mission_constructs.WATCHING, *mission_constructs.SMALL)


def test_every_kind_of_step_is_explained():
    told = {word.strip(",") for one in CONSTRUCTS for word in one.heading.split()}
    assert set(BLOCKS) <= told
    assert {"while", "when", "always", "done_when", "for_each"} <= told


def test_every_condition_is_explained():
    told = " ".join(what for what, *_ in mission_constructs.CONDITIONS)
    kinds = TypeAdapter(Condition).json_schema()["$defs"].values()
    keys = {key for kind in kinds for key in kind.get("properties", ())}
    assert {key for key in keys - {"expression"} if f"`{key}`" not in told.replace(", ", "` `")} == set()


SHOWN = [block.text for block in blocks(DOCS / "coming-from.md") if block.text.startswith("name: ")]


@pytest.mark.parametrize(
    ("texts", "count"),
    [([mission_constructs.file_of(one) for one in CONSTRUCTS], len(CONSTRUCTS)), (SHOWN, 6)],
    ids=["kinds of steps", "our side of the page on other tools"],
)
def test_the_examples_pass_the_check(texts, count, tmp_path):
    for number, text in enumerate(texts):
        (tmp_path / f"{number}.yaml").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["check", *map(str, tmp_path.iterdir())])
    assert (result.exit_code, len(texts)) == (0, count), result.output


def test_the_json_schema_names_every_key_with_a_description():
    schema = mission_schema.mission_json_schema()
    kinds = [kind for kind in schema["$defs"]["AnyStep"]["anyOf"] if kind != {"type": "string", "const": "dock"}]
    steps = [schema["$defs"][kind["$ref"].rpartition("/")[2]] for kind in kinds]
    keys = {key: facts for step in steps for key, facts in step["properties"].items()}
    assert set(schema["properties"]) == {field.alias or name for name, field in Mission.model_fields.items()}
    assert {"say", "take", "to", "do", "object", "skill", "use", "with", "gives", "timeout"} <= set(keys)
    assert all("description" in facts for facts in (*schema["properties"].values(), *keys.values()))
    assert not any(each["additionalProperties"] for each in (schema, *steps))


def test_parameter_may_replace_a_number():
    timeout = mission_schema.mission_json_schema()["$defs"]["Do"]["properties"]["timeout"]
    assert '"pattern"' in json.dumps(timeout)
