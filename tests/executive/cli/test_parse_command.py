import pytest
import yaml

from tests.executive.cli.calls import done, errand, json_of

SENTENCE = "bring me the cup, no, the red mug"
OPEN = ("parse", "--open")


def test_explain_shows_the_steps_from_the_words_to_the_commands():
    result = done(*OPEN, SENTENCE, "--explain")
    assert "dependencies:" in result.stdout
    assert "obj: mug (NOUN)" in result.stdout or "mug (NOUN)" in result.stdout
    assert result.stdout.rstrip().endswith("Take [red mug] to [start] and do [Nothing] to [Nothing]")


def test_explain_as_json_is_one_object_on_the_last_line():
    result = errand(*OPEN, SENTENCE, "--explain", "--json")
    values = json_of(result)
    assert values["status"] == "ok"
    assert values["steps"]["actions"][0]["objects"] == [{"name": "red mug", "count": 1}]


def test_explain_of_a_refusal_names_the_step_and_the_part():
    result = errand(*OPEN, "bring me a cup and sing a song", "--explain", "--json")
    values = json_of(result)
    assert (result.exit_code, values["steps"]["refused_at"]) == (2, "understanding")
    assert "sing a song" in values["reason"]


def test_without_explain_there_are_no_steps():
    assert "steps" not in json_of(errand(*OPEN, SENTENCE, "--json"))


@pytest.mark.parametrize(
    ("sentence", "reason"),
    [
        ("wait for 25 hours", "a wait lasts a day at most"),
        ("if there is a beer in the kitchen, wait for 30 hours", "a wait lasts a day at most"),
        ("take 500 beers to the hall", "500 of 'beer' are too many trips"),
    ],
)
def test_parse_refuses_a_number_in_the_words_of_run(sentence, reason):
    refused = errand("parse", sentence, "--json")
    assert (refused.exit_code, json_of(refused)["status"], json_of(refused)["commands"]) == (2, "refused", [])
    assert json_of(refused)["reason"].startswith(reason)
    assert f"errand: {json_of(refused)['reason']}" in errand("run", "--say", sentence).stderr


DECIDES = "if there is a beer in the kitchen, tell Robin"
MISSION = [
    "- if: {object: beer, at: kitchen}",
    "  then:",
    "  - {to: Robin}",
    "  - {speak: there is a beer in the kitchen}",
]


def test_a_sentence_that_decides_is_shown_as_yaml():
    result = errand("parse", DECIDES, "--json")
    values = json_of(result)
    assert values["mission"] == yaml.safe_load("\n".join(MISSION))
    assert [command["goal"] for command in values["commands"]] == ["Robin"]
    assert errand("parse", DECIDES).stdout.splitlines() == MISSION


def test_explain_shows_the_clauses_and_the_mission():
    result = errand("parse", DECIDES, "--explain")
    assert "parts:\n  if | there is a beer in the kitchen\n  tell Robin\n" in result.stdout
    assert result.stdout.rstrip().endswith("\n".join(f"  {line}" for line in MISSION))


def test_the_arcs_are_drawn(tmp_path):
    done(*OPEN, SENTENCE, "--format", "svg", "--out", str(tmp_path / "arcs.svg"))
    drawing = (tmp_path / "arcs.svg").read_text(encoding="utf-8")
    assert drawing.startswith("<svg")
    assert ">mug</tspan>" in drawing
