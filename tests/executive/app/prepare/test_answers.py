"""Answers to questions: given beforehand, by policy, at the terminal."""

import io

import pytest
from typer.testing import CliRunner

from executive.app.prepare.from_request import prepare
from executive.cli import entry
from executive.cli.output import ask_at_terminal
from executive.language.questions import ClarifyingQuestion, Slot
from executive.mission.request import Request
from executive.words.mission import QuestionPolicy
from skills.inputs.errors import InputError

TABLE = "put the cube on the table"
QUESTION = ClarifyingQuestion("Which table?", Slot.PLACE, ("kitchen table", "coffee table"), "kitchen table", "table")


def goals(request):
    return [command.goal for command in prepare(request).mission.commands]


def test_an_answer_given_beforehand_leads_to_the_commands():
    assert goals(Request(TABLE, answers=("coffee",))) == ["workshop", "coffee table"]


# What is given beforehand -> the table.
GIVEN = [({"answers": ("the second one",)}, "coffee table"), ({"questions": QuestionPolicy.FIRST}, "kitchen table")]


@pytest.mark.parametrize(("given", "table"), GIVEN)
def test_the_stored_sentence_has_the_answer_in_it(given, table):
    assert prepare(Request(TABLE, **given)).request.sentence == f"put the cube on the {table}"


def test_the_policy_first_takes_the_likeliest():
    assert goals(Request(TABLE, questions=QuestionPolicy.FIRST))[-1] == "kitchen table"


@pytest.mark.parametrize("policy", [None, QuestionPolicy.ASK, QuestionPolicy.REFUSE])
def test_in_scripts_an_open_question_is_refused_with_its_candidates(policy):
    with pytest.raises(InputError, match="kitchen table or coffee table"):
        prepare(Request(TABLE, questions=policy))


def test_an_answer_that_does_not_help_is_refused():
    with pytest.raises(InputError, match="unicorn"):
        prepare(Request(TABLE, answers=("the unicorn",)))


def test_a_user_at_the_terminal_is_asked(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.StringIO("2\n"))
    assert prepare(Request(TABLE), ask=ask_at_terminal).mission.commands[-1].goal == "coffee table"
    assert "[1] kitchen table  [2] coffee table" in capsys.readouterr().err


def test_an_empty_line_is_no_answer(monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert ask_at_terminal(QUESTION) is None


def test_the_files_own_policy_counts_unless_another_is_given(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(f"name: tidy\nquestions: first\nsteps:\n  - say: {TABLE}\n")
    assert goals(Request(file=path))[-1] == "kitchen table"
    assert goals(Request(file=path, answers=("coffee",)))[-1] == "coffee table"
    with pytest.raises(InputError, match=r"m.yaml:4: Which table"):
        prepare(Request(file=path, questions=QuestionPolicy.REFUSE))


def test_without_a_policy_a_file_with_an_open_question_is_refused_with_its_line(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(f"name: tidy\nsteps:\n  - say: {TABLE}\n")
    result = CliRunner().invoke(entry.app, ["check", str(path)])
    assert result.exit_code == 2
    assert "m.yaml:3: Which table: kitchen table or coffee table?" in result.stdout + result.stderr


def test_the_command_line_takes_answers():
    said = ["run", "--no-wake", "--say", "fetch me a cake", "--answer", "the moon"]
    result = CliRunner().invoke(entry.app, said)
    assert (result.exit_code, "cake" in result.stderr or "moon" in result.stderr) == (2, True)
