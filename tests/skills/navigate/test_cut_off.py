"""Closed doors are detected, named and end a drive; a person in a doorway is no closed door."""

import dataclasses
import math

import numpy as np
import pytest
from planar_robot import Bench, Box

from skills.api import Cause, Failed, Succeeded
from skills.doorway import DoorState, Doorway, SeenDoor
from skills.footprint import Footprint
from skills.navigate.cut_off import DoorOptions, DoorWatch, closed_doors_sentence
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D

LEFT = Doorway((2.45, 4.05), 0.9, math.pi / 2, ("study", "corridor"))
RIGHT = Doorway((7.45, 4.05), 0.9, math.pi / 2, ("corridor", "kitchen"))
LEFT_PANEL = Box(2.0, 4.03, 2.9, 4.07, 0.0, 2.0)
RIGHT_PANEL = Box(7.0, 4.03, 7.9, 4.07, 0.0, 2.0)
BEFORE_RIGHT, KITCHEN = Pose2D(6.8, 5.4, 0.0), Pose2D(8.5, 2.0, -1.57)


def context_of(bench, doors=(LEFT, RIGHT)):
    return dataclasses.replace(bench.context(), doors=doors)


def go(bench, goal, *, nearby_m=(), context=None, **how):
    """Runs the skill; returns the last step."""
    inputs = NavigateInputs(goal, nearby_m=nearby_m)
    return bench.run(Navigate(context or context_of(bench)), inputs, **{"limit_s": 40.0, **how})


def watch(*unmapped, start=BEFORE_RIGHT):
    bench = Bench(start, unmapped=unmapped, azimuths=900)
    bench.tick(10)
    doors = DoorWatch(context_of(bench))
    doors.look()
    return bench, doors


def test_a_door_is_closed_when_its_panel_is_seen_over_its_whole_width():
    assert watch(RIGHT_PANEL)[1].closed == (RIGHT,)
    assert watch()[1].closed == ()


def test_a_door_that_opens_is_no_longer_closed():
    bench, doors = watch(RIGHT_PANEL)
    bench.robot.blocks.remove(RIGHT_PANEL)
    bench.tick(10)
    doors.look()
    assert doors.closed == ()


@pytest.mark.parametrize("aside_m", [-0.25, 0.0, 0.25])
def test_a_person_in_a_doorway_is_no_closed_door(aside_m):
    x = 7.45 + aside_m
    assert watch(Box(x - 0.22, 3.85, x + 0.22, 4.25, 0.0, 1.7))[1].closed == ()


def test_the_memory_of_doors_outlasts_the_trip():
    bench, _ = watch(RIGHT_PANEL)
    context = context_of(bench)
    DoorWatch(context).look()
    bench.clock.advance(20.0)
    seen = context.door_memory.last_seen(RIGHT)
    assert (seen.state, bench.clock.now() - seen.seen_s) == (DoorState.CLOSED, pytest.approx(20.0, abs=0.2))
    assert context.door_memory.last_seen(LEFT) == SeenDoor(DoorState.UNKNOWN)
    assert DoorWatch(context).closed == (RIGHT,)


def test_a_door_seen_closed_long_ago_is_no_obstacle():
    bench, _ = watch(RIGHT_PANEL)
    context = context_of(bench)
    DoorWatch(context).look()
    bench.clock.advance(DoorOptions().trust_s + 1.0)
    assert DoorWatch(context).closed == ()


def test_drive_to_a_door_that_was_just_seen_closed_is_given_up_at_once():
    bench = Bench(Pose2D(4.0, 5.4, 3.14), unmapped=[RIGHT_PANEL])
    context = context_of(bench)
    context.door_memory.note(RIGHT, DoorState.CLOSED, bench.clock.now() - 20.0)
    step = go(bench, KITCHEN, context=context)
    assert step.message.startswith("The door between the corridor and the kitchen is closed")
    assert (step.final, bench.robot.pose.x_m) == (True, pytest.approx(4.0, abs=0.05))


def test_robot_goes_and_looks_at_the_only_door_though_it_remembers_it_closed():
    bench = Bench(BEFORE_RIGHT)
    context = context_of(bench)
    context.door_memory.note(RIGHT, DoorState.CLOSED, bench.clock.now() - DoorOptions().sure_s - 1.0)
    assert isinstance(go(bench, KITCHEN, context=context), Succeeded)
    assert context.door_memory.last_seen(RIGHT).state is DoorState.OPEN


def test_behind_a_closed_door_the_failure_is_final_and_names_the_door():
    bench = Bench(BEFORE_RIGHT, unmapped=[RIGHT_PANEL])
    step = go(bench, KITCHEN)
    assert isinstance(step, Failed)
    assert (step.cause, step.final) == (Cause.PLANNING, True)
    assert step.message.startswith("The door between the corridor and the kitchen is closed, so no path leads to")
    assert bench.clock.now() < 15.0


def test_robot_drives_through_a_door_that_opens_while_it_waits():
    bench = Bench(BEFORE_RIGHT, unmapped=[RIGHT_PANEL])

    def opens():
        if bench.clock.now() > 3.0 and RIGHT_PANEL in bench.robot.blocks:
            bench.robot.blocks.remove(RIGHT_PANEL)

    assert isinstance(go(bench, KITCHEN, each=opens), Succeeded)


def test_failure_is_final_when_goal_and_nearby_poses_are_enclosed():
    bench = Bench(Pose2D(5.5, 5.4, 0.0), unmapped=[Box(8.0, 4.1, 8.1, 7.0, 0.0, 1.7)])
    step = go(bench, Pose2D(9.2, 5.5, 0.0), nearby_m=((-0.5, 0.0),))
    assert isinstance(step, Failed)
    assert (step.cause, step.final) == (Cause.PLANNING, True)


def test_a_pose_nearby_that_can_be_reached_keeps_the_failure_from_being_final():
    bench = Bench(Pose2D(5.5, 5.4, 0.0), unmapped=[Box(8.9, 5.2, 9.5, 5.8, 0.0, 1.7)])
    at_goal = Pose2D(9.2, 5.5, 0.0)
    assert go(bench, at_goal).final is True
    assert go(bench, at_goal, nearby_m=((-1.2, 0.0),)).final is False


def test_one_sentence_names_all_closed_doors():
    sentence = closed_doors_sentence((LEFT, RIGHT), KITCHEN)
    assert sentence == (
        "The doors between the study and the corridor, and between the corridor and the kitchen, are closed, "
        "so no path leads to (8.50, 2.00)."
    )


def test_only_doors_that_block_every_path_are_reported():
    bench, doors = watch(LEFT_PANEL, RIGHT_PANEL, start=Pose2D(5.0, 5.7, 0.0))
    assert set(doors.closed) == {LEFT, RIGHT}
    footprint = Footprint.of(bench.robot.capabilities())
    assert doors.blocking_doors(footprint, bench.robot.pose, (KITCHEN,)) == (RIGHT,)
    assert doors.blocking_doors(footprint, bench.robot.pose, (Pose2D(9.0, 5.5, 0.0),)) == ()
    assert doors.blocking_doors(footprint, bench.robot.pose, (KITCHEN, Pose2D(9.0, 5.5, 0.0))) == ()


def test_closed_doors_on_a_path_count_though_others_may_lead_there():
    bench, doors = watch(RIGHT_PANEL)
    footprint = Footprint.of(bench.robot.capabilities())
    assert doors.doors_on_path(footprint, bench.robot.pose, (KITCHEN,)) == (RIGHT,)
    assert doors.doors_on_path(footprint, bench.robot.pose, (Pose2D(9.0, 5.5, 0.0),)) == ()


def test_clearing_within_discs_leaves_other_obstacles():
    bench, _ = watch(RIGHT_PANEL, Box(5.2, 5.2, 5.6, 5.6, 0.0, 1.7))
    before = len(bench.costmap.obstacle_cells())
    forgotten = bench.costmap.clear_obstacles(np.array([[7.45, 4.05, 0.8]]))
    assert 0 < forgotten < before
    assert len(bench.costmap.obstacle_cells()) == before - forgotten
