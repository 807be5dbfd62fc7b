"""`errand plugins`: what other distributions register, which of it is broken, and that none keeps a command waiting."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.executive.cli.calls import json_of
from tests.executive.distribution import write_distribution

ROOT = Path(__file__).parents[3]


@pytest.fixture
def errand(tmp_path):
    skills = ("exits = wavers_exits:Wave", "hangs = wavers_hangs:Wave")
    write_distribution(tmp_path, "wavers", "errand.skills", *skills, "[errand.triggers]", "bell = wavers_bell:Bell")
    (tmp_path / "wavers_exits.py").write_text("raise SystemExit(0)\n")
    (tmp_path / "wavers_hangs.py").write_text("import time\ntime.sleep(300)\n")
    (tmp_path / "wavers_bell.py").write_text("class Bell: pass\n")
    where = os.pathsep.join([str(tmp_path), str(ROOT)])

    def run(*arguments):
        command = [sys.executable, "-m", "executive.cli", *arguments]
        environment = {**os.environ, "PYTHONPATH": where}
        return subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)

    return run


def test_each_plug_in_is_listed_with_what_is_wrong_with_it(errand):
    ended = errand("plugins", "--limit", "2", "--json")
    listed = json_of(ended)["plugins"]
    told = [each for each in listed if each["distribution"] == "wavers"]
    assert [each["name"] for each in told] == ["exits", "hangs", "bell"]
    assert "cannot load wavers_exits:Wave (SystemExit: 0)" in told[0]["broken"]
    assert "is not loaded within 2 s" in told[1]["broken"]
    assert (told[2]["broken"], ended.returncode) == (None, 1)


# group      cannot be used
# backends   a plain class, a name in capitals
# commands   no word, a group that Errand lacks, a name of Errand's own
# kernels    no function
UNUSABLE = {
    ("errand.backends", "bell = wavers_bell:Bell"): "no frozen dataclass with a method connect",
    ("errand.commands", "Bell = wavers_bell:ring"): "a command's name is a word in lower case",
    ("errand.commands", "map.x.y = wavers_bell:ring"): "a command's name is a word in lower case",
    ("errand.commands", "parse.more = wavers_bell:ring"): "Errand has no group of commands 'parse'",
    ("errand.commands", "queue.add = wavers_bell:ring"): "a command of Errand has this name",
    ("errand.kernels", "bell = wavers_bell:NUMBER"): "wavers_bell:NUMBER is no function",
}


def test_unusable_entries_are_listed_with_their_reasons(errand, tmp_path):
    for number, (group, entry) in enumerate(UNUSABLE):
        write_distribution(tmp_path, f"ringers{number}", group, entry)
    (tmp_path / "wavers_bell.py").write_text("NUMBER = 3\nclass Bell: pass\ndef ring(): pass\n")
    listed = json_of(errand("plugins", "--limit", "2", "--json"))["plugins"]
    broken = {each["distribution"]: each["broken"] for each in listed}
    told = {entry: broken[f"ringers{number}"] for number, entry in enumerate(UNUSABLE)}
    assert [entry for entry, why in UNUSABLE.items() if why not in told[entry]] == []


def test_a_plug_in_that_hangs_keeps_no_command_waiting_that_does_not_use_it(errand, tmp_path):
    (tmp_path / "go.yaml").write_text("name: go\nsteps: [{to: kitchen}]\n")
    assert errand("check", "go.yaml").returncode == 0
