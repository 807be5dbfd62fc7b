"""The LiDAR measures the distances of the shapes around it."""

import timeit

import numpy as np
import pytest
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Ellipsoid, HalfSpace, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from plant.sensors.lidar import Lidar, LidarSpec

QUIET = LidarSpec(sigma_m=0.0, dropout=0.0)
FRICTION = CoulombFriction(0.8, 0.8)


class Scene:
    """A world with static shapes, a floating base with a shape of its own, and a moving ball."""

    def __init__(self, statics, spec=QUIET, ball_W=(0.0, 50.0, 0.0)):
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
        for i, (shape, X_WG) in enumerate(statics):
            self.plant.RegisterCollisionGeometry(self.plant.world_body(), X_WG, shape, f"s{i}", FRICTION)
        inertia = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
        robot, other = self.plant.AddModelInstance("alice"), self.plant.AddModelInstance("ball")
        self.body = self.plant.AddRigidBody("body", robot, inertia)
        self.plant.RegisterCollisionGeometry(self.body, RigidTransform([1, 0, 0]), Sphere(0.3), "own", FRICTION)
        self.ball = self.plant.AddRigidBody("ball", other, inertia)
        self.plant.RegisterCollisionGeometry(self.ball, RigidTransform([0, 0, 0.1]), Sphere(0.4), "ball", FRICTION)
        self.plant.Finalize()
        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyContextFromRoot(self.root)
        self.query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(self.root))
        self.move(self.ball, RigidTransform(ball_W))
        inspector, rng = scene_graph.model_inspector(), np.random.default_rng(1)
        self.lidar = Lidar(self.plant, inspector, self.body, RigidTransform(), rng, spec=spec)

    def move(self, body, X_WB):
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(self.context, body, X_WB)

    def scan(self, X_WB=None):
        self.move(self.body, X_WB or RigidTransform())
        return self.lidar.revolution(self.context, 1.5, RigidTransform())()


def room(half_x=4.0, half_y=3.0):
    walls = [((0.2, 20, 8), (half_x + 0.1, 0)), ((0.2, 20, 8), (-half_x - 0.1, 0))]
    walls += [((20, 0.2, 8), (0, half_y + 0.1)), ((20, 0.2, 8), (0, -half_y - 0.1))]
    return [(Box(*size), RigidTransform([x, y, 0])) for size, (x, y) in walls]


def test_room_gives_the_analytic_ranges():
    scan = Scene(room()).scan()
    c, s = np.abs(np.cos(scan.azimuths_rad)), np.abs(np.sin(scan.azimuths_rad))
    flat = np.minimum(4.0 / np.maximum(c, 1e-9), 3.0 / np.maximum(s, 1e-9))
    expected = flat[None, :] / np.cos(scan.elevations_rad)[:, None]
    np.testing.assert_allclose(scan.ranges_m, expected, rtol=1e-5)


def test_scan_has_the_form_of_a_vlp16():
    scan = Scene(room()).scan()
    assert (scan.ranges_m.shape, scan.ranges_m.dtype, scan.stamp_s) == ((16, 900), np.float32, 1.5)
    np.testing.assert_allclose(np.degrees(scan.elevations_rad[[0, -1]]), [-15, 15])


def test_every_primitive_is_hit_on_its_surface_at_any_pose():
    rng = np.random.default_rng(0)
    shapes = [Box(1, 0.6, 1.4), Cylinder(0.4, 1.5), Capsule(0.3, 0.8), Sphere(0.5), Ellipsoid(0.8, 0.3, 0.5)]
    shapes += [Box(0.3, 0.3, 2), Cylinder(0.2, 2.0), Ellipsoid(0.2, 0.9, 0.4)]
    statics = []
    for i, shape in enumerate(shapes):
        angle = 2 * np.pi * i / len(shapes)
        position = [4 * np.cos(angle), 4 * np.sin(angle), rng.uniform(-0.3, 0.3)]
        statics.append((shape, RigidTransform(RollPitchYaw(rng.uniform(-3, 3, 3)), position)))
    scene = Scene(statics)
    X_WB = RigidTransform(RollPitchYaw(0.1, -0.15, 0.7), [0.3, -0.2, 0.1])
    points_W = (X_WB @ scene.scan(X_WB).points_B().T).T
    assert len(points_W) > 1500
    hit = set()
    for point in points_W[::7]:
        best = min(scene.query.ComputeSignedDistanceToPoint(point, 0.05), key=lambda n: abs(n.distance))
        assert abs(best.distance) < 2e-4
        hit.add(best.id_G)
    assert len(hit) == len(shapes)


def test_no_ray_passes_through_a_shape_it_should_hit():
    scan = Scene([(Cylinder(0.5, 4.0), RigidTransform([3, 0, 0]))]).scan()
    off_rad = np.abs(scan.azimuths_rad) - np.arcsin(0.5 / 3)
    assert np.isfinite(scan.ranges_m[:, off_rad < -0.004]).all()
    assert not np.isfinite(scan.ranges_m[:, off_rad > 0.004]).any()


def test_azimuth_span_across_the_back_is_whole():
    scan = Scene([(Box(0.2, 1.0, 4.0), RigidTransform([-3, 0, 0]))]).scan()
    assert np.isfinite(scan.ranges_m[:, [0, -1]]).all()


def test_floor_half_space_is_seen_by_the_lower_rings_only():
    scan = Scene([(HalfSpace(), RigidTransform())]).scan(RigidTransform([0, 0, 0.9]))
    np.testing.assert_allclose(scan.ranges_m[0], 0.9 / np.sin(np.radians(15)), rtol=1e-4)
    assert not np.isfinite(scan.ranges_m[8:]).any()


def test_convex_mesh_is_seen_by_its_bounding_box(tmp_path):
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-2, 2)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    path = tmp_path / "block.obj"
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {face}\n" for face in faces))
    scan = Scene([(Convex(str(path)), RigidTransform([3, 0, 0]))]).scan()
    assert scan.ranges_m[8, 450] == pytest.approx(2.5, abs=2e-3)
    assert np.isfinite(scan.ranges_m[8]).sum() == pytest.approx(2 * np.degrees(np.arctan2(1, 2.5)) / 0.4, abs=2)


def test_own_body_is_not_seen_and_a_moving_body_is():
    scene = Scene([], ball_W=(3.0, 0.0, -0.1))
    assert np.all(np.abs(scene.scan().ranges_m[7:9, 449:452] - 2.6) < 0.01)
    scene.move(scene.ball, RigidTransform([-3.0, 0.0, -0.1]))
    moved = scene.scan()
    assert not np.isfinite(moved.ranges_m[:, 449:452]).any()
    assert np.isfinite(moved.ranges_m[7:9, 0]).all()


def test_the_nearer_of_two_shapes_counts():
    near, far = (Box(0.2, 1, 4), RigidTransform([2, 0, 0])), (Box(0.2, 9, 9), RigidTransform([5, 0, 0]))
    assert Scene([far, near]).scan().ranges_m[8, 450] == pytest.approx(1.9, abs=2e-3)


def test_noise_has_the_given_sigma_and_dropout():
    scene = Scene(room(), spec=LidarSpec(dropout=0.02))
    error = scene.scan().ranges_m - Scene(room()).scan().ranges_m
    assert np.nanstd(error) == pytest.approx(0.03, rel=0.05)
    assert np.isnan(error).mean() == pytest.approx(0.02, rel=0.2)


def test_returns_too_near_or_too_far_are_lost():
    assert not np.isfinite(Scene(room(half_x=0.4, half_y=0.4)).scan().ranges_m[8, 450])
    scene = Scene([])
    assert not np.isfinite(scene.scan().ranges_m[:, :100]).any()


def test_same_seed_gives_the_same_scan():
    first, second = (Scene(room(), spec=LidarSpec()).scan().ranges_m for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_scan_of_three_hundred_shapes_is_fast():
    rng, statics = np.random.default_rng(2), room(9, 9)
    for _ in range(300):
        position = [*rng.uniform(-8, 8, 2), rng.uniform(-0.5, 0.5)]
        if np.hypot(position[0], position[1]) > 1.0:
            box = Box(*rng.uniform(0.05, 1.0, 3))
            statics.append((box, RigidTransform(RollPitchYaw(0, 0, rng.uniform(0, 3)), position)))
    scene = Scene(statics)
    scene.scan()
    assert min(timeit.repeat(scene.scan, number=1, repeat=10)) < 0.010
