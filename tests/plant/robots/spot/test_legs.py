import numpy as np
import pytest

from plant.robots.spot.description import LEGS
from plant.robots.spot.legs import LegKinematics, UnreachableFootError


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("joints", [(0.0, 0.85, -1.58), (0.3, 0.2, -0.6), (-0.4, 1.4, -2.3)])
def test_inverse_gives_back_the_joints(leg, joints):
    legs = LegKinematics.from_facts(leg)
    np.testing.assert_allclose(legs.joints(legs.foot(*joints)), joints, atol=1e-9)


def test_feet_stand_about_half_a_metre_under_the_body_when_standing():
    foot = LegKinematics.from_facts("fl").foot(0.0, 0.85, -1.58)
    # sole = centre - radius 0.036; the body origin stands at 0.52
    assert foot[2] - 0.036 == pytest.approx(-0.52, abs=0.02)


def test_a_foot_out_of_reach_is_refused():
    with pytest.raises(UnreachableFootError, match="reach"):
        LegKinematics.from_facts("hr").joints(np.array([-0.3, -0.16, -0.9]))
