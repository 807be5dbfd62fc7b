from dataclasses import replace

import numpy as np
import pytest
from table_scene import BLUE, COKE, TABLE, Can, scene, seen_as

from skills.class_forms import class_forms
from skills.perception.object_segmentation import level_planes, segment_object, window_about

FORM = class_forms()["coke"]


def window_of(image):
    window = window_about(image, seen_as("coke", image).box)
    assert window is not None
    return window


def test_table_and_floor_are_planes_about_an_object_at_the_tables_edge():
    image = scene([Can(1.36, 0.0, 0.033, 0.115, COKE.colour)])
    heights = sorted(plane.height_m for plane in level_planes(window_of(image)))
    assert heights == pytest.approx([0.0, TABLE.height_m], abs=0.01)


def test_the_window_has_only_valid_depth():
    image = scene([COKE])
    image.depth_m[::2] = np.nan
    image.depth_m[1::4] = 60.0
    window = window_of(image)
    assert np.all(np.isfinite(window.p_O))
    assert 0.15 < window.valid.mean() < 0.35


def test_the_segment_has_only_points_of_the_object():
    found = segment_object(window_of(scene([COKE])), FORM)
    off = np.linalg.norm(found.points_O[:, :2] - [COKE.x, COKE.y], axis=1)
    assert np.percentile(off, 95) < COKE.radius + 0.008
    assert found.plane.height_m == pytest.approx(TABLE.height_m, abs=0.004)
    assert found.covered > 0.8


def test_the_segment_has_most_visible_points_of_the_object():
    image = scene([COKE])
    window = window_of(image)
    red = np.all(image.colour == COKE.colour, axis=-1)
    of_thing = red[np.rint(window.v).astype(int), np.rint(window.u).astype(int)]
    found = segment_object(window, FORM)
    assert np.count_nonzero(found.mask & of_thing) > 0.85 * np.count_nonzero(of_thing)


def test_another_object_in_the_box_is_left_out():
    image = scene([COKE, Can(COKE.x - 0.10, COKE.y - 0.05, 0.03, 0.08, BLUE)])
    window = window_of(image)
    blue = np.all(image.colour == BLUE, axis=-1)[np.rint(window.v).astype(int), np.rint(window.u).astype(int)]
    assert np.count_nonzero(segment_object(window, FORM).mask & blue) < 20


def test_a_wall_behind_two_parts_of_an_object_is_left_out():
    tank, hose = Can(1.0, -0.1, 0.06, 0.30, COKE.colour), Can(1.0, 0.08, 0.012, 0.28, COKE.colour)
    image = scene([tank, hose, Can(1.85, 0.0, 0.55, 1.2, BLUE)])
    window = window_of(image)
    mask = segment_object(window, class_forms()["extinguisher"]).mask
    for colour, low, high in ((BLUE, 0.0, 0.05), (COKE.colour, 0.8, 1.0)):
        its = np.all(image.colour == colour, axis=-1)[np.rint(window.v).astype(int), np.rint(window.u).astype(int)]
        assert low <= np.count_nonzero(mask & its) / np.count_nonzero(its & window.inside) <= high


def test_large_boxes_are_subsampled():
    image = scene([Can(0.75, 0.0, 0.12, 0.3, COKE.colour)])
    assert max(window_of(image).z.shape) <= 150


def test_a_grey_picture_is_enough():
    image = replace(scene([COKE]), colour=None)
    assert segment_object(window_about(image, seen_as("coke", scene([COKE])).box), FORM).covered > 0.8


def test_rays_go_through_the_sides_of_the_box():
    window = window_of(scene([COKE]))
    left, right, top, bottom, middle = window.rays_O()
    assert left @ right > 0.9
    assert top[2] > middle[2] > bottom[2]


def test_a_point_outside_of_the_picture_is_beyond_its_border():
    window = window_of(scene([COKE]))
    assert window.border_px(np.array([COKE.x, COKE.y, 0.8])) > 20.0
    assert window.border_px(np.array([COKE.x, 2.0, 0.8])) < 0.0
    assert window.border_px(np.array([-1.0, 0.0, 0.8])) < 0.0
