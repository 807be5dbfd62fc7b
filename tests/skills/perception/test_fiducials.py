"""AprilTags in pictures: which are found, where, and how surely."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import CAMERA, LENS, TABLE, Can, scene
from tag_pictures import HAND, facing, picture_of

from skills.api import LocalisationEstimate
from skills.detection import Detection
from skills.manipulation.arm.poses import camera_pose
from skills.perception.detection_3d import detections_3d
from skills.perception.detector.camera_images import detect_in_image
from skills.perception.fiducials import TAG_SCORE, find_tags, with_tags
from skills.testing.estimators import PlainColours
from skills.world_model import Tag


def off(seen, X_CT):
    """Errors of a tag's pose: mm and degrees."""
    X = X_CT.inverse() @ seen.X_OT
    return 1000.0 * np.linalg.norm(X.translation()), np.degrees(X.rotation().ToAngleAxis().angle())


@pytest.mark.parametrize(("tilt_deg", "turn_deg"), [(0.0, 0.0), (45.0, 20.0), (-45.0, 120.0), (60.0, -75.0)])
def test_a_tag_of_10_cm_is_found_and_placed_from_2_5_m(tilt_deg, turn_deg):
    X_CT = facing(2.5, tilt_deg, turn_deg, (0.4, -0.2))
    (seen,) = find_tags(picture_of([(7, 0.1, X_CT)]), {7: 0.1})
    off_mm, off_deg = off(seen, X_CT)
    assert (seen.id, seen.stamp_s) == (7, 2.5)
    assert off_mm < 20.0
    assert off_deg < 3.0
    assert seen.error_px < 0.5


def test_depth_decides_between_the_two_poses_of_a_small_tag():
    X_CT = facing(2.5, 12.0, 30.0)
    (blind,) = find_tags(picture_of([(7, 0.1, X_CT)], depth=False), {7: 0.1})
    (seen,) = find_tags(picture_of([(7, 0.1, X_CT)]), {7: 0.1})
    assert blind.ambiguity > 0.2
    assert seen.ambiguity < 0.1
    assert off(seen, X_CT)[1] < 3.0


def test_a_grey_camera_with_fewer_pixels_finds_a_tag_from_nearer():
    body = replace(HAND, width=320, height=240, fx=165.0, fy=165.0, cx=160.0, cy=120.0)
    X_CT = facing(0.8, 40.0, 15.0)
    (seen,) = find_tags(picture_of([(7, 0.1, X_CT)], body), {7: 0.1})
    off_mm, off_deg = off(seen, X_CT)
    assert off_mm < 20.0
    assert off_deg < 3.0


def test_tags_that_the_robot_does_not_know_are_ignored():
    both = picture_of([(7, 0.1, facing(1.0, 20.0, 0.0, (-0.2, 0.0))), (8, 0.1, facing(1.0, 20.0, 0.0, (0.2, 0.0)))])
    assert [seen.id for seen in find_tags(both, {8: 0.1})] == [8]
    assert find_tags(both, {9: 0.1}) == ()


def test_a_tag_with_a_hidden_corner_is_not_found():
    image = picture_of([(7, 0.1, facing(1.0, 20.0))])
    (seen,) = find_tags(image, {7: 0.1})
    u, v = np.rint(seen.corners[0]).astype(int)
    grey = image.grey.copy()
    grey[v - 8 : v + 8, u - 8 : u + 20] = 150
    assert find_tags(replace(image, grey=grey), {7: 0.1}) == ()


MUG = Can(1.0, 0.1, 0.045, 0.12, (200, 200, 190))
X_WC = camera_pose(CAMERA, np.array([1.0, 0.1, TABLE.height_m]))
HERE = LocalisationEstimate(1.5, RigidTransform(), np.zeros((3, 3)), True)


@pytest.fixture
def table():
    """The table with a mug that carries tag 7 on its front."""
    return seen_from(X_WC)


def seen_from(X_WC, size_m=0.06):
    """Image of the table from a camera; the tag has a size."""
    plain = scene([MUG, Can(1.2, -0.3, 0.03, 0.2, (150, 20, 20))], X_WC=X_WC)
    X_WT = Tag(7, size_m, p_W=(MUG.x - MUG.radius - 0.001, MUG.y, TABLE.height_m + 0.06), yaw_rad=np.pi).X_WT()
    drawn = picture_of([(7, size_m, X_WC.inverse() @ X_WT)], LENS, ground=0)
    tag = drawn.depth_m < 3.0
    grey, depth = np.where(tag, drawn.grey, plain.grey), np.where(tag, drawn.depth_m, plain.depth_m)
    return replace(plain, grey=grey, colour=np.repeat(grey[..., None], 3, axis=2), depth_m=depth)


NETWORKS = PlainColours({"coke": (255, 0, 255)})


def test_an_object_with_a_tag_is_detected_as_its_class(table):
    detector = with_tags(NETWORKS, [], [Tag(7, 0.06, on="mug"), Tag(9, 0.06, on="cup")])
    assert set(detector.class_names) == {"coke", "mug", "cup"}
    (found,) = detect_in_image(detector, table)
    assert (found.class_name, found.score) == ("mug", TAG_SCORE)


def test_the_pose_of_a_wall_tag_looks_along_its_heading_with_its_top_up():
    X_WT = Tag(3, 0.15, p_W=(1.0, 2.0, 0.5), yaw_rad=np.pi / 2).X_WT()
    assert X_WT.translation().tolist() == [1.0, 2.0, 0.5]
    np.testing.assert_allclose(X_WT.rotation().matrix() @ [0, 0, 1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(X_WT.rotation().matrix() @ [0, 1, 0], [0, 0, 1], atol=1e-12)


def test_its_box_holds_the_object_and_not_the_table(table):
    (found,) = detect_in_image(with_tags(NETWORKS, [], [Tag(7, 0.06, on="mug")]), table)
    (mug,) = detections_3d(table, HERE, [found], [TABLE])
    np.testing.assert_allclose(mug.position_W, [MUG.x, MUG.y, TABLE.height_m + 0.06], atol=0.02)
    np.testing.assert_allclose(mug.size_m, [0.09, 0.09, 0.12], atol=0.025)
    assert mug.surface == "table"


def test_its_box_holds_the_object_where_the_edges_of_the_picture_show_the_floor_alone():
    far = seen_from(camera_pose(np.array([-0.3, 0.1, 1.45]), np.array([1.0, 0.1, TABLE.height_m])), 0.09)
    (found,) = detect_in_image(with_tags(NETWORKS, [], [Tag(7, 0.09, on="mug")]), far)
    (mug,) = detections_3d(far, HERE, [found], [TABLE])
    np.testing.assert_allclose(mug.position_W, [MUG.x, MUG.y, TABLE.height_m + 0.06], atol=0.02)


def test_a_tag_outvotes_what_its_object_is_taken_for(table):
    class Mistaken(PlainColours):
        def detect(self, pictures):
            return [(Detection("coke", 0.8, box), Detection("beer", 0.9, (0.0, 0.0, 40.0, 80.0))) for _ in pictures]

    (tagged,) = detect_in_image(with_tags(NETWORKS, [], [Tag(7, 0.06, on="mug")]), table)
    box = tagged.box
    found = detect_in_image(with_tags(Mistaken({}), [], [Tag(7, 0.06, on="mug")]), table)
    assert [each.class_name for each in found] == ["mug", "beer"]


def test_without_tags_on_objects_the_detector_stays_the_same():
    assert with_tags(NETWORKS, [], [Tag(3, 0.15, p_W=(1.0, 2.0, 0.5))]) is NETWORKS


def test_a_tag_without_depth_gives_its_own_box(table):
    blind = replace(table, depth_m=np.zeros_like(table.depth_m))
    (found,) = detect_in_image(with_tags(NETWORKS, [], [Tag(7, 0.06, on="mug")]), blind)
    assert found.box[2] - found.box[0] < 40.0
