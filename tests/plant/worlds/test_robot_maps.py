"""The maps that the robot made of the worlds of our own agree with their surveyed ones, from files alone."""

import cv2
import numpy as np
import pytest

from executive.app.prepare.worlds import knowledge_of
from plant.robots.spot.kind import spot_capabilities
from plant.worlds.seeding import place_people
from plant.worlds.world import load_world
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import SAFE_MARGIN_M, Footprint, footprint_clearance_m
from skills.grid_map import load_grid_map

FLOORS_M = {"flat": 0.05, "shop": 0.10, "lab": 0.15}
BODY_M = 0.3
"""Half the body's width, and a little."""


@pytest.fixture(scope="module", params=FLOORS_M)
def world(request):
    return load_world(request.param)


def grids(world, band):
    """The robot's map and the truth."""
    path = f"{band}_map_path"
    return load_grid_map(getattr(world, path)), load_grid_map(getattr(world.surveyed, path))


def known_poses(world):
    knowledge = knowledge_of(world)
    assert knowledge.dock is not None
    poses = {"start": knowledge.start, "dock": knowledge.dock}
    poses |= {name: place.pose for name, place in knowledge.places.items()}
    for name, surface in knowledge.surfaces.items():
        poses |= {f"{name} {n}": pose for n, pose in enumerate(surface.viewpoints)}
    return {name: (pose.x, pose.y, pose.yaw) for name, pose in poses.items()}


@pytest.mark.parametrize("band", ["scan", "keepout"])
def test_walls_are_where_they_are(world, band):
    made, true = grids(world, band)
    walls = made.centres(np.argwhere(made.occupied))
    assert len(walls) > 5000 and np.mean(true.distance_m(walls) <= FLOORS_M[world.name]) > 0.97


def test_the_map_shows_all_that_the_body_could_touch(world):
    made, true = grids(world, "keepout")
    rows, columns = true.cells(made.centres(np.argwhere(made.occupied))).T
    inside = (rows >= 0) & (columns >= 0) & (rows < true.occupied.shape[0]) & (columns < true.occupied.shape[1])
    found = np.ones(true.occupied.shape, dtype=np.uint8)
    found[rows[inside], columns[inside]] = 0
    off_m = cv2.distanceTransform(found, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * true.resolution_m
    fits = (true.with_unknown_blocked().distance > BODY_M).astype(np.uint8)
    beside = cv2.dilate(fits, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (27, 27))) > 0
    surface = true.occupied & beside & (true.distance > -true.resolution_m)
    assert np.mean(off_m[surface] < 0.1) > 0.99


def test_the_body_has_room_at_every_known_pose(world):
    poses = known_poses(world)
    costmap = LayeredCostmap(load_grid_map(world.keepout_map_path))
    clear = footprint_clearance_m(costmap, Footprint.of(spot_capabilities()), np.array(list(poses.values())))
    tight = {name: round(float(clear), 3) for name, clear in zip(poses, clear, strict=True) if clear < SAFE_MARGIN_M}
    assert tight == {}


def test_the_body_gets_from_the_start_to_every_known_pose(world):
    made = load_grid_map(world.keepout_map_path).with_unknown_blocked()
    _, parts = cv2.connectedComponents((made.distance > BODY_M).astype(np.uint8))
    rows, columns = made.cells(np.array([pose[:2] for pose in known_poses(world).values()])).T
    assert set(parts[rows, columns]) == {parts[rows[0], columns[0]]} != {0}


def test_every_place_is_within_centimetres_of_where_it_is_told(world):
    """Shift the walls about each place to where they fit the truth best."""
    made, true = grids(world, "scan")
    faces = made.occupied & (cv2.dilate((made.distance > 0.0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)
    walls = made.centres(np.argwhere(faces))
    steps = np.arange(-0.15, 0.151, 0.025)
    shifts = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    off = {}
    for name, (x, y, _) in known_poses(world).items():
        about = walls[np.hypot(*(walls - [x, y]).T) < 4.0][::2]
        fits = [np.minimum(np.abs(true.distance_m(about + shift)), 0.15).mean() for shift in shifts]
        off[name] = float(np.hypot(*shifts[int(np.argmin(fits))]))
    assert max(off.values()) < FLOORS_M[world.name], off


def test_nobody_stands_on_the_map(world):
    made = load_grid_map(world.keepout_map_path)
    people = [one.X_WO.translation()[:2] for seed in range(5) for one in place_people(world, seed)]
    assert np.all(made.distance_m(np.array(people)) > 0.3)
