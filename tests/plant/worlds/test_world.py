"""A world is loaded, and a wrong file is refused with its place."""

import os
import shutil
from importlib.metadata import EntryPoint, EntryPoints

import pytest

from executive.words.mission import Route
from plant.worlds import world as world_module
from plant.worlds.seeding import PointStop, place_objects, place_people
from plant.worlds.world import WORLDS_FOLDER, WorldError, known_worlds, load_world
from skills.inputs.errors import InputError
from skills.inputs.plugins import WORLDS
from skills.robot import Pose2D
from tests.project import shipped_worlds
from tests.tables import table


@pytest.fixture
def copy(tmp_path):
    """A copy of the flat's small files."""
    folder = tmp_path / "home"
    folder.mkdir()
    for name in ("world.dmd.yaml", "knowledge.yaml", "objects.yaml"):
        shutil.copy(WORLDS_FOLDER / "flat" / name, folder / name)
    return folder


def test_flat_is_known_and_has_its_rooms_and_files():
    world = load_world("flat")
    assert "flat" in shipped_worlds()
    assert {"hall", "kitchen", "living room", "bedroom", "bathroom", "workshop"} <= set(world.rooms)
    for path in (world.directives_path, world.knowledge_path, world.scan_map_path, world.keepout_map_path):
        assert path.is_file()


def test_a_world_is_loaded_by_its_folder_too(copy):
    assert load_world(copy).name == "home"


def test_a_world_of_a_plug_in_is_known_by_its_name_and_an_unknown_one_is_told_it(copy, tmp_path, monkeypatch):
    shutil.copytree(copy, tmp_path / "hut_worlds" / "hut")
    (tmp_path / "hut_worlds" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    entries = EntryPoints([EntryPoint("hut", "hut_worlds", WORLDS)])
    monkeypatch.setattr(world_module, "installed_plugins", lambda group: entries.select(group=group))
    assert load_world("hut").folder == tmp_path / "hut_worlds" / "hut"
    assert known_worlds() == (*shipped_worlds(), "hut")
    with pytest.raises(WorldError, match="Did you mean 'hut'"):
        load_world("huts")


def test_an_unknown_world_is_told_the_near_one():
    with pytest.raises(InputError, match=r"unknown world 'flatt'\. Did you mean 'flat'\? Known worlds: flat"):
        load_world("flatt")


@pytest.mark.parametrize(*table(__file__, "wrong_lines"))
def test_a_wrong_line_is_named(copy, file, old, new, says):
    path = copy / f"{file}.yaml"
    before, found, after = path.read_text(encoding="utf-8").partition(old)
    assert found
    path.write_text(before + new + after, encoding="utf-8")
    line = before.count("\n") + 1
    with pytest.raises(InputError, match=rf"{file}\.yaml:{says}".replace("LINE", str(line))):
        load_world(copy)


def test_a_missing_file_is_named(copy):
    (copy / "knowledge.yaml").unlink()
    with pytest.raises(InputError, match=r"knowledge\.yaml: there is no such file"):
        load_world(copy)


def test_a_pipe_is_refused_at_once(copy):
    (copy / "objects.yaml").unlink()
    os.mkfifo(copy / "objects.yaml")
    with pytest.raises(InputError, match=r"objects\.yaml:1: it is a pipe"):
        load_world(copy)


@pytest.mark.parametrize(
    "text", [b"\xff", b"a: !!python/object:x.y {}", b"x: 0x" + b"f" * 10_000, b"[" * 3000, b"x: " + b"9" * 5000]
)
def test_an_invalid_yaml_file_is_named(copy, text):
    (copy / "objects.yaml").write_bytes(text)
    with pytest.raises(InputError, match=r"objects\.yaml:[12]: ") as error:
        load_world(copy)
    assert len(str(error.value)) < 500


def test_geometry_and_a_start_are_enough(copy):
    (copy / "objects.yaml").unlink()
    (copy / "knowledge.yaml").write_text("start: {x: 1.0, y: 2.0, yaw: 0.5}")
    world = load_world(copy)
    assert world.start == Pose2D(1.0, 2.0, 0.5)
    assert (world.dock, world.rooms, world.surfaces, world.seed_rules.objects) == (None, {}, {}, ())
    assert place_objects(world, 1) == place_people(world, 1) == ()
    assert world.corners == ((-4.0, -3.0), (6.0, 7.0))


WALKER = """people:
  - name: Kim
    route: {waypoints: [kitchen, {at: [8.0, 4.0], pause: 2}, desk], speed: 0.9, loop: true, start: 5, yields: false}
"""


def with_people(copy, people):
    path = copy / "objects.yaml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.index("people:")] + people, encoding="utf-8")
    return copy


def test_a_person_walks_on_a_route_of_places_and_points(copy):
    (kim,) = place_people(load_world(with_people(copy, WALKER)), seed=1)
    stops = (PointStop((8.4, 6.9), 0.0), PointStop((8.0, 4.0), 2.0), PointStop((5.75, 1.75), 0.0))
    facts = {"stops": stops, "speed_m_s": 0.9, "loops": True, "start_s": 5.0, "yields": False}
    assert {name: getattr(kim.route, name) for name in facts} == facts
    assert tuple(kim.X_WO.translation()[:2]) == (8.4, 6.9)


@pytest.mark.parametrize(*table(__file__, "wrong_people"))
def test_a_wrong_person_is_refused(copy, people, says):
    with pytest.raises(InputError, match=says):
        load_world(with_people(copy, people))


def test_routes_are_added_and_take_the_place_of_who_stands():
    world = load_world("flat")
    routes = {"Robin": Route(waypoints=("kitchen", "office")), "Kim": Route(waypoints=((4.0, 4.5),))}
    walking = [(each.name, each.route is not None) for each in place_people(world.with_routes(routes), 1)]
    assert (walking, [each.name for each in place_people(world, 1)]) == ([("Robin", True), ("Kim", True)], ["Robin"])
    with pytest.raises(InputError, match="'hammer' names two"):
        world.with_routes({"hammer": Route(waypoints=("kitchen",))})


def test_a_lidar_near_the_floor_has_a_map_of_its_own():
    """Bands: scan 0.7 to 1.3 m, low_scan 0.27 to 0.31 m."""
    flat = load_world("flat")
    names = [flat.scan_map_seen_from(height_m).name for height_m in (0.92, 0.288, 0.35, 2.0, None)]
    assert names == ["scan.yaml", "low_scan.yaml", "low_scan.yaml", "scan.yaml", "scan.yaml"]
