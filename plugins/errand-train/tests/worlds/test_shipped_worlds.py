"""The shipped worlds are those that their plans make."""

import numpy as np
import pytest

from errand_train.worlds.__main__ import build
from errand_train.worlds.plan import PLANS, load_plan
from executive import load_world
from plant.worlds.world import known_worlds
from tests.plant.worlds.plain_map import FREE, Map


def test_every_plan_is_a_world_that_comes_with_the_project():
    assert {*PLANS} <= {*known_worlds()}


CLOSED = [(name, door) for name in PLANS for door in load_plan(name).doors if not door.open]


@pytest.mark.parametrize(("name", "door"), CLOSED, ids=[f"{name}-{door.name}" for name, door in CLOSED])
def test_every_door_is_as_wide_as_planned_and_free_on_both_sides(name, door):
    keepout, width = Map(load_world(name).surveyed.keepout_map_path), load_plan(name).width_m(door)
    across = np.array([0.0, 1.0]) if door.along_x else np.array([1.0, 0.0])
    along, middle = across[::-1], np.array([door.x, door.y])
    line = middle + np.arange(-width / 2 - 0.1, width / 2 + 0.1, 0.005)[:, None] * along
    assert np.sum(keepout.at(line) == FREE) * 0.005 == pytest.approx(width, abs=0.03)
    reach, half = 0.65 if name == "lab" else 1.05, width / 2 - 0.02  # the lab's corridors are narrow
    lines = middle + np.arange(-half, half, 0.01)[:, None] * along
    assert np.all(keepout.at(lines + np.arange(-reach, reach, 0.01)[:, None, None] * across) == FREE)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.nightly] * (name != "flat")) for name in PLANS])
def test_committed_world_is_what_the_builder_writes(name, tmp_path, monkeypatch):
    monkeypatch.setattr("errand_train.worlds.__main__.save_png", lambda *_: None)  # its bytes are the library's
    world = load_world(name)
    build(load_plan(world.name), tmp_path, f"errand/worlds/{world.name}")
    written = [p for p in tmp_path.rglob("*") if p.suffix in (".sdf", ".obj", ".mtl", ".yaml", ".pgm")]
    assert len(written) > 3 * len(load_plan(world.name).furniture)
    for path in written:
        assert (world.folder / path.relative_to(tmp_path)).read_bytes() == path.read_bytes(), path.name


def test_a_way_of_more_than_a_hundred_metres_leads_around_the_rooms_of_the_lab():
    plan = load_plan("lab")
    corridors = {room.name: room.inside for room in plan.rooms if room.name.endswith(("corridor", "passage"))}
    assert all(0.8 <= min(x1 - x0, y1 - y0) <= 1.2 + 1e-9 for x0, y0, x1, y1 in corridors.values())
    middles = {name: ((x0 + x1) / 2, (y0 + y1) / 2) for name, (x0, y0, x1, y1) in corridors.items()}
    along_x = middles["east corridor"][0] - middles["west corridor"][0]
    along_y = middles["north corridor"][1] - middles["south corridor"][1]
    assert 2 * (along_x + along_y) > 100
    assert all(0.75 <= plan.width_m(door) <= 0.9 for door in plan.doors if not door.open)
