import json
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from executive.cli import entry

SENTENCE = "bring me the cup, no, the red mug"


def invoke(*arguments):
    return CliRunner().invoke(entry.app, ["parse", "--open", *arguments])


def test_explain_shows_the_steps_from_the_words_to_the_commands():
    result = invoke(SENTENCE, "--explain")
    assert result.exit_code == 0
    assert "dependencies:" in result.stdout
    assert "obj: mug (NOUN)" in result.stdout or "mug (NOUN)" in result.stdout
    assert result.stdout.rstrip().endswith("Take [red mug] to [start] and do [Nothing] to [Nothing]")


def test_explain_as_json_is_one_object_on_the_last_line():
    result = invoke(SENTENCE, "--explain", "--json")
    values = json.loads(result.stdout.splitlines()[-1])
    assert values["status"] == "ok"
    assert values["steps"]["actions"][0]["objects"] == [{"name": "red mug", "count": 1}]


def test_explain_of_a_refusal_names_the_step_and_the_part():
    result = invoke("bring me a cup and sing a song", "--explain", "--json")
    values = json.loads(result.stdout.splitlines()[-1])
    assert result.exit_code == 2
    assert values["steps"]["refused_at"] == "understanding"
    assert "sing a song" in values["reason"]


def test_without_explain_there_are_no_steps():
    assert "steps" not in json.loads(invoke(SENTENCE, "--json").stdout.splitlines()[-1])


DECIDES = "if there is a beer in the kitchen, tell Robin"
MISSION = [
    "- if: {object: beer, at: kitchen}",
    "  then:",
    "  - {to: Robin}",
    "  - {speak: there is a beer in the kitchen}",
]


def test_a_sentence_that_decides_is_shown_as_yaml():
    result = CliRunner().invoke(entry.app, ["parse", DECIDES, "--json"])
    values = json.loads(result.stdout.splitlines()[-1])
    assert values["mission"] == yaml.safe_load("\n".join(MISSION))
    assert [command["goal"] for command in values["commands"]] == ["Robin"]
    assert CliRunner().invoke(entry.app, ["parse", DECIDES]).stdout.splitlines() == MISSION


def test_explain_shows_the_clauses_and_the_mission():
    result = CliRunner().invoke(entry.app, ["parse", DECIDES, "--explain"])
    assert "parts:\n  if | there is a beer in the kitchen\n  tell Robin\n" in result.stdout
    assert result.stdout.rstrip().endswith("\n".join(f"  {line}" for line in MISSION))


def test_the_arcs_are_drawn(tmp_path: Path):
    result = invoke(SENTENCE, "--format", "svg", "--out", str(tmp_path / "arcs.svg"))
    assert result.exit_code == 0
    drawing = (tmp_path / "arcs.svg").read_text(encoding="utf-8")
    assert drawing.startswith("<svg")
    assert ">mug</tspan>" in drawing


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--file", "sentences.txt", "--format", "svg", "--out", "a.svg"), "--format svg draws one sentence"),
        (("go to the hall", "--format", "svg", "--out", "no/such/folder/a.svg"), "cannot write it"),
        (("", "--format", "svg", "--out", "a.svg"), "no words to draw"),
    ],
)
def test_a_drawing_that_cannot_be_made_is_one_line(arguments, says):
    result = invoke(*arguments)
    assert result.exit_code == 2
    assert says in result.stderr
