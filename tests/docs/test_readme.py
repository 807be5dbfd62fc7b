"""The commands of the README and of the page of commands that need no robot succeed as they stand."""

import re
import shlex

import pytest
from typer.testing import CliRunner

from executive.cli.entry import app
from tests.docs.documents import DOCS, ROOT, commands

PAGES = (ROOT / "README.md", DOCS / "how-to" / "commands.md")
QUICK_COMMANDS = {"parse", "tree", "check", "stack"}
SHOWN = {page.name: commands(page) for page in PAGES}
ALL = sorted({line for lines in SHOWN.values() for line in lines})
QUICK = [line for line in ALL if line.split()[1] in QUICK_COMMANDS and "out/" not in line]


def test_the_pages_show_commands():
    assert len(SHOWN["README.md"]) == 5
    assert len(ALL) > 20
    assert {line.split()[1] for line in QUICK} == QUICK_COMMANDS


@pytest.mark.parametrize("line", QUICK)
def test_quick_commands_succeed_as_they_stand(line, tmp_path, monkeypatch):
    (tmp_path / "missions").symlink_to(ROOT / "missions")
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, shlex.split(line, comments=True)[1:])
    assert result.exit_code == 0, result.output


def test_every_target_of_make_that_the_readme_names_is_there():
    named = set(re.findall(r"^make (\w+)|`make (\w+)`", PAGES[0].read_text(encoding="utf-8"), re.MULTILINE))
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert {"demo", "test"} <= {one or other for one, other in named} <= targets
