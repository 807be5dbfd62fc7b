"""Loading a world, and what a wrong one is told."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from plant.worlds.placement import place_objects, place_people
from plant.worlds.world import WORLDS_FOLDER, World, WorldError, known_worlds, load_world
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
    with pytest.raises(WorldError, match=r"unknown world 'flatt'\. Did you mean 'flat'\? Known worlds: flat"):
        load_world("flatt")


def test_an_unknown_key_is_told_with_its_line(copy: Path) -> None:
    line = replace(copy / "objects.yaml", "clear_m: 0.12", "cleer_m: 0.12")
    with pytest.raises(WorldError, match=rf"objects\.yaml:{line}: rules\.cleer_m: unknown key; did you mean 'clear_m'"):
        load_world(copy)


def test_broken_yaml_is_told_with_its_line(copy: Path) -> None:
    line = replace(copy / "knowledge.yaml", "aliases: [counter, worktop]", "aliases: [counter, worktop")
    with pytest.raises(WorldError, match=r"knowledge\.yaml:(\d+): broken YAML") as caught:
        load_world(copy)
    assert f"knowledge.yaml:{line + 1}:" in str(caught.value)


def test_a_wrong_value_is_told_with_its_line(copy: Path) -> None:
    line = replace(copy / "knowledge.yaml", "height: 0.75", "height: high")
    with pytest.raises(WorldError, match=rf"knowledge\.yaml:{line}: surfaces\.kitchen table\.height"):
        load_world(copy)


def test_a_pipe_is_refused_at_once(copy: Path) -> None:
    (copy / "objects.yaml").unlink()
    os.mkfifo(copy / "objects.yaml")
    with pytest.raises(WorldError, match=r"objects\.yaml: .*no plain file"):
        load_world(copy)


@pytest.mark.parametrize(
    "text", [b"\xff", b"a: !!python/object:x.y {}", b"x: 0x" + b"f" * 10_000, b"[" * 3000, b"x: " + b"9" * 5000]
)
def test_what_is_no_yaml_is_told_with_its_file(copy: Path, text: bytes) -> None:
    (copy / "objects.yaml").write_bytes(text)
    with pytest.raises(WorldError, match=r"objects\.yaml:[12]: ") as error:
        load_world(copy)
    assert len(str(error.value)) < 500


def test_a_missing_file_is_named(copy: Path) -> None:
    (copy / "knowledge.yaml").unlink()
    with pytest.raises(WorldError, match=r"knowledge\.yaml: cannot be read"):
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
    with pytest.raises(WorldError, match=r"no surface 'kitchen countr'.*did you mean 'kitchen counter'"):
        load_world(copy)


def test_a_surface_without_a_front_is_refused(copy: Path) -> None:
    replace(copy / "objects.yaml", "surfaces: [kitchen counter, kitchen table]", "surfaces: [desk]")
    with pytest.raises(WorldError, match="'desk' may carry things but has no entry under `fronts`"):
        load_world(copy)
