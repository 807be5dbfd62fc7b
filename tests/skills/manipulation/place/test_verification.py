"""Tests of the release of an object on a surface, and of the check that it rests there."""

from dataclasses import replace

import numpy as np
import pytest
from table_robot import MODEL, Colours, TableRobot, context_of
from table_scene import BLUE, RED, Can
from table_scene import TABLE as TOP

from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Running
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.forces import levers_m
from skills.manipulation.place.skill import Place
from skills.robot import Gripper
from skills.routine import SkillFailure

SPOT_W = np.array([0.95, 0.0])
NOTHING = np.empty((0, 2))
CARRYING = np.array([0.0, -2.2, 2.2, 0.0, 0.6, 1.57])
SCENE = ArmScene(spot_capabilities(), MODEL, {})
P_HT = np.array([0.185, 0.0, 0.0])


def done(skill, routine):
    """Run a routine of a skill to its end."""
    for step in routine:
        assert isinstance(step, Running)
        skill.context.robot.advance(0.1)


class _Sticky(TableRobot):
    """The gripper feels an object until the jaws have moved so many times; the arm bears it until then as well."""

    moves, sticks_for, load_kg = 0, 0, 0.0

    def set_gripper(self, opening, force_n, *, until_s, lease):
        self.moves += 1
        return super().set_gripper(opening, force_n, until_s=until_s, lease=lease)

    def gripper(self):
        return Gripper(self.now_s, self.opening, 0.0, self.load_kg == 0.0 and self.moves < self.sticks_for)

    def joints(self):
        load_kg = self.load_kg if self.moves < self.sticks_for else 0.0
        efforts = SCENE.gravity_efforts(self.q_rad) + 9.81 * load_kg * levers_m(MODEL, self.q_rad, P_HT)[2]
        return replace(super().joints(), effort_nm=dict(zip(MODEL.names, efforts.tolist(), strict=True)))


def _let_go(sticks_for, load_kg=0.0):
    """The number of moves of the jaws that it takes."""
    robot = _Sticky(CARRYING, opening=0.3, sticks_for=sticks_for, load_kg=load_kg)
    skill = Place(context_of(robot))
    done(skill, skill.let_go(load_kg or None))
    return robot.moves


def test_a_hand_that_feels_nothing_lets_go_without_a_shake():
    assert _let_go(sticks_for=1) == 1


@pytest.mark.parametrize("load_kg", [0.0, 0.4])
def test_an_object_that_sticks_by_the_gripper_or_the_load_of_the_arm_is_shaken_off(load_kg):
    assert _let_go(4, load_kg) == 4


@pytest.mark.parametrize("load_kg", [0.0, 0.4])
def test_an_object_that_stays_in_the_gripper_is_reported(load_kg):
    with pytest.raises(SkillFailure, match="still in the gripper") as caught:
        _let_go(99, load_kg)
    assert caught.value.cause is Cause.POSTCONDITION


def _seen(robot, *, before_W=NOTHING, kind=None, detector=None):
    skill = Place(context_of(robot, detector=detector))
    skill.checkpoint = {"kind": kind}
    done(skill, skill.check(TOP, SPOT_W, before_W=before_W))


def test_a_neighbour_that_stood_there_before_is_not_taken_for_the_object():
    neighbour = TableRobot(things=(Can(0.95, 0.08, 0.033, 0.115, RED),))
    angles = np.linspace(0.0, 2.0 * np.pi, 60)
    rims_W = [
        [0.95, 0.08] + radius * np.column_stack([np.cos(angles), np.sin(angles)]) for radius in (0.01, 0.02, 0.033)
    ]
    _seen(neighbour)
    with pytest.raises(SkillFailure, match="not seen on the table where it was put down"):
        _seen(neighbour, before_W=np.concatenate(rims_W))


def test_a_flat_object_is_seen_by_its_class():
    flat = TableRobot(things=(Can(0.95, 0.0, 0.04, 0.004, BLUE),))
    _seen(flat, kind="beer", detector=Colours())
    for kind, before_W in (("coke", NOTHING), (None, NOTHING), ("beer", SPOT_W[None, :])):
        with pytest.raises(SkillFailure, match="not seen"):
            _seen(flat, kind=kind, before_W=before_W)
