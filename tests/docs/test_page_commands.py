"""Blocks of the pages that no test follows step by step: they are well formed, and their commands run at night."""

import ast
import json
import re
import shlex
import textwrap
import tomllib

import cv2
import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator

from skills.inputs.yaml_source import parse_yaml
from tests.docs.documents import PAGES, ROOT, Block, blocks
from tests.docs.reference import file_schemas
from tests.docs.test_tutorials import PAGES as FOLLOWED
from tests.docs.test_tutorials import Reader

TABLE = yaml.safe_load((ROOT / "tests/docs/page_commands.yaml").read_text(encoding="utf-8"))
MISSION = file_schemas.schemas()["missions/mission.schema.json"]
OTHERS = [page for page in PAGES if page not in FOLLOWED]


def page_id(page):
    return str(page.relative_to(ROOT))


def lines_of(page):
    """The command lines of a page's shell blocks, those behind a `$` of a console, and those that go on joined."""
    for block in blocks(page):
        if block.kind == "console":
            yield from (line[2:] for line in block.text.splitlines() if line.startswith("$ "))
        if block.kind == "sh":
            yield from (line for line in block.text.replace("\\\n", " ").splitlines() if line.strip())


def reason(line):
    """Why a line is not run; None when it is."""
    return next((why for pattern, why in TABLE["not_run"].items() if re.search(pattern, line)), None)


def wrapped(line):
    """The line, with what presses Ctrl-C after some time where it would not end."""
    seconds = next((s for pattern, s in TABLE["stopped"].items() if re.search(pattern, line)), None)
    return line if seconds is None else f"timeout --foreground --preserve-status --signal=INT {seconds} {line}"


RUN = {page: [line for line in lines_of(page) if reason(line) is None] for page in OTHERS}


@pytest.mark.nightly
@pytest.mark.mission
@pytest.mark.parametrize("page", [page for page, lines in RUN.items() if lines], ids=page_id)
def test_the_commands_of_a_page_run_as_written(page, tmp_path, monkeypatch):
    monkeypatch.setenv("BROWSER", "true")  # no page is opened
    reader = Reader(tmp_path)
    (reader.folder / "missions").symlink_to(ROOT / "missions")
    for name, text in TABLE["files"].items():
        if text == "picture":
            cv2.imwrite(str(reader.folder / name), np.full((480, 640, 3), 128, np.uint8))
        else:
            (reader.folder / name).write_text(text)
    for line in RUN[page]:
        reader.run(Block("sh", f"{wrapped(line)}\n", "", 0))


def test_every_reason_belongs_to_a_line():
    lines = [line for page in OTHERS for line in lines_of(page)]
    assert [pattern for pattern in TABLE["not_run"] if not any(re.search(pattern, line) for line in lines)] == []


def test_a_third_of_the_lines_run():
    lines = [line for page in OTHERS for line in lines_of(page)]
    assert 3 * sum(map(len, RUN.values())) >= len(lines)


PARSED = {
    "json": json.loads,
    "toml": tomllib.loads,
    "yaml": lambda text: parse_yaml(text.replace("!Rpy ", ""), ROOT / "page.yaml").data,
    "python": lambda text: ast.parse(f"def part():\n{textwrap.indent(textwrap.dedent(text), '    ')}"),
}


def test_each_block_of_a_page_is_well_formed():
    for page in PAGES:
        for block in blocks(page):
            try:
                if block.kind in PARSED:
                    PARSED[block.kind](block.text)
                elif block.kind == "sh":
                    shlex.split(block.text.replace("<<END", ""), comments=True)
            except Exception as error:
                pytest.fail(f"{page_id(page)}:{block.line}: {error}")


def test_each_mission_of_a_page_fits_the_schema():
    validator = Draft202012Validator(MISSION)
    for page in OTHERS:
        shown = [PARSED["yaml"](block.text) for block in blocks(page) if block.kind == "yaml"]
        missions = [data for data in shown if isinstance(data, dict) and {"name", "steps"} <= data.keys()]
        assert [error.message for data in missions for error in validator.iter_errors(data)] == [], page_id(page)
