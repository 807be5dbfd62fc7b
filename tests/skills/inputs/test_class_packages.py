"""Classes of objects that another distribution brings, by an entry point in `errand.classes`."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from plant.models.catalogue import MODELS_FOLDER
from plant.worlds.world import WORLDS_FOLDER
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


def run(site, *command):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}
    return subprocess.run(
        [sys.executable, *command], env=environment, cwd=site, capture_output=True, text=True, check=False
    )


def errand(site, *arguments):
    return run(site, "-m", "executive.cli", *arguments)


def test_a_sentence_may_name_the_class_by_its_own_synonym(site):
    ended = errand(site, "parse", "bring me the beaker", "--world", "pantry")
    assert (ended.returncode, "do [grasp] to [mug]" in ended.stdout) == (0, True), ended.stderr


def test_its_models_stand_in_a_world(site):
    code = "from plant.worlds.seeding import place_objects; from plant.worlds.world import load_world\n"
    code += "placed = place_objects(load_world('pantry'), 4801)[0]; print(placed.class_name, placed.model_path)"
    ended = run(site, "-c", code)
    assert ended.stdout == f"mug {site / 'mugs' / 'plain' / 'mug.sdf'}\n", ended.stderr


def test_a_mission_for_it_needs_a_detector_that_knows_it(site):
    (site / "fetch.yaml").write_text("name: fetch\nsteps:\n  - say: bring me the mug\n")
    ended = errand(site, "check", "fetch.yaml", "--world", "pantry")
    assert ended.returncode != 0
    assert "the robot does not know what mug looks like" in ended.stdout + ended.stderr


def test_a_network_that_knows_it_needs_its_form_alone(site):
    for name in ("catalogue.yaml", "synonyms.yaml"):
        (site / "mugs" / name).unlink()
    shutil.copy(WORLDS_FOLDER / "flat" / "objects.yaml", site / "pantry")
    output = {"output0": np.zeros((1, 5, 84), np.float32)}
    export(site / "own.onnx", output, metadata={"names": "{0: 'cup'}"})
    (site / "own.yaml").write_text("detector: {use: onnx, file: own.onnx, classes: {cup: mug}}\n")
    (site / "fetch.yaml").write_text("name: fetch\nsteps:\n  - say: bring me the mug\n")
    ended = errand(site, "check", "fetch.yaml", "--world", "pantry", "--stack", "own.yaml")
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        ("class_forms.yaml", FORM.replace("40", "4"), "class 'mug' has the name or the id (4) of another"),
        ("class_forms.yaml", FORM.replace("round", "oval"), "mug.form"),
        ("catalogue.yaml", MODELS.replace("rest_height_m", "height"), "mug.forms.plain"),
    ],
)
def test_a_broken_class_is_reported_with_its_file(site, file, text, says):
    (site / "mugs" / file).write_text(text)
    ended = errand(site, "check", "--say", "bring me the mug", "--world", "pantry")
    assert ended.returncode == 2
    assert says in ended.stderr
    assert f"{site / 'mugs' / file}: " in ended.stderr


def test_a_broken_class_is_listed_among_the_plug_ins(site):
    (site / "mugs" / "class_forms.yaml").write_text(FORM.replace("round", "oval"))
    ended = errand(site, "plugins", "--json")
    (plugin,) = (
        each for each in json.loads(ended.stdout.splitlines()[-1])["plugins"] if each["distribution"] == "mugs"
    )
    assert ended.returncode == 1
    assert "class_forms.yaml: mug.form" in plugin["broken"]


def test_an_entry_point_without_its_package_is_reported(site):
    shutil.rmtree(site / "mugs")
    ended = errand(site, "parse", "bring me the beer", "--world", "pantry")
    assert "mugs of distribution mugs, which has classes, is no package" in ended.stderr
