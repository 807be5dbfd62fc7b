"""Cameras render the scene at the poses of Spot's cameras, with noise."""

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from plant import rendering
from plant.robots.sensor_suite import Camera
from plant.robots.spot.description import CAMERAS
from plant.sensors.camera_spec import load_cameras
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from skills.inputs.errors import InputError
from skills.robot import FrameTree, Intrinsics
from tests.tables import table

HEIGHT_M = 0.52
QUIET = DepthNoise(sigma_m=0.0, sigma_per_m=0.0, speck=0.0, dark=-1.0, shiny=256.0)
BODY_BOX_CENTRES_B = {  # where a box stands, in the body frame, for each body camera to look at
    "frontleft": (1.3, -0.4, -0.42),
    "frontright": (1.3, 0.4, -0.42),
    "left": (-0.16, 1.5, -0.3),
    "right": (-0.17, -1.5, -0.3),
    "back": (-1.8, -0.04, -0.3),
}


class Scene:
    """A floor, coloured boxes, and a body whose cameras face them."""

    def __init__(self, *box_centres_B):
        builder = DiagramBuilder()
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
        world = self.plant.world_body()
        X_WG = RigidTransform([0, 0, -0.05])
        self.plant.RegisterVisualGeometry(world, X_WG, Box(20, 20, 0.1), "floor", np.array([0.6, 0.6, 0.5, 1]))
        for number, centre_B in enumerate(box_centres_B):
            X_WG, colour = RigidTransform(np.add(centre_B, [0, 0, HEIGHT_M])), np.array([0.9, 0.1, 0.1, 1])
            self.plant.RegisterVisualGeometry(world, X_WG, Box(0.2, 0.2, 0.2), f"box_{number}", colour)
        self.body = self.plant.AddRigidBody("body", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        self.plant.Finalize()
        diagram = builder.Build()
        self.root = diagram.CreateDefaultContext()
        context, X_WB = self.plant.GetMyContextFromRoot(self.root), RigidTransform([0, 0, HEIGHT_M])
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(context, self.body, X_WB)
        self.positions = self.plant.GetPositions(context)
        self.scene = rendering.Scene(diagram, self.plant, self.scene_graph)

    def camera(self, name, seed=0, **noise):
        frame = self.plant.GetBodyFrameIdOrThrow(self.body.index())
        return Camera(load_cameras(CAMERAS)[name], frame, np.random.default_rng(seed), scene=self.scene, **noise)

    def take(self, name, **noise):
        return self.camera(name, **noise).take(self.positions, 2.0, FrameTree({}))


def points_B(image, spec):
    """Depth points in the link frame, (N, 3), and the grey level of each."""
    k = image.depth_intrinsics
    v, u = np.nonzero(image.depth_m)
    z = image.depth_m[v, u].astype(float)
    points_C = np.stack([(u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z])
    return (spec.X_link_camera() @ points_C).T


@pytest.fixture(scope="module")
def around():
    """A scene with a box before each body camera."""
    return Scene(*BODY_BOX_CENTRES_B.values())


@pytest.fixture(scope="module")
def ahead():
    """A scene with a box before the hand."""
    return Scene((1.0, 0.0, -0.1))


@pytest.mark.parametrize("name", list(BODY_BOX_CENTRES_B))
def test_body_camera_depth_lands_on_the_box_and_the_floor(around, name):
    points = points_B(around.take(name, depth_noise=QUIET), load_cameras(CAMERAS)[name])
    on_floor = np.abs(points[:, 2] + HEIGHT_M) < 0.01
    off_box = {each: np.max(np.abs(points - at), axis=1) - 0.1 for each, at in BODY_BOX_CENTRES_B.items()}
    assert on_floor.sum() > 500 and (np.abs(off_box[name]) < 0.01).sum() > 80
    assert np.mean(on_floor | (np.abs(np.min([*off_box.values()], axis=0)) < 0.02)) > 0.99


def test_body_cameras_face_the_directions_of_their_names():
    views = {name: spec.X_link_camera().rotation().matrix()[:, 2] for name, spec in load_cameras(CAMERAS).items()}
    assert min(views[name][0] for name in ("frontleft", "frontright", "hand")) > 0.3
    assert views["left"][1] > 0.9 and views["right"][1] < -0.9 and views["back"][0] < -0.9
    assert all(axis[2] < -0.2 for name, axis in views.items() if name != "hand")
    assert views["frontleft"][1] < 0.0 < views["frontright"][1]  # they look crosswise, as on Spot


def test_hand_camera_gives_colour_and_full_depth(ahead):
    image = ahead.take("hand")
    forms = image.colour.shape, image.depth_m.shape, image.depth_m.dtype
    assert forms == ((480, 640, 3), (480, 640), np.float32)
    assert (image.source, image.camera_frame, image.stamp_s) == ("hand", "hand_camera", 2.0)
    reddest = image.colour[..., 0].astype(int) - image.colour[..., 1]
    box_depth = image.depth_m[(reddest > 100) & (image.depth_m > 0)]
    assert np.median(box_depth) == pytest.approx(0.9 - 0.138, abs=0.05)


def test_body_camera_is_grey_with_registered_smaller_depth(around):
    image = around.take("frontleft")
    grey, depth = image.intrinsics, image.depth_intrinsics
    shapes = (grey.height, grey.width), (depth.height, depth.width)
    assert (image.colour, image.grey.shape, image.depth_m.shape) == (None, *shapes)
    assert (grey.cx + 0.5) / grey.fx == pytest.approx((depth.cx + 0.5) / depth.fx)


def test_same_seed_gives_the_same_picture_and_another_seed_another(ahead):
    first, second, other = (ahead.take("hand", seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.colour, second.colour)
    np.testing.assert_array_equal(first.depth_m, second.depth_m)
    assert (first.colour != other.colour).any()


def depth_degrader(seed=0, **noise):
    intrinsics = Intrinsics(320, 240, 280.0, 280.0, 160.0, 120.0)
    return DepthDegrader(np.random.default_rng(seed), intrinsics, (0.3, 4.0), DepthNoise(**noise))


GREY = np.full((240, 320), 120, dtype=np.uint8)


def plane(z_m):
    return np.full((240, 320), z_m, dtype=np.float32)


@pytest.mark.parametrize("z_m", [0.5, 1.5, 3.0])
def test_depth_noise_grows_with_the_square_of_distance(z_m):
    depth = depth_degrader().depth(plane(z_m), GREY)
    assert np.std(depth[depth > 0] - z_m) == pytest.approx(0.0015 + 0.0012 * z_m**2, rel=0.1)


@pytest.mark.parametrize("z_m", [0.1, 0.29, 4.2, np.inf, 0.0])
def test_depth_out_of_range_is_none(z_m):
    assert not depth_degrader().depth(plane(z_m), GREY).any()


def test_depth_is_in_whole_millimetres():
    depth = depth_degrader().depth(plane(1.2), GREY)
    np.testing.assert_allclose(depth * 1000, np.round(depth * 1000), atol=1e-3)


def test_depth_has_holes_at_edges():
    clean = plane(1.0)
    clean[:, 160:] = 2.0
    depth = depth_degrader().depth(clean, GREY)
    assert 0.4 < np.mean(depth[:, 159:161] == 0) < 0.8 and np.mean(depth[:, :150] == 0) < 0.01


def test_depth_is_lost_at_grazing_angles_only():
    slope = np.linspace(0.0, 1.0, 320, dtype=np.float32)[None, :].repeat(240, axis=0)
    assert np.mean(depth_degrader().depth((1.0 + slope).astype(np.float32), GREY)[:, 5:-5] == 0) < 0.01
    steep = depth_degrader().depth((1.0 + 16.0 * slope).astype(np.float32), GREY)
    assert np.mean(steep[:, 4:8] == 0) > 0.99


def test_depth_has_patches_missing_on_black():
    missing = [np.mean(depth_degrader().depth(plane(1.0), grey) == 0) for grey in (np.full_like(GREY, 5), GREY)]
    assert 0.2 < missing[0] < 0.8 and missing[1] < 0.01


def test_picture_noise_grains_and_darkens_the_corners():
    degrade = PictureDegrader(np.random.default_rng(0), 240, 320, PictureNoise())
    noisy = degrade.colour(np.full((240, 320, 3), 200, dtype=np.uint8)).astype(float)
    assert np.std(noisy[110:130, 150:170]) == pytest.approx(2.5, rel=0.15)
    assert noisy[:20, :20].mean() < noisy[110:130, 150:170].mean() - 15


@pytest.mark.parametrize(*table(__file__, "wrong_cameras"))
def test_a_wrong_file_of_cameras_is_refused(tmp_path, old, new, said):
    (tmp_path / "cameras.yaml").write_text(CAMERAS.read_text().replace(old, new) if old else new)
    with pytest.raises(InputError, match=said):
        load_cameras(tmp_path / "cameras.yaml")


def test_only_the_requested_part_is_rendered(around):
    camera = around.camera("left")
    visual = camera.take(around.positions, 1.0, FrameTree({}), depth=False)
    assert (visual.grey.shape, visual.depth_m.shape) == ((240, 320), (0, 0))
    depth = camera.take(around.positions, 1.0, FrameTree({}), visual=False)
    assert (depth.grey.shape, depth.colour, depth.depth_m.shape) == ((0, 0), None, (120, 160))


def test_depth_is_lost_on_dark_spots_of_the_picture_taken_with_it(around):
    camera = around.camera("left", depth_noise=DepthNoise(sigma_m=0.0, sigma_per_m=0.0, speck=0.0, dark=75.0))
    both, alone = (camera.take(around.positions, 1.0, FrameTree({}), visual=visual) for visual in (True, False))
    assert np.mean(both.depth_m == 0.0) > np.mean(alone.depth_m == 0.0) + 0.1
