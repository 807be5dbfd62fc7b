"""Tutorials, the first hour and four how-to pages do as they say: files are written, commands run, output comes."""

import contextlib
import os
import re
import shlex
import subprocess
import sysconfig
import venv

import pytest
from rover_urdf import write_package
from typer.testing import CliRunner

from executive.cli.entry import app
from tests.docs.documents import DOCS, ROOT, Block, blocks

TUTORIALS = sorted((DOCS / "tutorials").glob("[0-9]*.md"))
HOW_TO = [DOCS / "how-to" / name for name in ("own-world.md", "own-robot.md", "own-task.md")]
HOW_TO += [ROOT / "plugins/errand-make/docs/own-object.md"]
HOW_TO += [DOCS / "first-hour.md"]
PAGES = [*TUTORIALS, *HOW_TO]


class Reader:
    """Somebody who follows a tutorial in an empty folder, with an environment of their own to install into.

    `here` the commands run in this process and environment.
    """

    def __init__(self, folder, *, here=False):
        self.folder, self.output, self.old = folder / "work", "", ""
        self.folder.mkdir()
        self.bin = None if here else self._environment(folder / "env")

    def _environment(self, folder):
        """A virtual environment that also sees all that this one has."""
        venv.create(folder, with_pip=False, symlinks=True)
        (site,) = folder.glob("lib/python*/site-packages")
        ours = sysconfig.get_paths()["purelib"]
        (site / "ours.pth").write_text(f"import site; site.addsitedir({ours!r})\n")
        for name, module in {"errand": "executive.cli", "pytest": "pytest", "pip": "pip"}.items():
            script = folder / "bin" / name
            script.write_text(f'#!/bin/sh\nexec {shlex.quote(str(folder / "bin" / "python"))} -m {module} "$@"\n')
            script.chmod(0o755)
        return folder / "bin"

    def follow(self, block):
        """Do what a block asks for, or look whether it shows what came."""
        kind, _, rest = block.mark.partition(": ")
        {"file": self.write, "old": self.remember, "new": self.change}.get(kind, lambda block, rest: None)(block, rest)
        if block.kind == "sh":
            self.run(block)
        if block.kind == "text":
            self.compare(block)

    def write(self, block, name):
        (self.folder / name).write_text(block.text)

    def remember(self, block, name):
        assert block.text in (self.folder / name).read_text(), f"{name} does not hold what line {block.line} shows"
        self.old = block.text

    def change(self, block, name):
        path = self.folder / name
        path.write_text(path.read_text().replace(self.old, block.text))

    def run(self, block):
        self.output, failed = "", False
        if self.bin is None:
            for line in block.text.splitlines():
                with contextlib.chdir(self.folder):
                    done = CliRunner().invoke(app, shlex.split(line, comments=True)[1:], env={"COLUMNS": "200"})
                self.output += done.output
                failed |= done.exit_code != 0
        else:
            failed = self.start(block.text)
        assert failed == (block.mark == "fails"), f"line {block.line}: {self.output}"

    def start(self, script):
        """Runs a script in the reader's environment; returns whether it failed."""
        path = os.pathsep.join([str(self.bin), os.environ["PATH"]])
        environment = {**os.environ, "PATH": path, "COLUMNS": "200", "PIP_NO_INDEX": "1", "PYTHONPATH": ""}
        shell = ["bash", "-e", "-c", script]
        done = subprocess.run(shell, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=600)
        self.output = f"status {done.returncode}\n{done.stdout}{done.stderr}"
        return done.returncode != 0

    def compare(self, block):
        came = squeezed(self.output)
        for line in block.text.splitlines():
            assert line == "..." or squeezed(line) in came, f"line {block.line}: {line!r} is not in\n{self.output}"


def squeezed(text):
    return re.sub(r"\s+", " ", text).strip()


def followed(page):
    """A page as a case; the pages follow nightly."""
    slow = any(block.mark == "slow" for block in blocks(page))
    return pytest.param(page, marks=[pytest.mark.nightly, *[pytest.mark.mission] * slow], id=page.stem)


@pytest.mark.parametrize("page", [followed(page) for page in PAGES])
def test_a_tutorial_does_what_it_says(page, tmp_path):
    reader = Reader(tmp_path)
    if page.name == "own-robot.md":
        write_package(reader.folder, with_head=True)
    for block in blocks(page):
        reader.follow(block)


@pytest.mark.mission
def test_the_first_tutorial_does_what_it_says_in_this_process(tmp_path):
    """It stands for all in `make test`."""
    reader = Reader(tmp_path, here=True)
    for block in blocks(PAGES[0]):
        reader.follow(block)


def test_there_are_tutorials():
    assert len(TUTORIALS) >= 4


def test_tutorials_are_numbered_and_say_first_what_will_be_learnt():
    for number, page in enumerate(TUTORIALS, start=1):
        lines = page.read_text().splitlines()
        assert page.name.startswith(f"{number:02d}-")
        assert lines[0].startswith(f"# {number}. ")
        assert lines[2].startswith("You will learn")
        steps = re.findall(r"^## (\d+)\. ", page.read_text(), re.MULTILINE)
        assert steps == [str(n) for n in range(1, len(steps) + 1)]


def test_the_reader_notices_output_that_did_not_come(tmp_path):
    reader = Reader(tmp_path)
    reader.follow(Block("sh", "echo one\n", "", 1))
    with pytest.raises(AssertionError, match="'two' is not in"):
        reader.follow(Block("text", "two\n", "", 3))


def test_the_reader_notices_a_command_that_fails(tmp_path):
    with pytest.raises(AssertionError, match="status 3"):
        Reader(tmp_path).follow(Block("sh", "exit 3\n", "", 1))
