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


PAGES = """
from executive.words.task import Part
from tests.executive.house_tasks import Call, Vacuum, Water

class Mop(Vacuum):
    '''Mops a floor.'''
    word = "mop"
    sentences = ({"template": "mop {place:where}", "samples": ["mop the hall"]},)

class Sing(Call):
    '''Calls out what is announced.'''
    word = "sing"
    sentences = ({"template": "(sing|announce) {text:object}", "samples": ["sing la la la"]},)

class Dust(Water):
    '''Dusts what no world has, and what the flat has.'''
    word = "dust"
    sentences = ({"template": "dust {thing:object}", "samples": ["dust the ficus", "dust the beer"]},)

class Spin(Call):
    '''Turns as often as is said, which is how often to do anything else, too.'''
    word, object_is = "spin", Part.NUMBER
    sentences = ({"template": "spin {number:object} [times]", "samples": ["spin 3 times"]},)

class Take(Call):
    '''Takes all that is said.'''
    word = "take"
    sentences = ({"template": "{text:object}", "samples": ["anything"]},)
"""
# what is wrong with a task; None: nothing
TASKS = {
    "mop": "the template 'mop {place:where}': the task has no part 'where' for a slot",
    "sing": "'announce to everybody that dinner is ready', a sentence of Errand itself, is also one of task 'sing' of",
    "take": "the template '{text:object}': it begins with no certain words",
    "vacuum": None,
    "dust": None,
    "spin": "its sample 'spin 3 times' is refused: I do not understand 'spin'",
}
SAMPLES = {"vacuum": "vacuum the hall", "dust": "dust the beer", "spin": None}


def test_faults_of_tasks_are_listed_beside_tasks_without_any(tmp_path):
    lines = (f"{word} = house_pages:{word.title()}" for word in TASKS)
    write_distribution(tmp_path, "house", "errand.tasks", *lines)
    (tmp_path / "house_pages.py").write_text(PAGES)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    command = [sys.executable, "-m", "executive.cli", "plugins"]
    ended = subprocess.run([*command, "--json"], env=environment, capture_output=True, text=True, check=False)
    told = {each["name"]: each["broken"] for each in json_of(ended)["plugins"] if each["distribution"] == "house"}
    assert [
        word
        for word, why in TASKS.items()
        if (why is None) != (told[word] is None) or (why or "") not in str(told[word])
    ] == []
    assert ended.returncode == 1
    shown = {each["name"]: each["sample"] for each in json_of(ended)["plugins"] if each["distribution"] == "house"}
    assert {word: shown[word] for word in SAMPLES} == SAMPLES


def test_a_command_imports_no_plug_in_that_it_does_not_use(site, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)
    monkeypatch.setattr(from_request, "installed_skills", installed_skills)
    (tmp_path / "go.yaml").write_text("name: go\nsteps: [{to: kitchen}]\n")
    done("check", tmp_path / "go.yaml")
    assert not [name for name in sys.modules if name.startswith("wavers_")]
