"""Classes of objects that another distribution brings, by an entry point in `errand.classes`."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from executive.app.prepare import feasibility
from executive.cli import plugins_command
from executive.language import spelling
from plant.models.catalogue import MODELS_FOLDER, load_catalogue
from plant.worlds.seeding import place_objects
from plant.worlds.world import WORLDS_FOLDER, load_world
from skills.class_forms import class_forms
from skills.inputs.plugins import CLASSES
from tests.executive.cli.calls import done, errand, json_of, refusal
from tests.skills.exported_networks import export

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "own-class.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"^<!-- file: (\S+) -->\n+```\w+\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
"""Files of the package on the page, by their paths."""
FORM, MODELS = FILES["mugs/class_forms.yaml"], FILES["mugs/catalogue.yaml"]


@pytest.fixture
def site(tmp_path):
    """Folder with the distribution of the page as if it were installed, and a world with a mug."""
    info, package = tmp_path / "mugs-1.0.dist-info", tmp_path / "mugs"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mugs\nVersion: 1.0\n")
    groups = tomllib.loads(FILES["pyproject.toml"])["project"]["entry-points"]
    lines = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in named.items()) for group, named in groups.items()]
    (info / "entry_points.txt").write_text("".join(lines))
    package.mkdir()
    (package / "__init__.py").write_text("raise RuntimeError('nothing here is run')\n")
    for name in ("class_forms.yaml", "catalogue.yaml", "synonyms.yaml"):
        (package / name).write_text(FILES[f"mugs/{name}"])
    (package / "plain").mkdir()
    for name in ("cube.sdf", "cube.obj", "cube.mtl", "paint.png"):
        shutil.copy(MODELS_FOLDER / "cube" / name, package / "plain" / name.replace("cube.sdf", "mug.sdf"))
    world = shutil.copytree(WORLDS_FOLDER / "flat", tmp_path / "pantry")
    knowledge, objects = world / "knowledge.yaml", world / "objects.yaml"
    knowledge.write_text(knowledge.read_text().replace("things:\n", "things:\n  mug: {usual: [kitchen counter]}\n"))
    rule = "objects:\n  - {name: mug, model: mug, surfaces: [kitchen counter]}\n"
    objects.write_text(objects.read_text().replace("objects:\n", rule))
    return tmp_path


@pytest.fixture
def installed(site, monkeypatch):
    """Installs the distribution for this process, which has read no classes; afterwards it reads them again."""
    read = (class_forms, load_catalogue, spelling._synonyms, feasibility.abilities_of)
    monkeypatch.chdir(site)
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)
    for each in read:
        each.cache_clear()
    yield site
    for each in read:
        each.cache_clear()


def test_a_sentence_may_name_the_class_by_its_own_synonym(site):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}
    command = [sys.executable, "-m", "executive.cli", "parse", "bring me the beaker", "--world", "pantry"]
    ended = subprocess.run(command, env=environment, cwd=site, capture_output=True, text=True, check=False)
    assert (ended.returncode, "do [grasp] to [mug]" in ended.stdout) == (0, True), ended.stderr


def test_its_models_stand_in_a_world(installed):
    placed = place_objects(load_world("pantry"), 4801)[0]
    assert (placed.class_name, placed.model_path) == ("mug", installed / "mugs" / "plain" / "mug.sdf")


def test_a_mission_for_it_needs_a_detector_that_knows_it(installed):
    (installed / "fetch.yaml").write_text("name: fetch\nsteps:\n  - say: bring me the mug\n")
    ended = errand("check", "fetch.yaml", "--world", "pantry")
    assert ended.exit_code != 0
    assert "the robot does not know what mug looks like" in ended.output


def test_a_network_that_knows_it_needs_its_form_alone(installed):
    for name in ("catalogue.yaml", "synonyms.yaml"):
        (installed / "mugs" / name).unlink()
    shutil.copy(WORLDS_FOLDER / "flat" / "objects.yaml", installed / "pantry")
    output = {"output0": np.zeros((1, 5, 84), np.float32)}
    export(installed / "own.onnx", output, metadata={"names": "{0: 'cup'}"})
    (installed / "own.yaml").write_text("detector: {use: onnx, file: own.onnx, classes: {cup: mug}}\n")
    (installed / "fetch.yaml").write_text("name: fetch\nsteps:\n  - say: bring me the mug\n")
    done("check", "fetch.yaml", "--world", "pantry", "--stack", "own.yaml")


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        ("class_forms.yaml", FORM.replace("40", "4"), "class 'mug' has the name or the id (4) of another"),
        ("class_forms.yaml", FORM.replace("round", "oval"), "mug.form"),
        ("catalogue.yaml", MODELS.replace("rest_height_m", "height"), "mug.forms.plain"),
    ],
)
def test_a_broken_class_is_reported_with_its_file(installed, file, text, says):
    (installed / "mugs" / file).write_text(text)
    said = refusal("check", "--say", "bring me the mug", "--world", "pantry")
    assert says in said
    assert f"{installed / 'mugs' / file}: " in said


def test_a_broken_class_is_listed_among_the_plug_ins(installed, monkeypatch):
    (installed / "mugs" / "class_forms.yaml").write_text(FORM.replace("round", "oval"))
    monkeypatch.setattr(plugins_command, "groups", lambda: [CLASSES])
    ended = errand("plugins", "--json")
    (plugin,) = json_of(ended)["plugins"]
    assert (ended.exit_code, plugin["distribution"]) == (1, "mugs")
    assert "class_forms.yaml: mug.form" in plugin["broken"]


def test_an_entry_point_without_its_package_is_reported(installed):
    shutil.rmtree(installed / "mugs")
    said = errand("parse", "bring me the beer", "--world", "pantry").stderr
    assert "mugs of distribution mugs, for errand.classes, is no package" in said
