"""A world is loaded, and a wrong file is refused with its place."""

import os
import shutil

import pytest

from executive.words.mission import Route
from plant.worlds.seeding import place_objects, place_people
from plant.worlds.world import WORLDS_FOLDER, known_worlds, load_world
from skills.files.errors import InputError
from skills.robot import Pose2D


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
    assert "flat" in known_worlds()
    assert {"hall", "kitchen", "living room", "bedroom", "bathroom", "workshop"} <= set(world.rooms)
    for path in (world.directives_path, world.knowledge_path, world.scan_map_path, world.keepout_map_path):
        assert path.is_file()


def test_a_world_is_loaded_by_its_folder_too(copy):
    assert load_world(copy).name == "home"


def test_an_unknown_world_is_told_the_near_one():
    with pytest.raises(InputError, match=r"unknown world 'flatt'\. Did you mean 'flat'\? Known worlds: flat"):
        load_world("flatt")


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("objects", "clear_m: 0.12", "cleer_m: 0.12", "LINE: unknown key 'cleer_m'; did you mean 'clear_m'"),
        ("knowledge", "height: 0.75", "height: high", r"LINE: surfaces\.kitchen table\.height"),
        ("knowledge", "[counter, worktop]\n", "[counter, worktop\n", r"\d+: broken YAML"),
        ("objects", "[kitchen counter", "[kitchen countr", ".*no surface 'kitchen countr'.*mean 'kitchen counter'"),
        ("objects", "[kitchen counter, kitchen table]", "[desk]", ".*'desk' may carry .* no entry under `fronts`"),
    ],
)  # fmt: skip
def test_a_wrong_line_is_named(copy, file, old, new, says):
    path = copy / f"{file}.yaml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    line = text[: text.index(old)].count("\n") + 1
    with pytest.raises(InputError, match=rf"{file}\.yaml:{says}".replace("LINE", str(line))):
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


def test_a_missing_file_is_named(copy):
    (copy / "knowledge.yaml").unlink()
    with pytest.raises(InputError, match=r"knowledge\.yaml: there is no such file"):
        load_world(copy)


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
    assert kim.route is not None
    assert [(stop.at_W, stop.pause_s) for stop in kim.route.stops] == [
        ((8.4, 6.9), 0.0), ((8.0, 4.0), 2.0), ((5.75, 1.75), 0.0)
    ]  # fmt: skip
    assert (kim.route.speed_m_s, kim.route.loops, kim.route.start_s, kim.route.yields) == (0.9, True, 5.0, False)
    assert tuple(kim.X_WO.translation()[:2]) == (8.4, 6.9)


@pytest.mark.parametrize(
    ("people", "says"),
    [
        ("people: [{name: Kim}]", "give 'route', or 'distance_m', 'bearing_rad' and 'turned_rad'"),
        ("people: [{name: Kim, route: {waypoints: []}}]", "a route needs 'waypoints'"),
        ("people: [{name: Kim, route: {wanders: true}}]", "Kim stands nowhere at first"),
        ("people: [{name: Kim, route: {waypoints: [kitchen], follows: robot, loop: true}}]", "nor walks a loop"),
        ("people: [{name: Kim, route: {waypoints: [kitchn]}}]", "Kim cannot walk to 'kitchn'.*did you mean 'kitchen'"),
        ("people: [{name: Kim, route: {waypoints: [kitchen], speed: 9}}]", "route.speed"),
        ("people: [{name: coke, route: {waypoints: [kitchen]}}]", "'coke' names two objects or people"),
    ],
)
def test_a_wrong_person_is_refused(copy, people, says):
    with pytest.raises(InputError, match=says):
        load_world(with_people(copy, people))


def test_routes_are_added_and_take_the_place_of_who_stands():
    world = load_world("flat")
    walking = world.with_routes(
        {"Robin": Route(waypoints=("kitchen", "office")), "Kim": Route(waypoints=((4.0, 4.5),))}
    )
    assert [(each.name, each.route is not None) for each in place_people(walking, 1)] == [
        ("Robin", True), ("Kim", True)
    ]  # fmt: skip
    assert [each.name for each in place_people(world, 1)] == ["Robin"]
    with pytest.raises(InputError, match="'hammer' names two"):
        world.with_routes({"hammer": Route(waypoints=("kitchen",))})


def test_a_lidar_near_the_floor_has_a_map_of_its_own():
    """Bands: scan 0.7 to 1.3 m, low_scan 0.27 to 0.31 m."""
    flat = load_world("flat")
    names = [flat.scan_map_seen_from(height_m).name for height_m in (0.92, 0.288, 0.35, 2.0, None)]
    assert names == ["scan.yaml", "low_scan.yaml", "low_scan.yaml", "scan.yaml", "scan.yaml"]
