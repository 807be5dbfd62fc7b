import numpy as np
import pytest

from plant.robots.spot.description import LEGS
from plant.robots.spot.legs import LegKinematics, UnreachableFootError


def foot_B(leg, hx_rad, hy_rad, kn_rad):
    """Centre of the foot in the body frame, by forward kinematics."""
    shin_x, shin_z = -leg.shin_m * np.sin(kn_rad), -leg.shin_m * np.cos(kn_rad)
    u_x, u_z = leg.thigh_x_m + shin_x, -leg.thigh_z_m + shin_z
    x = u_x * np.cos(hy_rad) + u_z * np.sin(hy_rad)
    z = -u_x * np.sin(hy_rad) + u_z * np.cos(hy_rad)
    c, s = np.cos(hx_rad), np.sin(hx_rad)
    return np.array([x, c * leg.side_m - s * z, s * leg.side_m + c * z]) + leg.p_BHip


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("joints", [(0.0, 0.85, -1.58), (0.3, 0.2, -0.6), (-0.4, 1.4, -2.3)])
def test_inverse_gives_back_the_joints(leg, joints):
    legs = LegKinematics.from_facts(leg)
    np.testing.assert_allclose(legs.joints(foot_B(legs, *joints)), joints, atol=1e-9)


def test_feet_stand_about_half_a_metre_under_the_body_when_standing():
    foot = foot_B(LegKinematics.from_facts("fl"), 0.0, 0.85, -1.58)
    # sole = centre - radius 0.036; the body origin stands at 0.52
    assert foot[2] - 0.036 == pytest.approx(-0.52, abs=0.02)


def test_a_foot_out_of_reach_is_refused():
    with pytest.raises(UnreachableFootError, match="reach"):
        LegKinematics.from_facts("hr").joints(np.array([-0.3, -0.16, -0.9]))
