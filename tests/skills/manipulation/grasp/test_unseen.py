"""Tests of the look into space that no picture has shown."""

import numpy as np
import pytest
from table_robot import MODEL, TableRobot, context_of

from skills.api import ObjectKind, ObjectObservation, Succeeded
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.grasp.reach import level_viewpoints, look_into_unseen

SEEN = ObjectObservation(0.0, ObjectKind("coke"), (0.9, 0.0, 0.76), (0.066, 0.066, 0.115), 0.0, 1.0, "shelf")
ABOVE_IT = np.tile([0.85, 0.0, 1.0], (5, 1))


class Looking(LookingSkill):
    """Looks where the arm would go, once or more."""

    name = "looking"

    def run(self, inputs):
        self.looked = []
        for arm_W in inputs:
            self.looked.append((yield from look_into_unseen(self, SEEN, arm_W)))
        return Succeeded("looked")


def _looked(*places_W):
    robot = TableRobot()
    skill = Looking(context_of(robot))
    skill.begin(places_W)
    while not isinstance(skill.step(), Succeeded):
        robot.advance(0.05)
    return skill.looked


def test_space_above_an_object_that_no_picture_shows_is_looked_into_once():
    assert _looked(ABOVE_IT, ABOVE_IT) == [True, False]


def test_the_camera_looks_from_about_the_height_of_the_space():
    p_BT = np.array([0.9, 0.1, 0.5])
    places = level_viewpoints(MODEL, p_BT)
    assert places
    assert all(abs(place[2] - p_BT[2]) <= 0.31 and np.linalg.norm(place - p_BT) > 0.4 for place in places)


# where the arm would be -> nothing is to be seen there, or nothing of it from here
@pytest.mark.parametrize("arm_W", [ABOVE_IT[:1], ABOVE_IT + [0.0, 1.0, 0.0], np.empty((0, 3))])
def test_the_camera_does_not_look_where_the_arm_stays_away_from_the_object(arm_W):
    assert _looked(arm_W) == [False]
