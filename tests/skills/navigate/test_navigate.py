import math
from types import SimpleNamespace

import numpy as np
import pytest
from planar_robot import Bench, Box, NamingWorker

from skills.api import Cause, Failed, Running, Succeeded
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import BaseKind, Pose2D

START, CORRIDOR, OTHER_ROOM = Pose2D(1.5, 2.0, 0.0), Pose2D(1.2, 5.5, math.pi), Pose2D(8.5, 2.0, -1.57)
ALONG, END = Pose2D(2.8, 5.3, 0.0), Pose2D(6.6, 5.4, 0.0)
"""A drive along the corridor, for all that needs no door."""


def go(bench, goal, *, options=None, **how):
    """Runs the skill; returns the last step and all before."""
    skill, steps = Navigate(bench.context(), options), []
    step = skill.step
    skill.step = lambda: steps.append(step()) or steps[-1]
    return bench.run(skill, NavigateInputs(goal), **how), steps


def begun(bench, goal, ticks=0):
    """The skill after some ticks on the way to a goal."""
    skill = Navigate(bench.context())
    skill.begin(NavigateInputs(goal))
    for _ in range(ticks):
        assert isinstance(skill.step(), Running)
        bench.tick()
    return skill


def arrives(bench, goal, clearance_m=0.03, **how):
    """Drives, and asserts that the robot gets there without touching anything."""
    step, _ = go(bench, goal, **how)
    assert isinstance(step, Succeeded), step.message
    assert bench.robot.least_clearance_m > clearance_m


def off_goal(bench, goal):
    pose = bench.robot.pose
    turn = math.remainder(pose.yaw_rad - goal.yaw_rad, 2.0 * math.pi)
    return math.hypot(pose.x_m - goal.x_m, pose.y_m - goal.y_m), abs(turn)


@pytest.fixture(scope="module")
def two_doors():
    """A drive from one room to the other."""
    bench = Bench(START)
    return bench, *go(bench, OTHER_ROOM)


def test_goes_through_two_doors_without_touching_and_stands_at_the_goal(two_doors):
    bench, step, _ = two_doors
    assert isinstance(step, Succeeded), step.message
    distance_m, yaw_rad = off_goal(bench, OTHER_ROOM)
    assert distance_m < 0.10 and yaw_rad < 0.10
    assert np.abs(bench.robot.velocity).max() < 0.05
    assert bench.robot.least_clearance_m > 0.06
    assert not bench.robot.driving


def test_a_base_that_cannot_go_sideways_gets_there_by_the_same_skill():
    bench = Bench(END, base_kind=BaseKind.DIFFERENTIAL)
    arrives(bench, OTHER_ROOM, 0.04)
    distance_m, yaw_rad = off_goal(bench, OTHER_ROOM)
    assert distance_m < 0.10 and yaw_rad < 0.10


def test_drive_takes_about_the_time_of_its_path(two_doors):
    bench, _, _ = two_doors
    assert bench.clock.now() < 25.0


def test_progress_grows_and_sentences_are_plain(two_doors):
    _, _, steps = two_doors
    running = [step for step in steps if isinstance(step, Running)]
    progress = [step.progress for step in running if step.progress is not None]
    assert progress[-1] == pytest.approx(1.0)
    assert np.diff(progress).min() > -0.05
    assert all(step.message for step in running)


def test_speed_stays_below_what_is_asked():
    bench, speeds = Bench(ALONG), []
    note = lambda: speeds.append(float(np.hypot(*bench.robot.velocity[:2])))  # noqa: E731
    bench.run(Navigate(bench.context()), NavigateInputs(END, max_speed_m_s=0.4), each=note, limit_s=6.0)
    assert bench.robot.travelled_m > 1.5
    assert 0.3 < max(speeds) < 0.45


def test_robot_drives_around_an_obstacle_that_the_lidar_sees():
    bench = Bench(ALONG, unmapped=[Box(4.5, 5.0, 4.9, 5.4, 0.0, 1.7)])
    arrives(bench, END)
    assert bench.worker.names.count("plan a path") >= 2


@pytest.mark.parametrize("cameras", [True, False])
def test_robot_drives_around_an_obstacle_too_low_for_the_lidar_with_cameras_only(cameras):
    bench = Bench(ALONG, unmapped=[Box(4.5, 4.87, 4.9, 5.8, 0.0, 0.2)], cameras=cameras)
    step, _ = go(bench, END)
    assert (bench.robot.least_clearance_m > 0.0) is cameras
    assert (bench.robot.images_taken > 10) is cameras
    assert isinstance(step, Succeeded) or not cameras, step.message


def test_waits_for_a_person_who_walks_out_of_the_door():
    person = Box(7.2, 3.9, 7.7, 4.3, 0.0, 1.7)
    bench = Bench(END, unmapped=[person])

    def walk_away():
        if bench.clock.now() > 7.0 and person in bench.robot.blocks:
            bench.robot.blocks.remove(person)

    arrives(bench, OTHER_ROOM, each=walk_away)
    assert bench.clock.now() > 8.0


def test_a_door_that_stays_closed_is_a_planning_failure_with_its_position():
    bench = Bench(END, unmapped=[Box(7.0, 4.0, 7.9, 4.1, 0.0, 2.0)])
    step, _ = go(bench, OTHER_ROOM)
    assert isinstance(step, Failed)
    assert step.cause is Cause.PLANNING
    assert "blocked by an obstacle at (7." in step.message
    assert bench.robot.least_clearance_m > 0.03


def test_goal_in_furniture_is_a_planning_failure():
    step, _ = go(Bench(START), Pose2D(1.0, 0.7, 0.0))
    assert isinstance(step, Failed) and step.cause is Cause.PLANNING
    assert "blocked" in step.message


def test_cancel_on_the_way_stops_the_robot():
    bench = Bench(START)
    skill = begun(bench, OTHER_ROOM, ticks=80)
    assert bench.robot.driving and bench.robot.velocity[0] > 0.3
    skill.end()
    skill.end()
    assert not bench.robot.driving
    bench.tick(20)
    assert np.abs(bench.robot.velocity).max() < 0.01


def test_end_leaves_the_commands_of_others_alone():
    bench = Bench(START)
    skill = begun(bench, OTHER_ROOM, ticks=40)
    other = bench.robot.drive(0.1, 0.0, 0.0, until_s=bench.clock.now() + 1.0, lease=bench.lease)
    skill.end()
    assert bench.robot.command_status(other).state.value == "running"


def test_begun_again_it_goes_to_the_new_goal():
    bench = Bench(START)
    assert isinstance(bench.run(begun(bench, OTHER_ROOM, ticks=60), NavigateInputs(CORRIDOR)), Succeeded)
    assert off_goal(bench, CORRIDOR)[0] < 0.1


def test_pushed_off_its_path_it_still_arrives():
    bench = Bench(ALONG)
    pushed = []

    def push():
        if bench.robot.travelled_m > 1.5 and not pushed:
            pushed.append(True)
            bench.robot.push(0.0, 0.45, 0.5)

    arrives(bench, END, each=push)
    assert pushed


def test_refused_from_the_start_is_a_failed_precondition():
    bench = Bench(START)
    bench.robot.refuse_because["drive"] = "motors off"
    step, _ = go(bench, CORRIDOR)
    assert isinstance(step, Failed) and step.cause is Cause.PRECONDITION
    assert "motors off" in step.message


def test_a_robot_that_is_not_localised_fails_the_precondition():
    places = np.random.default_rng(5).uniform(20.0, 26.0, (60, 2))
    pillars = [Box(x, y, x + 0.15, y + 0.15) for x, y in places if math.hypot(x - 23.0, y - 23.0) > 1.0]
    bench = Bench(Pose2D(23.0, 23.0, 0.3), unmapped=pillars, believed_start=START)
    step, _ = go(bench, CORRIDOR)
    assert isinstance(step, Failed) and step.cause is Cause.PRECONDITION
    assert bench.robot.travelled_m == 0.0


def test_a_lease_taken_while_driving_is_an_execution_failure():
    bench = Bench(START)

    def take():
        if bench.clock.now() > 4.0 and bench.robot.lease_holder() == bench.lease:
            bench.robot.take_lease("somebody")

    step, _ = go(bench, CORRIDOR, each=take)
    assert isinstance(step, Failed) and step.cause is Cause.EXECUTION
    assert "lease" in step.message


def test_a_robot_held_in_place_fails_with_a_reason():
    bench = Bench(START)

    def hold():
        if bench.robot.travelled_m > 1.0:
            bench.robot.velocity = np.zeros(3)
            bench.robot.pose = held.setdefault("pose", bench.robot.pose)

    held: dict[str, Pose2D] = {}
    step, _ = go(bench, OTHER_ROOM, each=hold)
    assert isinstance(step, Failed) and step.message
    assert step.cause in (Cause.EXECUTION, Cause.PLANNING)  # odometry goes on, so the costmap gets ghosts


def test_planned_path_is_published_with_the_robots_name(two_doors):
    bench, _, _ = two_doors
    topic, message = bench.published[0]
    assert topic == "path" and message["robot"] == "alice"
    assert message["poses"][0][:2] == pytest.approx([START.x_m, START.y_m], abs=0.05)


class WaitingWorker(NamingWorker):
    """Does work before `submit` comes back."""

    def submit(self, work, *, latency_s, name):
        job = super().submit(work, latency_s=latency_s, name=name)
        job.withdraw()
        return job


def test_equal_seeds_give_equal_drives_with_work_inline_or_in_a_thread():
    drives = []
    for worker in (NamingWorker, WaitingWorker):
        bench, poses = Bench(ALONG, unmapped=[Box(4.5, 5.4, 4.7, 5.6)]), []
        bench.worker = worker(bench.clock)
        go(bench, END, each=lambda bench=bench, poses=poses: poses.append(str(bench.robot.pose)))
        drives.append((poses, bench.worker.names))
        bench.worker.close()
    assert len(drives[0][0]) > 50
    assert drives[0] == drives[1]


@pytest.mark.parametrize(("obstacle_W", "where"), [(None, "ahead"), ((1.0, 2.0), "at (1.00, 2.00)")])
def test_a_robot_says_for_which_path_it_waits(obstacle_W, where):
    waits = SimpleNamespace(_planning=SimpleNamespace(obstacle_W=obstacle_W))
    assert Navigate._waiting_sentence(waits) == f"waiting for the path {where} to become free"
