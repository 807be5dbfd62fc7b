"""`errand plugins`: what other distributions register, which of it is broken, and that none keeps a command waiting."""

import os
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from executive.app.prepare import from_request
from executive.tree.registry import installed_skills
from tests.executive.cli.calls import done, json_of
from tests.executive.distribution import write_distribution

ROOT = Path(__file__).parents[3]

# group      cannot be used
# backends   a plain class, a name in capitals
# commands   no word, a group that Errand lacks, a name of Errand's own
# kernels    no function
UNUSABLE = {
    ("errand.backends", "bell = wavers_bell:Bell"): "no frozen dataclass with a method connect",
    ("errand.commands", "Bell = wavers_bell:ring"): "a command's name is a word in lower case",
    ("errand.commands", "map.x.y = wavers_bell:ring"): "a command's name is a word in lower case",
    ("errand.commands", "missions = wavers_bell:ring"): "a command of Errand has this name",
    ("errand.commands", "parse.more = wavers_bell:ring"): "Errand has no group of commands 'parse'",
    ("errand.commands", "queue.add = wavers_bell:ring"): "a command of Errand has this name",
    ("errand.kernels", "bell = wavers_bell:NUMBER"): "wavers_bell:NUMBER is no function",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder with plug-ins that can be loaded, that end the process, that hang, and that cannot be used."""
    site = tmp_path_factory.mktemp("site")
    skills = ("exits = wavers_exits:Wave", "hangs = wavers_hangs:Wave")
    write_distribution(site, "wavers", "errand.skills", *skills, "[errand.triggers]", "bell = wavers_bell:Bell")
    for number, (group, entry) in enumerate(UNUSABLE):
        write_distribution(site, f"ringers{number}", group, entry)
    (site / "wavers_exits.py").write_text("raise SystemExit(0)\n")
    (site / "wavers_hangs.py").write_text("import time\ntime.sleep(300)\n")
    (site / "wavers_bell.py").write_text("NUMBER = 3\nclass Bell: pass\ndef ring(): pass\n")
    return site


@pytest.fixture(scope="module")
def ended(site):
    command = [sys.executable, "-m", "executive.cli", "plugins", "--limit", "2", "--json"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}
    return subprocess.run(command, env=environment, cwd=site, capture_output=True, text=True, check=False)


def test_each_plug_in_is_listed_with_what_is_wrong_with_it(ended):
    told = [each for each in json_of(ended)["plugins"] if each["distribution"] == "wavers"]
    assert [each["name"] for each in told] == ["exits", "hangs", "bell"]
    assert "cannot load wavers_exits:Wave (SystemExit: 0)" in told[0]["broken"]
    assert "is not loaded within 2 s" in told[1]["broken"]
    assert (told[2]["broken"], ended.returncode) == (None, 1)


def test_unusable_entries_are_listed_with_their_reasons(ended):
    broken = {each["distribution"]: each["broken"] for each in json_of(ended)["plugins"]}
    told = {entry: broken[f"ringers{number}"] for number, entry in enumerate(UNUSABLE)}
    assert [entry for entry, why in UNUSABLE.items() if why not in told[entry]] == []


def test_a_command_imports_no_plug_in_that_it_does_not_use(site, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)
    monkeypatch.setattr(from_request, "installed_skills", installed_skills)
    (tmp_path / "go.yaml").write_text("name: go\nsteps: [{to: kitchen}]\n")
    done("check", tmp_path / "go.yaml")
    assert not [name for name in sys.modules if name.startswith("wavers_")]
