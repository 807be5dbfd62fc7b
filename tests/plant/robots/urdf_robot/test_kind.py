"""A robot from a URDF: its capabilities, and the errors of its file."""

import shutil

import numpy as np
import pytest

from plant.robots.urdf_robot.description import Description
from skills.inputs.errors import InputError
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import BaseKind, Mount
from tests.tables import table


def test_capabilities_have_the_protocols_frames(rover_kind):
    can = rover_kind.capabilities()
    assert can.base_kind is BaseKind.DIFFERENTIAL and can.lidar_height_m == pytest.approx(0.33)
    assert [camera.mount for camera in can.cameras] == [Mount.BODY] and can.object_camera is can.cameras[0]
    X_BH = arm_model(can).X_BH(np.zeros(6))
    assert np.allclose(X_BH.translation(), [0.88, 0.0, 0.52])
    assert np.allclose(X_BH.rotation().matrix(), np.eye(3), atol=1e-6)  # x along the fingers, z along their closing


def test_the_arm_is_stowed_over_the_footprint_out_of_the_cameras_view(rover_kind):
    can = rover_kind.capabilities()
    points_B = arm_model(can).points_B(np.array(can.arm.stowed_rad))
    assert np.all(np.abs(points_B[:, :2]) < np.abs(can.footprint_m).max(axis=0))
    x, y, z = can.cameras[0].X_FC.inverse() @ points_B[2:].T
    assert np.all(np.hypot(x, y) > 0.5 * z)


@pytest.mark.parametrize(*table(__file__, "wrong_parts"))
def test_a_wrong_part_is_named_with_its_line(rover_package, tmp_path, old, new, message):
    shutil.copytree(rover_package, tmp_path / "changed")
    path = tmp_path / "changed/robot.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=message) as refused:
        _ = Description(path).capabilities
    assert refused.value.line
