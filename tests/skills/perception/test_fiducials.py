"""AprilTags in pictures: which are found, where, and how surely."""

from dataclasses import replace

import numpy as np
import pytest
from tag_pictures import HAND, facing, picture_of

from skills.perception.fiducials import find_tags
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


def test_a_grey_camera_with_fewer_pixels_finds_a_tag_from_nearer():
    body = replace(HAND, width=320, height=240, fx=165.0, fy=165.0, cx=160.0, cy=120.0)
    X_CT = facing(0.8, 40.0, 15.0)
    (seen,) = find_tags(picture_of([(7, 0.1, X_CT)], body), {7: 0.1})
    off_mm, off_deg = off(seen, X_CT)
    assert off_mm < 20.0
    assert off_deg < 3.0


def test_the_pose_of_a_wall_tag_looks_along_its_heading_with_its_top_up():
    X_WT = Tag(3, 0.15, p_W=(1.0, 2.0, 0.5), yaw_rad=np.pi / 2).X_WT()
    assert X_WT.translation().tolist() == [1.0, 2.0, 0.5]
    np.testing.assert_allclose(X_WT.rotation().matrix() @ [0, 0, 1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(X_WT.rotation().matrix() @ [0, 1, 0], [0, 0, 1], atol=1e-12)
