"""Worlds with imported models: they are placed, and of their class; wrong imports are refused."""

import shutil

import pytest

from plant.worlds.seeding import place_objects
from plant.worlds.world import WORLDS_FOLDER, ObjectRule, load_world
from skills.inputs.errors import InputError
from tests.plant.imported_box import write_box

OBJECTS = "objects:\n  - {name: my tool, model: tool, surfaces: [workbench]}\n"


@pytest.fixture
def world_folder(tmp_path):
    """The flat with one object, an imported one, and nobody in it."""
    write_box(tmp_path / "my tool", "tool", "hammer", 0.5)
    folder = tmp_path / "flat"
    shutil.copytree(WORLDS_FOLDER / "flat", folder)
    rules = (folder / "objects.yaml").read_text().partition("objects:\n")[0]
    (folder / "objects.yaml").write_text(f"imports: [../my tool]\n{rules}{OBJECTS}")
    return folder


def test_it_is_of_the_class_that_it_was_imported_with(world_folder):
    (placed,) = place_objects(load_world(world_folder), 1)
    assert (placed.name, placed.class_name) == ("my tool", "hammer")


def test_a_folder_that_is_none_is_named_with_the_file(world_folder):
    path = world_folder / "objects.yaml"
    path.write_text(path.read_text().replace("../my tool", "../no tool"))
    with pytest.raises(InputError, match=r"objects\.yaml:\d+: .*no tool: there is no imported object"):
        load_world(world_folder)


def test_two_models_of_one_name_are_refused(world_folder, tmp_path):
    world = load_world(world_folder)
    assert world.with_imports([tmp_path / "my tool"]).imports == world.imports
    shutil.copytree(tmp_path / "my tool", tmp_path / "other")
    with pytest.raises(InputError, match="are both called 'tool'"):
        world.with_imports([tmp_path / "other"])


def test_a_name_is_that_of_one_object(world_folder):
    with pytest.raises(InputError, match="'my tool' names two objects or people"):
        load_world(world_folder).with_objects([ObjectRule(name="my tool", model="coke", surfaces=("workbench",))])
