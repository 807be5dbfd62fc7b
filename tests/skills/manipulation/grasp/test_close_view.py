"""Tests of the close view of an object without a class."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import GREEN, TABLE, Can, scene

from skills.api import LocalisationEstimate, ObjectKind, ObjectObservation
from skills.manipulation.arm.poses import camera_pose
from skills.manipulation.grasp.close_view import examine

PLACE = LocalisationEstimate(0.0, RigidTransform(), np.zeros((3, 3)), True)
ONE, OTHER = Can(1.0, 0.0, 0.033, 0.115, GREEN), Can(1.0, 0.067, 0.033, 0.115, GREEN)


def examined(things, at, p_WB=(0.0, 0.0, 0.0), name="thing"):
    seen = ObjectObservation(0.0, ObjectKind(name), (at.x, at.y, 0.81), (0.066, 0.066, 0.115), 0.0, 0.7, "table")
    return examine(scene(things), RigidTransform(p_WB), TABLE, seen, PLACE, (), 0.12)


@pytest.mark.parametrize(("at", "name"), [(ONE, "thing"), (OTHER, "thing"), (OTHER, "mug")])
def test_of_two_touching_objects_the_seen_one_is_the_target_and_the_other_an_obstacle(at, name):
    view = examined([ONE, OTHER], at, name=name)
    assert view.target.centre_B == pytest.approx((at.x, at.y), abs=0.012)
    assert view.target.width_m == pytest.approx(0.066, abs=0.012)
    assert len(view.boxes) == 2  # the table and the other can
    (other,) = view.others
    assert (str(other.seen.kind), other.seen.surface, len(other.boxes)) == ("thing", "table", 1)


def test_a_tall_object_is_seen_up_to_its_top():
    seen = ObjectObservation(0.0, ObjectKind("thing"), (1.0, 0.0, 1.05), (0.16, 0.16, 0.6), 0.0, 0.7, "table")
    image = scene([Can(1.0, 0.0, 0.04, 0.6, GREEN)], X_WC=camera_pose(np.array([0.1, 0.0, 1.5]), [1.0, 0.0, 1.0]))
    assert examine(image, RigidTransform(), TABLE, seen, PLACE, (), 0.12).target.height_m > 0.55


def test_a_missing_object_is_not_seen():
    assert examined([], ONE) is None


def test_a_neighbour_is_reported_with_its_position_and_size():
    p_WB = (0.2, 0.1, 0.3)
    (other,) = examined([ONE, OTHER], ONE, p_WB).others
    x, y, z = other.seen.position_W
    assert (x, y) == pytest.approx((OTHER.x, OTHER.y), abs=0.012)
    assert z == pytest.approx(TABLE.height_m + 0.5 * other.seen.size_m[2], abs=0.01)
    assert other.seen.size_m == pytest.approx((0.066, 0.066, 0.115), abs=0.015)
    assert p_WB + other.centre_B == pytest.approx(other.seen.position_W, abs=0.02)


def test_a_wall_beside_the_object_is_an_obstacle_and_no_object_in_the_way():
    wall = [Can(1.15, y, 0.03, 0.3, GREEN) for y in np.arange(-0.36, 0.37, 0.04)]
    view = examined([ONE, *wall], ONE)
    assert view.others == ()
    assert len(view.boxes) > 1
