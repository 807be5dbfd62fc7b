"""Worlds made of grids and cylinders: walls, rooms, doors, start."""

import numpy as np
import pytest
import yaml

from errand_make.worlds.own import rectangles, world_from_cylinders, world_from_grid
from errand_make.worlds.rooms import FREE, OCCUPIED, UNKNOWN, Grid
from executive import load_world
from executive.app.runs.simulated import simulate
from plant.worlds.world import WorldError
from skills.robot import Pose2D


def two_rooms(resolution_m=0.05):
    """Two rooms of 3 x 4 m, x from 1 to 7.1, with a door of 0.9 m in the wall between them, 0.1 m thick."""
    scale = round(0.05 / resolution_m)
    cells = np.full((84, 126), OCCUPIED, np.uint8)
    cells[2:82, 2:62] = cells[2:82, 64:124] = cells[30:48, 62:64] = FREE
    return Grid(cells.repeat(scale, axis=0).repeat(scale, axis=1), (1.0, -2.0), resolution_m)


def test_rectangles_cover_exactly_the_occupied_cells():
    occupied = np.random.default_rng(3).random((40, 50)) < 0.4
    covered = np.zeros(occupied.shape, int)
    for r0, c0, r1, c1 in rectangles(occupied):
        covered[r0:r1, c0:c1] += 1
    assert np.array_equal(covered, occupied.astype(int))


def test_a_few_boxes_make_the_walls_of_two_rooms():
    assert len(rectangles(two_rooms().cells == OCCUPIED)) <= 8


@pytest.mark.parametrize("resolution_m", [0.05, 0.01])
def test_rooms_and_the_door_between_them_are_found(tmp_path, resolution_m):
    world_from_grid(tmp_path, two_rooms(resolution_m), start=None, wall_height_m=2.5)
    known = yaml.safe_load((tmp_path / "knowledge.yaml").read_text())
    (door,), rooms = known["doors"], {"room 1", "room 2"}
    assert (set(known["places"]), set(door["between"])) == (rooms, rooms)
    assert (door["at"], door["width"]) == (pytest.approx([4.15, -0.05], abs=0.1), pytest.approx(0.9, abs=0.06))


def test_the_walls_stand_where_the_map_has_them(tmp_path):
    world_from_grid(tmp_path, two_rooms(), start=Pose2D(2.0, 0.0, 0.0), wall_height_m=2.5)
    world = load_world(str(tmp_path))
    assert world.start == Pose2D(2.0, 0.0, 0.0)
    simulation = simulate(world, {}, seed=1, record=True)
    simulation.clock.advance(0.1)
    query = simulation.query_at(0.1)

    def near_m(*p_W):
        return min(each.distance for each in query.ComputeSignedDistanceToPoint(p_W))

    assert max(near_m(1.05, 0.0, 1.0), near_m(4.15, 1.0, 2.4), near_m(3.0, 2.15, 0.1)) < 0.0
    assert min(near_m(2.0, 0.0, 1.0), near_m(4.15, -0.05, 0.5), near_m(3.0, 2.15, 2.6)) > 0.05


def test_coarse_maps_are_cut_into_small_cells(tmp_path):
    cells = np.full((12, 12), OCCUPIED, np.uint8)
    cells[1:-1, 1:-1] = FREE
    world_from_grid(tmp_path, Grid(cells, (0.0, 0.0), 0.4), start=None, wall_height_m=2.5)
    assert (tmp_path / "map" / "scan.pgm").read_bytes().startswith(b"P5\n96 96\n")
    assert "resolution: 0.05" in (tmp_path / "map" / "scan.yaml").read_text()


@pytest.mark.parametrize(
    ("value", "why"), [(OCCUPIED, "no cell of it is free"), (UNKNOWN, "no cell"), (FREE, "wide enough")]
)
def test_a_map_without_room_for_the_robot_is_refused(tmp_path, value, why):
    grid = Grid(np.full((8, 8), value, np.uint8), (0.0, 0.0), 0.05)
    with pytest.raises(WorldError, match=why):
        world_from_grid(tmp_path, grid, start=None, wall_height_m=2.5)


@pytest.mark.parametrize("start", [Pose2D(4.15, 1.0, 0.0), Pose2D(50.0, 0.0, 0.0), Pose2D(4.15, -0.05, 1.57)])
def test_a_start_that_is_not_free_is_refused_with_a_free_one(tmp_path, start):
    with pytest.raises(WorldError, match=r"touches a wall or lies outside; a free one is --start"):
        world_from_grid(tmp_path, two_rooms(), start=start, wall_height_m=2.5)


def test_cylinders_stand_in_both_grids_as_far_as_they_reach(tmp_path):
    cylinders = [(0.0, 0.0, 0.4, 1.0), (6.0, 0.0, 0.4, 0.5)]
    world_from_cylinders(tmp_path, cylinders, start=Pose2D(3.0, 0.0, 0.0), around=[(3.0, 9.0)])
    areas = {}
    for name in ("scan", "keepout"):
        data = (tmp_path / "map" / f"{name}.pgm").read_bytes()
        areas[name] = np.count_nonzero(np.frombuffer(data.split(b"255\n", 1)[1], np.uint8) == OCCUPIED) * 0.025**2
    assert areas["keepout"] == pytest.approx(2 * np.pi * 0.16, rel=0.03)
    assert areas["scan"] == pytest.approx(np.pi * 0.16, rel=0.03)
    rows = int(data.split()[2])
    assert rows * 0.025 == pytest.approx(0.9 + 11.0, abs=0.05)  # to 2 m beyond the point
    assert (tmp_path / "walls.sdf").read_text().count("<cylinder>") == 2
