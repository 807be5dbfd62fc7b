"""The localiser of robots that localise themselves."""

import math
from dataclasses import replace

import pytest

from errand_spot.localiser import GraphNav
from skills.inputs.errors import InputError
from skills.robot import OwnLocalisation, Pose2D
from skills.stack import stack_of
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


class Localised(ScriptedRobot):
    """Robot that says where it is; `place` None while it does not know."""

    place = None

    def capabilities(self):
        return replace(super().capabilities(), localises=True)

    def own_localisation(self):
        return self.place


def test_the_robot_is_where_it_says_in_the_frame_of_the_world():
    robot, localiser = (
        Localised(VirtualClock()),
        GraphNav(seed_pose=(1.0, 2.0, math.pi / 2)).build(None, None, surely=False),
    )
    robot.place = OwnLocalisation(0.0, Pose2D(3.0, 0.0, 0.0))
    localiser.update(robot)
    estimate = localiser.estimate()
    assert estimate.localised and estimate.health == 1.0
    assert estimate.X_WO.translation()[:2] == pytest.approx([1.0, 5.0])
    assert estimate.covariance[0, 0] == pytest.approx(0.05**2)


def test_a_robot_that_is_lost_or_silent_is_not_localised_and_stays_where_it_was():
    clock = VirtualClock()
    robot, localiser = Localised(clock), GraphNav().build(None, None, surely=False)
    assert not localiser.estimate().localised
    robot.place = OwnLocalisation(0.0, Pose2D(3.0, 0.0, 0.0))
    localiser.update(robot)
    clock.advance(1.5)
    localiser.update(robot)
    assert not localiser.estimate().localised
    robot.place = OwnLocalisation(1.5, Pose2D(4.0, 0.0, 0.0))
    localiser.update(robot)
    assert localiser.estimate().localised
    robot.place = None
    localiser.update(robot)
    assert not localiser.estimate().localised
    assert localiser.estimate().X_WO.translation()[0] == pytest.approx(4.0)


def test_a_robot_without_a_localisation_of_its_own_is_one_error():
    localiser = stack_of({"localiser": {"use": "graph_nav"}}).localiser.build(None, None, surely=False)
    with pytest.raises(InputError, match="has no GraphNav"):
        localiser.update(ScriptedRobot(VirtualClock()))
