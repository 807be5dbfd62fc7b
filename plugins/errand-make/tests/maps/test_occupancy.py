import math

import numpy as np
import pytest

from errand_make.maps.occupancy import Ground, LayeredOccupancy
from errand_make.maps.pose_graph import Keyframe
from skills.grid_map import GridMap
from skills.robot import Pose2D

ELEVATIONS = np.radians(np.arange(-15.0, 16.0, 2.0))
AZIMUTHS = np.radians(np.arange(-180.0, 180.0, 1.0))
HEIGHT_M = 0.9
CELL_M = 0.05


def frame(ranges_m):
    return Keyframe(
        stamp_s=0.0,
        X_OF=Pose2D(0.0, 0.0, 0.0),
        ranges_m=ranges_m.astype(np.float32),
        elevations_rad=ELEVATIONS,
        azimuths_rad=AZIMUTHS,
        rotation=np.eye(3),
        translation=np.array([0.0, 0.0, HEIGHT_M]),
        points_F=np.empty((0, 3)),
    )


def round_wall(radius_m=3.0):
    """Ranges to an upright wall all around; the floor ends what falls below it."""
    wall = np.full((len(ELEVATIONS), len(AZIMUTHS)), radius_m) / np.cos(ELEVATIONS)[:, None]
    floor = np.where(ELEVATIONS < 0.0, HEIGHT_M / np.maximum(-np.sin(ELEVATIONS), 1e-9), np.inf)
    return np.minimum(wall, floor[:, None])


def most(seen, x, y):
    """The highest probability within 10 cm."""
    steps = (-0.1, -0.05, 0.0, 0.05, 0.1)
    return max(at(seen, x + dx, y + dy)[0] for dx in steps for dy in steps)


def at(seen, x, y):
    (probability, observed), origin_m, cell_m = seen
    column, row = (math.floor((v - o) / cell_m) for v, o in zip((x, y), origin_m, strict=True))
    return float(probability[row, column]), bool(observed[row, column])


def seen_in(grid, band):
    return grid.probability(band), grid.origin_m, grid.resolution_m


def test_beams_free_the_cells_they_pass_and_occupy_their_end():
    grid = LayeredOccupancy(0.05)
    for _ in range(3):
        grid.insert(frame(round_wall()), Pose2D(1.0, 2.0, 0.5))
    for band in ("scan", "keepout"):
        seen = seen_in(grid, band)
        assert at(seen, 2.5, 2.0)[0] < 0.4
        assert most(seen, 1.0, 5.025) > 0.8
        assert not at(seen, 1.0, 6.0)[1]


def test_a_beam_over_a_low_box_leaves_it_occupied():
    over = round_wall()
    grid = LayeredOccupancy(0.05)
    hit = over.copy()
    low = np.flatnonzero(math.radians(-12.0) > ELEVATIONS)
    hit[low] = 2.0 / np.cos(ELEVATIONS[low])[:, None]
    grid.insert(frame(hit), Pose2D(0.0, 0.0, 0.0))
    above = np.delete(np.arange(len(ELEVATIONS)), low)
    passing = np.full_like(over, np.nan)
    passing[above] = over[above]
    for _ in range(20):
        grid.insert(frame(passing), Pose2D(0.0, 0.0, 0.0))
    assert most(seen_in(grid, "keepout"), 2.025, 0.0) > 0.6
    assert at(seen_in(grid, "scan"), 2.025, 0.0)[0] < 0.1


def under_table(away_m, *, top_m=0.85, thick_m=0.03):
    """Ranges past a table 0.8 m deep, so far away all around, to the wall and floor behind it; it has no legs."""
    ranges = round_wall(6.0)
    for ring, elevation in enumerate(ELEVATIONS):
        slope = math.tan(elevation)
        if top_m - thick_m < HEIGHT_M + away_m * slope < top_m:
            ranges[ring] = away_m / math.cos(elevation)
        elif slope < 0.0 and away_m < (top_m - HEIGHT_M) / slope < away_m + 0.8:
            ranges[ring] = (top_m - HEIGHT_M) / math.sin(elevation)
    return ranges


@pytest.mark.parametrize(("layer_m", "found"), [(0.05, False), (0.025, True)])
def test_a_thin_table_top_is_found_in_layers_no_higher_than_it_is_thick(layer_m, found):
    grid = LayeredOccupancy(0.025, layer_m=layer_m)
    for away_m in np.arange(2.2, 5.0, 0.05):
        grid.insert(frame(under_table(away_m)), Pose2D(5.0 - away_m, 0.0, 0.0))
    seen = seen_in(grid, "keepout")
    middle = [at(seen, x, 0.0)[0] for x in np.arange(5.15, 5.65, 0.025)]
    assert (max(middle) > 0.65) == found


def test_the_noise_of_ranges_does_not_thicken_a_wall():
    grid, noise = LayeredOccupancy(0.025), np.random.default_rng(1)
    for turn in range(60):
        ranges = round_wall() + noise.normal(0.0, 0.03, (len(ELEVATIONS), len(AZIMUTHS)))
        grid.insert(frame(ranges), Pose2D(0.0, 0.0, 0.003 * turn))
    raw = (grid.values >= 4).any(axis=0)
    assert before_the_wall(grid, grid.probability("keepout")[0] > 0.65) < 0.5 * before_the_wall(grid, raw)


def before_the_wall(grid, cells):
    """Number of cells more than 3 cm before the round wall."""
    rows, columns = np.nonzero(cells)
    away = np.hypot((columns + 0.5) * 0.025 + grid.origin_m[0], (rows + 0.5) * 0.025 + grid.origin_m[1])
    return int(np.sum(away < 2.97))


def test_a_beam_without_return_changes_nothing():
    grid = LayeredOccupancy(0.05)
    grid.insert(frame(np.full((len(ELEVATIONS), len(AZIMUTHS)), np.nan)), Pose2D(0.0, 0.0, 0.0))
    assert not grid.probability("scan")[1].any()


def test_the_grid_grows_and_keeps_what_it_has():
    grid = LayeredOccupancy(0.05)
    grid.insert(frame(round_wall()), Pose2D(0.0, 0.0, 0.0))
    before = at(seen_in(grid, "scan"), 3.025, 0.0)
    assert before[0] > 0.6
    grid.insert(frame(round_wall()), Pose2D(-30.0, 25.0, 0.0))
    seen = seen_in(grid, "scan")
    assert at(seen, 3.025, 0.0) == before
    assert most(seen, -30.0, 28.025) > 0.6


def ground(width_m=1.0):
    """A room of 4 x 4 m, walled, with an opening to the unknown at the right; the robot in its middle."""
    occupied, unknown = np.zeros((100, 140), dtype=np.bool_), np.ones((100, 140), dtype=np.bool_)
    unknown[10:90, 10:90] = False
    occupied[8:10, 8:92] = occupied[90:92, 8:92] = occupied[8:92, 8:10] = occupied[8:92, 90:92] = True
    half = round(width_m / CELL_M / 2)
    occupied[50 - half : 50 + half, 90:92] = False
    unknown[50 - half : 50 + half, 88:100] = False
    unknown[occupied] = False
    return Ground(GridMap(occupied, CELL_M, (0.0, 0.0), unknown), ~unknown, (2.5, 2.5), clear_m=0.3)


def test_the_opening_is_the_only_frontier():
    (frontier,) = ground().frontiers(least_m=0.5, within_m=1.5)
    assert math.isclose(frontier.at[0], 4.975, abs_tol=0.1) and abs(frontier.at[1] - 2.5) < 0.6
    assert math.dist(frontier.stand, frontier.at) < 0.6
    assert 2.0 < frontier.cost_m < 6.0


def test_an_opening_shorter_than_the_least_length_is_no_frontier():
    assert ground(width_m=0.3).frontiers(least_m=1.0, within_m=1.5) == []


def test_stands_come_nearest_first_and_apart():
    stands = ground().stands_near(4.0, 4.0, most=5, apart_m=0.25)
    away = [math.dist(stand, (4.0, 4.0)) for stand in stands]
    assert away == sorted(away) and away[0] < 0.2
    assert min(math.dist(a, b) for n, a in enumerate(stands) for b in stands[:n]) >= 0.25


def test_cost_is_in_metres_and_infinite_through_walls():
    whole = ground()
    assert math.isclose(whole.cost_to(2.5, 1.5), 1.0, abs_tol=0.11)
    assert math.isinf(whole.cost_to(6.0, 4.5))
