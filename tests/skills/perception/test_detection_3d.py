import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from table_scene import BLUE, CAMERA, COKE, LENS, RED, TABLE, Can, scene, seen_as

from skills.api import Detection, LocalisationEstimate, Surface
from skills.perception.detection_3d import at_points, detections_3d, observation, place_covariance, surface_below
from skills.perception.point_cloud import depth_at_points, in_plain_view

SURE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)
COKE_W = np.array([COKE.x, COKE.y, 0.8075])


def only(image, place=SURE, surfaces=(TABLE,), name="coke"):
    (found,) = detections_3d(image, place, [seen_as(name, image)], surfaces)
    return found


def test_a_detection_gets_position_size_surface_and_colours():
    found = only(scene([COKE]))
    assert found.position_W == pytest.approx(COKE_W, abs=0.006)
    assert (found.surface, found.class_name, found.stamp_s) == ("table", "coke", 1.5)
    assert np.all(np.median(found.colours, axis=0) == RED)


def test_a_detection_without_depth_is_left_out():
    image = scene([COKE])
    image.depth_m[:] = 0.0
    assert detections_3d(image, SURE, [seen_as("coke", image)], [TABLE]) == ()


def ring(can, z):
    """Points of a scan around an upright cylinder."""
    turns = np.linspace(0.0, 2.0 * np.pi, 12)
    return np.column_stack([can.x + can.radius * np.cos(turns), can.y + can.radius * np.sin(turns), np.full(12, z)])


BEHIND = Can(1.3, -0.17, 0.033, 0.115, BLUE)


def test_the_nearest_scan_points_in_its_box_locate_a_detection_without_depth():
    image = scene([COKE])
    points_W = np.concatenate([ring(BEHIND, 0.83), ring(COKE, 0.8)])
    found = at_points(seen_as("coke", image), image, SURE, points_W, "table")
    assert found.position_W[:2] == pytest.approx(COKE_W[:2], abs=0.01)
    assert (found.surface, found.class_name, len(found.colours)) == ("table", "coke", 0)


def test_scan_points_below_a_half_hidden_detection_locate_it():
    image = scene([COKE])
    whole = seen_as("coke", image)
    u0, v0, u1, v1 = whole.box
    upper = Detection("coke", 0.9, (u0, v0, u1, v0 + 0.3 * (v1 - v0)))
    found = at_points(upper, image, SURE, ring(COKE, 0.76), "table")
    assert found.position_W[:2] == pytest.approx(COKE_W[:2], abs=0.01)


# no points at all, points beside the box, and a box far too large for a coke at that distance
@pytest.mark.parametrize(
    ("points_W", "grow_px"),
    [(np.empty((0, 3)), 0.0), (ring(Can(1.0, 0.4, 0.03, 0.1, RED), 0.8), 0.0), (ring(COKE, 0.8), 250.0)],
)
def test_a_detection_without_fitting_scan_points_has_no_position(points_W, grow_px):
    image = scene([COKE])
    u0, v0, u1, v1 = seen_as("coke", image).box
    seen = Detection("coke", 0.9, (u0 - grow_px, v0, u1 + grow_px, v1))
    assert at_points(seen, image, SURE, points_W, "table") is None


def test_an_observation_has_the_data_of_its_detection():
    seen = observation(only(scene([COKE])), ("red",))
    assert str(seen.kind) == "red coke"
    assert seen.position_W == pytest.approx(tuple(COKE_W), abs=0.006)
    assert (seen.score, seen.surface) == (0.9, "table")


def test_the_position_follows_the_localisation():
    turned = RigidTransform(RollPitchYaw(0.0, 0.0, 0.5), [1.0, 2.0, 0.0])
    found = only(scene([COKE]), LocalisationEstimate(0.0, turned, np.zeros((3, 3)), True), ())
    assert found.position_W == pytest.approx(turned @ COKE_W, abs=0.006)
    assert found.yaw_rad == pytest.approx(0.5)


def test_the_localisations_uncertainty_is_added_to_the_position_in_the_world():
    unsure = LocalisationEstimate(0.0, RigidTransform(), np.diag([0.03**2, 0.01**2, 0.0]), True)
    found = only(scene([COKE]), unsure)
    added = found.place_covariance - found.covariance
    assert np.diag(added) == pytest.approx([0.03**2, 0.01**2, 0.0])


def test_an_uncertain_heading_adds_sideways_uncertainty_to_far_points():
    added = place_covariance(np.array([2.0, 0.0, 0.8]), np.zeros(3), np.diag([0.0, 0.0, 0.01**2]))
    assert np.sqrt(np.diag(added)) == pytest.approx([0.0, 0.02, 0.0])


# class -> whether it can span 0.6 m, where the longest are (class_forms.yaml) 0.30, 0.36, 0.60 and 1.00 m long
@pytest.mark.parametrize(("name", "possible"), [("coke", False), ("beer", False), ("wrench", True), ("hammer", True)])
def test_a_box_far_too_large_for_its_class_is_left_out(name, possible):
    image = scene([COKE])
    u0, v0, u1, v1 = seen_as("coke", image).box
    half_px = 0.3 * LENS.fx / float(np.linalg.norm(COKE_W - CAMERA))
    middle = 0.5 * (u0 + u1)
    wide = Detection(name, 0.9, (middle - half_px, v0, middle + half_px, v1))
    assert bool(detections_3d(image, SURE, [wide], [TABLE])) is possible


@pytest.mark.parametrize(
    ("p_W", "base_m", "name"),
    [
        ((1.0, 0.0, 0.8), 0.76, "table"),
        ((1.0, 0.0, 0.5), 0.42, "shelf"),
        ((1.0, 0.0, 0.6), 0.60, None),
        ((0.78, 0.0, 0.8), 0.75, "table"),
        ((0.5, 0.0, 0.8), 0.75, None),
        ((0.5, 0.0, 0.1), 0.02, "floor"),
    ],
)
def test_surface_below_an_object(p_W, base_m, name):
    assert surface_below(np.array(p_W), base_m, (TABLE, Surface("shelf", TABLE.polygon_W, 0.40))) == name


def test_depth_at_points_is_theirs_and_that_of_the_picture():
    image = scene([COKE], noise_m=0.0)
    points = np.array([[1.2, 0.3, 0.75], [COKE.x + 0.2, COKE.y, 0.76], [-1.0, 0.0, 0.75]])
    depth, seen = depth_at_points(image, RigidTransform(), points)
    assert depth[0] == pytest.approx(seen[0], abs=0.005)
    assert np.isnan(depth[2])
    assert np.isnan(seen[2])


def test_an_object_behind_another_is_not_in_plain_view():
    image = scene([Can(COKE.x, COKE.y, 0.05, 0.3, BLUE)])
    assert in_plain_view(image, RigidTransform(), np.array([1.2, 0.3, 0.8]))
    assert not in_plain_view(image, RigidTransform(), np.array([COKE.x + 0.15, COKE.y - 0.02, 0.8]))
    assert not in_plain_view(image, RigidTransform(), np.array([-1.0, 0.0, 0.8]))


def test_a_long_object_beside_another_does_not_take_its_points():
    disk = Can(1.02, 0.16, 0.06, 0.012, RED)  # as flat as a wrench
    before = Can(0.94, 0.115, 0.03, 0.10, BLUE)
    image = scene([disk, before])
    wrench, coke = detections_3d(image, SURE, [seen_as("wrench", image), seen_as("coke", image, BLUE)], [TABLE])
    assert wrench.position_W[:2] == pytest.approx([disk.x, disk.y], abs=0.03)
    assert wrench.position_W[2] < TABLE.height_m + 0.02
    assert coke.position_W[:2] == pytest.approx([before.x, before.y], abs=0.01)
