"""A world is loaded, and a wrong file is refused with its place."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from executive.words.mission import Route
from plant.worlds.seeding import place_objects, place_people
from plant.worlds.world import WORLDS_FOLDER, World, known_worlds, load_world
from skills.files.errors import InputError
from skills.robot import Pose2D


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the flat's small files."""
    folder = tmp_path / "home"
    folder.mkdir()
    for name in ("world.dmd.yaml", "knowledge.yaml", "objects.yaml"):
        shutil.copy(WORLDS_FOLDER / "flat" / name, folder / name)
    return folder


def replace(path: Path, old: str, new: str) -> int:
    """Replace the first `old` in a file; the number of its line."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return text[: text.index(old)].count("\n") + 1


def test_flat_is_known_and_has_its_rooms() -> None:
    world = load_world("flat")
    assert "flat" in known_worlds()
    assert {"hall", "kitchen", "living room", "bedroom", "bathroom", "workshop"} <= set(world.rooms)


def test_its_files_exist() -> None:
    world: World = load_world("flat")
    for path in (world.directives_path, world.knowledge_path, world.scan_map_path, world.keepout_map_path):
        assert path.is_file()


def test_a_world_is_loaded_by_its_folder_too(copy: Path) -> None:
    assert load_world(copy).name == "home"


def test_an_unknown_world_is_told_the_near_one() -> None:
    with pytest.raises(InputError, match=r"unknown world 'flatt'\. Did you mean 'flat'\? Known worlds: flat"):
        load_world("flatt")


def test_an_unknown_key_is_told_with_its_line(copy: Path) -> None:
    line = replace(copy / "objects.yaml", "clear_m: 0.12", "cleer_m: 0.12")
    with pytest.raises(InputError, match=rf"objects\.yaml:{line}: unknown key 'cleer_m'; did you mean 'clear_m'"):
        load_world(copy)


def test_broken_yaml_is_told_with_its_line(copy: Path) -> None:
    line = replace(copy / "knowledge.yaml", "aliases: [counter, worktop]", "aliases: [counter, worktop")
    with pytest.raises(InputError, match=r"knowledge\.yaml:(\d+): broken YAML") as caught:
        load_world(copy)
    assert f"knowledge.yaml:{line + 1}:" in str(caught.value)


def test_a_wrong_value_is_told_with_its_line(copy: Path) -> None:
    line = replace(copy / "knowledge.yaml", "height: 0.75", "height: high")
    with pytest.raises(InputError, match=rf"knowledge\.yaml:{line}: surfaces\.kitchen table\.height"):
        load_world(copy)


def test_a_pipe_is_refused_at_once(copy: Path) -> None:
    (copy / "objects.yaml").unlink()
    os.mkfifo(copy / "objects.yaml")
    with pytest.raises(InputError, match=r"objects\.yaml:1: it is a pipe"):
        load_world(copy)


@pytest.mark.parametrize(
    "text", [b"\xff", b"a: !!python/object:x.y {}", b"x: 0x" + b"f" * 10_000, b"[" * 3000, b"x: " + b"9" * 5000]
)
def test_an_invalid_yaml_file_is_named(copy: Path, text: bytes) -> None:
    (copy / "objects.yaml").write_bytes(text)
    with pytest.raises(InputError, match=r"objects\.yaml:[12]: ") as error:
        load_world(copy)
    assert len(str(error.value)) < 500


def test_a_missing_file_is_named(copy: Path) -> None:
    (copy / "knowledge.yaml").unlink()
    with pytest.raises(InputError, match=r"knowledge\.yaml: there is no such file"):
        load_world(copy)


def test_geometry_and_a_start_are_enough(copy: Path) -> None:
    (copy / "objects.yaml").unlink()
    (copy / "knowledge.yaml").write_text("start: {x: 1.0, y: 2.0, yaw: 0.5}")
    world = load_world(copy)
    assert world.start == Pose2D(1.0, 2.0, 0.5)
    assert (world.dock, world.rooms, world.surfaces, world.seed_rules.objects) == (None, {}, {}, ())
    assert place_objects(world, 1) == place_people(world, 1) == ()
    assert world.corners == ((-4.0, -3.0), (6.0, 7.0))


def test_a_surface_that_nobody_knows_is_refused(copy: Path) -> None:
    replace(copy / "objects.yaml", "surfaces: [kitchen counter", "surfaces: [kitchen countr")
    with pytest.raises(InputError, match=r"no surface 'kitchen countr'.*did you mean 'kitchen counter'"):
        load_world(copy)


def test_a_surface_without_a_front_is_refused(copy: Path) -> None:
    replace(copy / "objects.yaml", "surfaces: [kitchen counter, kitchen table]", "surfaces: [desk]")
    with pytest.raises(InputError, match="'desk' may carry objects but has no entry under `fronts`"):
        load_world(copy)


WALKER = """people:
  - name: Kim
    route: {waypoints: [kitchen, {at: [8.0, 4.0], pause: 2}, desk], speed: 0.9, loop: true, start: 5, yields: false}
"""


def with_people(copy: Path, people: str) -> Path:
    path = copy / "objects.yaml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.index("people:")] + people, encoding="utf-8")
    return copy


def test_a_person_walks_on_a_route_of_places_and_points(copy: Path) -> None:
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
def test_a_wrong_person_is_refused(copy: Path, people: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        load_world(with_people(copy, people))


def test_routes_are_added_and_take_the_place_of_who_stands() -> None:
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
