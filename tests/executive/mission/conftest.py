"""Missions in the flat; the parser is loaded once."""

import shutil
from pathlib import Path

import pytest

from executive.language.parser import load_parser
from executive.mission.load import knowledge_of_mission, load_mission, mission_of_robot
from executive.mission.resolve import mission_from_file
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import load_knowledge

ROOT = Path(__file__).parents[3]
WORLDS = ROOT / "plant" / "worlds"


@pytest.fixture(scope="session")
def parser():
    return load_parser()


@pytest.fixture(scope="session")
def flat():
    return load_knowledge(WORLDS / "flat" / "knowledge.yaml")


@pytest.fixture(scope="session")
def knowledge_in(flat):
    """Knowledge of a mission in its own world, with that of its file."""

    def know(loaded):
        own = flat if loaded.world == "flat" else load_knowledge(WORLDS / loaded.world / "knowledge.yaml")
        return knowledge_of_mission(loaded, own)

    return know


@pytest.fixture(scope="session")
def skills():
    return installed_skills()


@pytest.fixture(scope="session")
def missions():
    """Shipped mission files."""
    return sorted((ROOT / "missions").glob("*.yaml"))


@pytest.fixture(scope="session")
def compile_file(parser, knowledge_in, skills):
    """Loads and compiles a file as `errand run` does before it runs."""

    def compile_path(path):
        loaded = load_mission(path)
        knowledge = knowledge_in(loaded)
        parts = [mission_of_robot(loaded, name, name) for name in loaded.parts or ()] or [loaded]
        missions = [mission_from_file(part, parser=parser, knowledge=knowledge) for part in parts]
        trees = [compile_mission(mission, knowledge=knowledge, registry=skills) for mission in missions]
        return trees[0]

    return compile_path


@pytest.fixture
def write(tmp_path):
    """Writes `mission.yaml`, and other files by name, into a folder; returns the path of the mission."""

    def to_files(text, **others):
        for name, content in {**others, "mission": text}.items():
            (tmp_path / f"{name}.yaml").write_text(content, encoding="utf-8")
        return tmp_path / "mission.yaml"

    return to_files


@pytest.fixture
def load(write, parser, flat):
    """Loads the mission of a text."""
    return lambda text, **others: mission_from_file(write(text, **others), parser=parser, knowledge=flat)


@pytest.fixture
def compile_text(compile_file, write):
    return lambda text, **others: compile_file(write(text, **others))


@pytest.fixture
def mission_folder(tmp_path, missions):
    """Folder with copies of all shipped missions."""
    for path in missions:
        shutil.copy(path, tmp_path)
    return tmp_path
