"""Tests of solid cells from depth pictures, and of the boxes that cover them."""

import numpy as np
from pydrake.math import RigidTransform
from table_scene import CAMERA, TABLE, Can, scene

from skills.grid_map import CELL_M
from skills.manipulation.arm.solid_cells import (
    Outline,
    add_picture,
    add_view,
    boxes_around,
    hidden_boxes,
    merge_cells,
    never_seen,
    solid_boxes,
)

NOTHING = np.empty((0, 3), dtype=np.int64)
BODY = RigidTransform([0.0, 0.0, 0.5])
NOTHING_OWN = Outline(RigidTransform(), np.zeros(2), np.zeros(2))


def nothing_of(points):
    return np.zeros(len(points), dtype=bool)


def picture(*things):
    return scene(things)


def inside(boxes, p_W):
    p_B = BODY.inverse() @ np.array(p_W)
    local = [box.X_FG.inverse() @ p_B for box in boxes]
    return any(np.all(np.abs(p) <= np.array(box.size_m) / 2 + 1e-9) for p, box in zip(local, boxes, strict=True))


def test_a_seen_cell_and_the_cells_behind_it_are_solid():
    can = Can(1.0, 0.0, 0.04, 0.3, (190, 15, 20))
    boxes = solid_boxes(add_picture(NOTHING, picture(can), RigidTransform(), NOTHING_OWN), BODY, 2.0, nothing_of)
    assert inside(boxes, (0.97, 0.0, 0.9))
    assert inside(boxes, (1.15, 0.0, 0.9))
    assert not inside(boxes, (0.8, 0.0, 0.95))


def test_cells_behind_end_at_the_reach_of_the_arm():
    can = Can(1.0, 0.0, 0.04, 0.3, (190, 15, 20))
    boxes = solid_boxes(add_picture(NOTHING, picture(can), RigidTransform(), NOTHING_OWN), BODY, 1.1, nothing_of)
    assert inside(boxes, (0.97, 0.0, 0.9))
    assert not inside(boxes, (1.15, 0.0, 0.9))


def test_a_removed_object_is_forgotten_once_the_camera_sees_past_it():
    can = Can(1.0, 0.0, 0.04, 0.3, (190, 15, 20))
    cells = add_picture(NOTHING, picture(can), RigidTransform(), NOTHING_OWN)
    cells = add_picture(cells, picture(), RigidTransform(), NOTHING_OWN)
    assert not inside(solid_boxes(cells, BODY, 2.0, nothing_of), (0.97, 0.0, 0.95))
    assert inside(solid_boxes(cells, BODY, 2.0, nothing_of), (1.2, 0.2, TABLE.height_m - 0.005))


def test_boxes_of_chosen_cells_have_nothing_behind_them():
    can = Can(1.0, 0.0, 0.04, 0.3, (190, 15, 20))
    cells = add_picture(NOTHING, picture(can), RigidTransform(), NOTHING_OWN)
    boxes = boxes_around(cells, BODY, lambda p: p[:, 2] > 0.85)
    assert inside(boxes, (0.97, 0.0, 0.9))
    assert not inside(boxes, (1.15, 0.0, 0.9))


def test_points_within_the_robots_outline_are_not_solid():
    can = Can(1.0, 0.0, 0.04, 0.3, (190, 15, 20))
    own = Outline(RigidTransform([0.9, 0.1, 0.5]), np.array([0.0, -0.2]), np.array([0.2, 0.0]))
    everything = add_picture(NOTHING, picture(can), RigidTransform(), NOTHING_OWN)
    rest = add_picture(NOTHING, picture(can), RigidTransform(), own)
    assert own.holds((everything + 0.5) * CELL_M).any()
    assert {tuple(cell) for cell in rest.tolist()} < {tuple(cell) for cell in everything.tolist()}
    assert not inside(solid_boxes(rest, BODY, 2.0, nothing_of), (0.97, 0.0, 0.9))


def test_excluded_cells_are_not_solid():
    boxes = solid_boxes(
        add_picture(NOTHING, picture(), RigidTransform(), NOTHING_OWN), BODY, 2.0, lambda p: p[:, 2] < 0.8
    )
    assert boxes == []


def test_merged_boxes_cover_exactly_the_cells():
    cells = np.unique(np.random.default_rng(3).integers(-3, 4, (90, 3)), axis=0)
    covered = [
        (x, y, z)
        for low, high in merge_cells(cells)
        for x in range(low[0], high[0])
        for y in range(low[1], high[1])
        for z in range(low[2], high[2])
    ]
    assert sorted(covered) == sorted(map(tuple, cells.tolist()))


def test_a_wall_is_one_box():
    wall = np.stack(np.meshgrid([4], np.arange(30), np.arange(20), indexing="ij"), axis=-1).reshape(-1, 3)
    assert len(merge_cells(wall)) == 1
    assert CELL_M < 0.05


def test_points_outside_all_pictures_or_far_behind_their_depth_were_never_seen():
    views = add_view((), picture(), RigidTransform())
    on_the_table = np.array([1.05, 0.0, TABLE.height_m])
    over_the_camera, under_the_table = CAMERA + [0.0, 0.0, 0.5], CAMERA + 1.6 * (on_the_table - CAMERA)
    points = np.array([on_the_table + [0.0, 0.0, 0.1], over_the_camera, under_the_table])
    assert never_seen(points, views).tolist() == [False, True, True]
    assert never_seen(points, ()).all()


# the camera looks down on the table: 10 cm over it is shown, half a metre over it is above the picture
def test_space_beside_and_above_a_point_that_no_picture_shows_is_hidden():
    views, at_W = add_view((), picture(), RigidTransform()), np.array([1.05, 0.0, TABLE.height_m])
    boxes = hidden_boxes(at_W, views, BODY, nothing_of)
    assert not inside(boxes, at_W + [0.0, 0.0, 0.1])
    assert inside(boxes, at_W + [0.0, 0.0, 0.5])
    assert hidden_boxes(at_W, views, BODY, lambda points: np.ones(len(points), dtype=bool)) == []


def test_only_the_last_views_are_stored():
    views = ()
    for _ in range(40):
        views = add_view(views, picture(), RigidTransform())
    assert len(views) == 32


def test_a_view_does_not_keep_the_whole_image_in_memory():
    ((view, _),) = add_view((), picture(), RigidTransform())
    assert view.depth_m.base is None
