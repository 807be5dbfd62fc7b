"""The particle filter on rooms of boxes, with beams computed in the plane."""

import math

import numpy as np
import pytest

from skills.estimate.particle_filter import FilterOptions, ParticleFilter
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from skills.testing.blocks import Block, block_array, cast_rays, grid_of

WALLS = (Block(0.0, -0.1, 6.0, 0.0), Block(0.0, 4.0, 6.0, 4.1), Block(-0.1, -0.1, 0.0, 4.1), Block(6.0, -0.1, 6.1, 4.1))
ROOM = (*WALLS, Block(0.0, 2.5, 1.0, 4.0))
HERE = Pose2D(2.0, 1.5, 0.3)
TIGHT = np.diag([0.05**2, 0.05**2, 0.03**2])


def beams_at(pose, blocks, count=60):
    """The ends of beams all around, in the body frame."""
    angles = np.linspace(-math.pi, math.pi, count, endpoint=False)
    turned = angles + pose.yaw_rad
    rays = np.column_stack([np.cos(turned), np.sin(turned), np.zeros(count)])
    ranges = cast_rays(np.array([pose.x_m, pose.y_m, 1.0]), rays, block_array(blocks), 50.0)[0]
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)])


def filter_on(blocks=ROOM, *, placed=True, **options):
    """Particles around the pose, or not yet placed."""
    particles = ParticleFilter(grid_of(blocks, (0.7, 1.3)), FilterOptions(**options))
    if placed:
        particles.place(HERE, TIGHT)
    return particles


def followed(particles, pose, blocks=ROOM, updates=6):
    """Some updates while the robot turns on the spot; the pose after them."""
    for _ in range(updates):
        pose = Pose2D(pose.x_m, pose.y_m, pose.yaw_rad + 0.2)
        particles.move(Pose2D(0.0, 0.0, 0.2))
        particles.weigh(beams_at(pose, blocks))
        particles.resample()
    return pose


def test_scattered_particles_gather_where_the_robot_is_and_become_fewer():
    particles = filter_on(placed=False, max_particles=8000)
    particles.scatter()
    assert len(particles.poses) == 8000
    pose = followed(particles, HERE)
    mode = particles.mode()
    assert mode.mass > 0.95
    assert math.hypot(mode.mean.x_m - pose.x_m, mode.mean.y_m - pose.y_m) < 0.1
    assert abs(math.remainder(mode.mean.yaw_rad - pose.yaw_rad, math.tau)) < 0.1
    assert FilterOptions().min_particles <= len(particles.poses) < 2000


def test_in_an_empty_room_the_weight_stays_in_both_places_that_look_alike():
    particles, opposite = filter_on(WALLS), Pose2D(6.0 - HERE.x_m, 4.0 - HERE.y_m, HERE.yaw_rad + math.pi)
    particles.resample(particles.sample_around(opposite, TIGHT, 400))
    pose = followed(particles, HERE, WALLS, updates=20)
    opposite = Pose2D(opposite.x_m, opposite.y_m, pose.yaw_rad + math.pi)
    masses = particles.mass_near(pose), particles.mass_near(opposite)
    assert min(masses) > 0.2
    assert sum(masses) > 0.95


def test_the_number_follows_the_spread():
    particles = filter_on(max_particles=5000)
    particles.resample()
    few = len(particles.poses)
    particles.place(HERE, np.diag([1.0, 1.0, 1.0]))
    particles.resample()
    assert few == FilterOptions().min_particles
    assert few < len(particles.poses) <= 5000


def test_a_beam_that_no_particle_explains_is_skipped():
    beams = beams_at(HERE, (*ROOM, Block(2.6, 1.2, 3.0, 1.6)))
    off = {}
    for share in (0.0, 0.3):
        particles = filter_on(skip_share=share, skip_m=0.3, random_share=0.001)
        particles.weigh(beams)
        off[share] = particles.weights.max() / particles.weights.min()
    assert off[0.3] != pytest.approx(off[0.0])
    used = filter_on(skip_share=0.3, skip_m=0.3)._explained(beams)
    blocked = np.hypot(*(beams - beams_at(HERE, ROOM)).T) > 0.6
    assert blocked.any() and not used[blocked].any()
    assert used[~blocked].mean() > 0.8


def test_no_beam_is_skipped_where_most_of_them_are_unexplained():
    assert filter_on()._explained(beams_at(HERE, ROOM) * 3.0).all()


def test_scans_of_another_place_surprise_and_those_of_this_one_do_not():
    particles = filter_on()
    for _ in range(10):
        particles.weigh(beams_at(HERE, ROOM))
    assert particles.surprise < 0.05
    for _ in range(3):
        particles.weigh(beams_at(Pose2D(4.5, 3.0, 2.0), ROOM))
    assert particles.surprise > 0.3


def test_injected_particles_take_over_when_they_fit():
    particles, there = filter_on(), Pose2D(4.5, 3.0, 2.0)
    for _ in range(3):
        particles.weigh(beams_at(there, ROOM))
        particles.resample(particles.sample_around(there, TIGHT, 20))
    particles.weigh(beams_at(there, ROOM))
    assert particles.mass_near(there) > 0.9


def test_the_likeliest_of_random_poses_are_of_different_places():
    poses = filter_on().likeliest_poses(20_000, 5, beams_at(HERE, ROOM))
    assert poses.shape == (5, 3)
    assert np.hypot(poses[:, 0] - HERE.x_m, poses[:, 1] - HERE.y_m).min() < 0.3
    assert (np.abs(poses[:, None] - poses[None])[np.triu_indices(5, 1)] > 1e-3).any(axis=1).all()


def test_random_poses_stand_on_free_known_ground():
    grid = grid_of(ROOM, (0.7, 1.3))
    unknown = np.zeros_like(grid.occupied)
    unknown[:, : grid.occupied.shape[1] // 2] = True
    half = GridMap(grid.occupied, grid.resolution_m, grid.origin_m, unknown)
    cells = half.cells(ParticleFilter(half, FilterOptions()).sample_anywhere(500))
    assert not unknown[cells[:, 0], cells[:, 1]].any()
    assert not grid.occupied[cells[:, 0], cells[:, 1]].any()


def test_a_map_without_free_ground_is_refused():
    with pytest.raises(InputError, match="no free ground"):
        ParticleFilter(GridMap(np.ones((20, 20), dtype=np.bool_), 0.05, (0.0, 0.0)), FilterOptions())


def test_equal_seeds_give_equal_particles_and_others_do_not():
    ends = []
    for seed in (3, 3, 4):
        particles = filter_on(seed=seed, max_particles=2000)
        particles.scatter()
        followed(particles, HERE, updates=3)
        ends.append(particles.poses)
    assert np.array_equal(ends[0], ends[1])
    assert ends[0].shape != ends[2].shape or not np.array_equal(ends[0], ends[2])
