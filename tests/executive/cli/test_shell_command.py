"""`errand shell` takes one command after another, and goes on after those that it refuses."""

import pytest

from executive.cli.shell_command import words_of_line
from tests.executive.cli.calls import errand


@pytest.fixture
def shell(tmp_path, monkeypatch):
    """Gives the shell lines in an empty folder; returns what it says."""
    monkeypatch.chdir(tmp_path)

    def take(*lines):
        result = errand("shell", input="\n".join(lines) + "\n")
        assert result.exit_code == 0, result.output
        return result

    return take


def test_commands_are_run_in_turn(shell):
    said = shell('parse "go to the kitchen"', "# a note", "", "missions").stdout
    assert said.startswith("Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]\n")
    assert "fetch_drink" in said


# a line that is refused, what the shell says of it
@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("dance", "No such command 'dance'"),
        ("parse 'go", "errand: 'parse 'go' cannot be read (No closing quotation); close the quotation mark"),
        ("check absent.yaml", "absent"),
        ("say sing it's a song", "errand: I do not understand"),
        ("shell", "errand: this is the shell already"),
    ],
)
def test_after_a_line_that_is_refused_the_next_one_is_taken(shell, line, said):
    result = shell(line, "parse 'go to the kitchen'")
    assert said in result.stderr
    assert "[kitchen]" in result.stdout


def test_exit_ends_it(shell):
    assert shell("exit", "missions").stdout == ""


# words before, the word begun, what it may become
@pytest.mark.parametrize(
    ("before", "typed", "found"),
    [
        ("", "ru", ["run", "runs"]),
        ("run ", "fetch", ["fetch_drink"]),
        ("check ", "patrol_", ["patrol_and_report"]),
        ("queue add ", "own", ["own.yaml"]),
        ("run --world ", "sh", ["shop"]),
        ("run patrol --world ", "f", ["flat"]),
        ("run ", "--no-rec", ["--no-record"]),
        ("replay ", "", ["out/2026-12-02-0900-b", "out/2026-12-01-0900-a"]),
        ("log ", "out/2026-12-01", ["out/2026-12-01-0900-a", "out/2026-12-01-0900-a/"]),
        ("tree ", "patrol_", ["patrol_and_report"]),
        ("say go to the ", "kit", ["kitchen"]),
        ("say bring the beer to ", "r", ["robin", "room"]),
        ("dance ", "x", []),
    ],
)
def test_missions_worlds_runs_and_places_are_completed(tmp_path, monkeypatch, before, typed, found):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.yaml").touch()
    for run in ("2026-12-01-0900-a", "2026-12-02-0900-b"):
        (tmp_path / "out" / run).mkdir(parents=True)
        (tmp_path / "out" / run / "run.json").touch()
    assert [each.lower() for each in words_of_line(before, typed)] == found
