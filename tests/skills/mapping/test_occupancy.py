import math

import numpy as np

from skills.mapping.keyframe import Keyframe
from skills.mapping.occupancy import LayeredOccupancy
from skills.robot import Pose2D

ELEVATIONS = np.radians(np.arange(-15.0, 16.0, 2.0))
AZIMUTHS = np.radians(np.arange(-180.0, 180.0, 1.0))
HEIGHT_M = 0.9


def frame(ranges_m: np.ndarray) -> Keyframe:
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


def round_wall(radius_m: float = 3.0) -> np.ndarray:
    """Ranges to an upright wall all around; the floor ends what falls below it."""
    wall = np.full((len(ELEVATIONS), len(AZIMUTHS)), radius_m) / np.cos(ELEVATIONS)[:, None]
    floor = np.where(ELEVATIONS < 0.0, HEIGHT_M / np.maximum(-np.sin(ELEVATIONS), 1e-9), np.inf)
    return np.minimum(wall, floor[:, None])


def most(grid: LayeredOccupancy, band: str, x: float, y: float) -> float:
    """The highest probability within 10 cm."""
    steps = (-0.1, -0.05, 0.0, 0.05, 0.1)
    return max(at(grid, band, x + dx, y + dy)[0] for dx in steps for dy in steps)


def at(grid: LayeredOccupancy, band: str, x: float, y: float) -> tuple[float, bool]:
    probability, observed = grid.probability(band)
    column, row = (math.floor((v - o) / grid.resolution_m) for v, o in zip((x, y), grid.origin_m, strict=True))
    return float(probability[row, column]), bool(observed[row, column])


def test_beams_free_their_way_and_occupy_their_end():
    grid = LayeredOccupancy(0.05)
    for _ in range(3):
        grid.insert(frame(round_wall()), Pose2D(1.0, 2.0, 0.5))
    for band in ("scan", "keepout"):
        assert at(grid, band, 2.5, 2.0)[0] < 0.4
        assert most(grid, band, 1.0, 5.025) > 0.8
        assert not at(grid, band, 1.0, 6.0)[1]


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
    assert at(grid, "keepout", 2.025, 0.0)[0] > 0.6
    assert at(grid, "scan", 2.025, 0.0)[0] < 0.1


def test_no_return_tells_nothing():
    grid = LayeredOccupancy(0.05)
    grid.insert(frame(np.full((len(ELEVATIONS), len(AZIMUTHS)), np.nan)), Pose2D(0.0, 0.0, 0.0))
    assert not grid.probability("scan")[1].any()


def test_the_grid_grows_and_keeps_what_it_has():
    grid = LayeredOccupancy(0.05)
    grid.insert(frame(round_wall()), Pose2D(0.0, 0.0, 0.0))
    before = at(grid, "scan", 3.025, 0.0)
    assert before[0] > 0.6
    grid.insert(frame(round_wall()), Pose2D(-30.0, 25.0, 0.0))
    assert at(grid, "scan", 3.025, 0.0) == before
    assert most(grid, "scan", -30.0, 28.025) > 0.6
