"""The localiser of robots of ROS 2 that localise themselves."""

from dataclasses import replace

import pytest

from errand_ros2.localiser import Ros2Pose
from skills.inputs.errors import InputError
from skills.robot import OwnLocalisation, Pose2D
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


class Localised(ScriptedRobot):
    """Robot that says where it is; `place` None while it does not know."""

    place = None

    def capabilities(self):
        return replace(super().capabilities(), localises=True)

    def own_localisation(self):
        return self.place


def test_the_robot_is_where_it_says_until_it_has_moved_away_from_there():
    robot = Localised(VirtualClock())
    localiser = Ros2Pose(map_pose=(1.0, 2.0, 0.0), max_moved=1.0).build(None, None, surely=False)
    localiser.update(robot)
    assert not localiser.estimate().localised
    robot.place = OwnLocalisation(0.0, Pose2D(3.0, 0.0, 0.0))
    localiser.update(robot)
    assert localiser.estimate().localised
    assert localiser.estimate().X_WO.translation()[:2] == pytest.approx([4.0, 2.0])
    robot.odometry_pose = Pose2D(1.5, 0.0, 0.0)
    localiser.update(robot)
    assert not localiser.estimate().localised
    robot.place = OwnLocalisation(1.0, Pose2D(3.1, 0.0, 0.0))
    localiser.update(robot)
    assert localiser.estimate().localised


def test_a_robot_without_a_localisation_of_its_own_is_one_error():
    with pytest.raises(InputError, match="does not localise itself"):
        Ros2Pose().build(None, None, surely=False).update(ScriptedRobot(VirtualClock()))
