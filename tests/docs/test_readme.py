"""The commands that the README shows exist, and those that need neither robot nor a recording succeed as they stand."""

import re
import shlex
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).parent))
from documents import ROOT, unknown_command

from executive.cli.entry import app

_SHOWN = re.compile(r"^    (errand .*)$", re.MULTILINE)
_QUICK = {"parse", "tree", "check", "queue"}
SHOWN = sorted(set(_SHOWN.findall((ROOT / "README.md").read_text(encoding="utf-8"))))
QUICK = [line for line in SHOWN if line.split()[1] in _QUICK]


def words_of(line):
    """The words after `errand`; patterns of files are replaced by the files, as a shell would."""
    words = shlex.split(line, comments=True)[1:]
    return [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]


def test_the_readme_shows_commands():
    assert len(SHOWN) > 20
    assert {line.split()[1] for line in QUICK} == _QUICK


@pytest.mark.parametrize("line", SHOWN)
def test_every_command_of_the_readme_exists(line):
    assert unknown_command(line) is None


@pytest.mark.parametrize("line", QUICK)
def test_quick_commands_of_the_readme_succeed_as_they_stand(line, tmp_path, monkeypatch):
    (tmp_path / "missions").symlink_to(ROOT / "missions")
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, words_of(line))
    assert result.exit_code == 0, result.output
