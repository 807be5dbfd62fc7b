"""Shipped missions by name, from any folder."""

import json
import shutil
import sys
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from executive.app.prepare.mission_files import mission_file, shipped_missions
from executive.cli import missions_command
from executive.cli.missions_command import init
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import parse_yaml
from tests.executive.cli.calls import done, errand

sys.path.insert(0, str(Path(__file__).parents[3] / "docs"))
from file_schemas import schema_text, schemas

MISSIONS = Path(__file__).parents[3] / "missions"
SCHEMA = "mission.schema.json"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Each test works in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_each_shipped_mission_has_a_line_that_says_what_it_shows():
    _, *lines = errand("missions").stdout.splitlines()
    assert [line.split()[0] for line in lines] == sorted(file.stem for file in MISSIONS.glob("*.yaml"))
    assert all(len(line.split()) > 2 for line in lines)


@pytest.mark.parametrize("named", ["fetch_drink", "fetch_drink.yaml", "missions/fetch_drink.yaml"])
def test_a_shipped_mission_is_found_by_name(named):
    assert mission_file(Path(named)) == MISSIONS / "fetch_drink.yaml"


@pytest.mark.parametrize("named", ["absent.yaml", "there/fetch_drink.yaml", "fetch_drink.txt"])
def test_a_path_that_names_no_shipped_mission_is_left_as_it_is(named):
    assert mission_file(Path(named)) == Path(named)


def test_a_file_of_ones_own_goes_first(elsewhere):
    (elsewhere / "fetch_drink").write_text("name: mine\nsteps:\n  - {to: kitchen}\n")
    assert mission_file(Path("fetch_drink")) == Path("fetch_drink")


@pytest.mark.parametrize(("named", "hint"), [("fetch_drnk", "'fetch_drink'"), ("unheard", "errand missions")])
def test_a_name_that_is_not_known_is_refused_with_what_is_near(named, hint):
    with pytest.raises(InputError, match=hint):
        mission_file(Path(named))


def test_check_and_tree_take_names():
    done("check", "go_living_room")
    assert errand("tree", "go_living_room", "--format", "json").stdout.startswith('{"id": "alice/go-living-room')


@pytest.fixture
def shipped(tmp_path_factory, monkeypatch):
    """The folder of the shipped missions as an installation has it, with their schema."""
    folder = tmp_path_factory.mktemp("shipped")
    for file in MISSIONS.glob("*.yaml"):
        shutil.copy(file, folder)
    (folder / SCHEMA).write_text(schema_text(schemas()[f"missions/{SCHEMA}"]), encoding="utf-8")
    monkeypatch.setattr(missions_command, "FOLDER", folder)
    return folder


def test_init_copies_the_missions_and_overwrites_nothing(elsewhere, shipped):
    (elsewhere / "mine").mkdir()
    (elsewhere / "mine" / "patrol.yaml").write_text("name: mine\n")
    done("init", "mine")
    assert {file.stem for file in (elsewhere / "mine").glob("*.yaml")} == set(shipped_missions())
    assert (elsewhere / "mine" / SCHEMA).read_bytes() == (shipped / SCHEMA).read_bytes()
    assert (elsewhere / "mine" / "patrol.yaml").read_text() == "name: mine\n"


def test_init_copies_missions_without_a_schema_where_none_was_made(elsewhere, shipped):
    (shipped / SCHEMA).unlink()
    done("init", "mine")
    assert {file.name for file in (elsewhere / "mine").iterdir()} == {file.name for file in MISSIONS.glob("*.yaml")}


#   a step, and whether the schema takes it
@pytest.mark.parametrize(
    ("step", "fits"),
    [
        ("vacuum: kitchen", True),
        ("water: {object: beer, goal: desk}", True),
        ("do: {task: call, object: 3}", True),
        ("{do: vacuum, to: hall}", True),
        ("vacuum: {gaol: hall}", False),
        ("do: {task: mop, goal: hall}", False),
        ("mop: hall", False),
    ],
)
def test_init_writes_a_schema_that_knows_the_installed_tasks(elsewhere, shipped, house_tasks, step, fits):
    init(elsewhere / "mine")
    schema = json.loads((elsewhere / "mine" / SCHEMA).read_text())
    text = f"name: mine\nsteps:\n  - {step}\n"
    assert Draft202012Validator(schema).is_valid(parse_yaml(text, elsewhere).data) is fits
