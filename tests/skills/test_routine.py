"""Tests of routines: commands that end stops, and failures."""

import numpy as np
import pytest
from table_robot import TableRobot, context_of

from skills.api import Cause, Failed, PlanningError, Running, Succeeded
from skills.robot import ArmTrajectory, CommandCause
from skills.routine import CommandFailure, RoutineSkill, SkillFailure

TRAJECTORY = ArmTrajectory(np.array([0.5]), np.array([[0.1, -3.0, 3.0, 0.0, 0.0, 0.0]]))


class _Moves(RoutineSkill[None]):
    name = "moves"
    Inputs = type(None)

    def run(self, inputs):
        yield from self.follow(TRAJECTORY, "moving")
        return Succeeded("moved")


class _Plans(RoutineSkill[None]):
    name = "plans"
    Inputs = type(None)

    def run(self, inputs):
        yield from self.compute(_no_way, latency_s=0.2, name="plan", message="planning")
        return Succeeded("planned")


class _Nests(RoutineSkill[None]):
    name = "nests"
    Inputs = type(None)

    def run(self, inputs):
        try:
            yield from self.perform(_Plans(self.context), None)
        except SkillFailure as failure:
            assert failure.cause is Cause.PLANNING
        return (yield from self.perform(_Moves(self.context), None))


def _no_way():
    raise PlanningError("no way")


def test_end_stops_only_the_skills_own_running_command():
    robot = TableRobot()
    skill = _Moves(context_of(robot))
    robot.stand(0.55, 0.0, until_s=9.0, lease=robot.lease_holder())
    skill.begin(None)
    skill.step()
    assert robot.moving_parts == ("stand", "move_arm")
    for _ in range(2):
        skill.end()
        assert (robot.moving_parts, robot.calls.count("stop")) == (("stand",), 1)


def test_a_command_that_is_done_is_not_stopped():
    robot = TableRobot()
    skill = _Moves(context_of(robot))
    skill.begin(None)
    skill.step()
    robot.advance(0.1)
    assert skill.step() == Succeeded("moved")
    skill.end()
    assert "stop" not in robot.calls


def test_a_planning_error_is_a_failure_with_cause_planning_after_the_latency():
    robot = TableRobot()
    skill = _Plans(context_of(robot))
    skill.begin(None)
    assert isinstance(skill.step(), Running)
    robot.advance(0.2)
    assert skill.step() == Failed(Cause.PLANNING, "no way")


def test_a_step_before_begin_is_a_defect():
    with pytest.raises(RuntimeError, match="step before begin"):
        _Moves(context_of(TableRobot())).step()


def test_a_skill_within_a_skill_passes_on_its_outcome_and_is_ended():
    robot = TableRobot()
    skill = _Nests(context_of(robot))
    skill.begin(None)
    while isinstance(step := skill.step(), Running):
        robot.advance(0.1)
    assert step == Succeeded("moved")


def test_ending_the_outer_skill_stops_the_inner_ones_command():
    robot = TableRobot()
    skill = _Nests(context_of(robot))
    skill.begin(None)
    for _ in range(4):
        skill.step()
        if robot.arm_commands:
            break
        robot.advance(0.1)
    skill.end()
    assert robot.calls.count("stop") == 1


@pytest.mark.parametrize(("lost", "attempts"), [(1, 2), (9, 2)])
def test_a_command_without_the_lease_is_given_again_once(lost, attempts):
    robot, made = TableRobot(), []

    def attempt():
        made.append(robot.now_s)
        if len(made) <= lost:
            raise CommandFailure("the arm was refused", CommandCause.NO_LEASE)
        return "done"
        yield

    routine, ended = _Moves(context_of(robot)).persist(attempt, "moving"), None
    while ended is None:
        try:
            assert isinstance(next(routine), Running)  # here a run suspends the skill
            robot.advance(0.1)
        except (StopIteration, CommandFailure) as end:
            ended = end
    assert len(made) == attempts
    assert made[-1] > made[0]
    assert isinstance(ended, StopIteration if lost < attempts else CommandFailure)
