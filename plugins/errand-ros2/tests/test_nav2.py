"""The planner that asks a robot's own Nav2, which is a small one of the test."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port

from errand_ros2 import messages
from errand_ros2.nav2 import Nav2
from errand_ros2.wire.actions import ActionServer, GoalStatus
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from executive.testing.bench import SkillBench
from executive.tree.registry import installed_skills
from plant.robots.spot.kind import spot_capabilities
from skills.api import PlanningError, Running, Succeeded
from skills.footprint import Footprint
from skills.robot import Pose2D
from skills.stack import default_stack
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap
from skills.testing.robot import ScriptedRobot

START, GOAL = Pose2D(0.0, 0.0, 1.5), Pose2D(2.0, 0.0, -3.0)
FOOTPRINT = Footprint.of(spot_capabilities())


@contextmanager
def nav2(poses, *, error="", answers=True):
    """A Nav2 whose path has these poses (x, y, yaw) in its map; yields the planner, and the goals that came."""
    place, goals = Place(port=free_port()), []
    with open_session(place) as session, ThreadPoolExecutor(1) as pool:

        def accept(goal):
            goals.append(goal.message)
            status = GoalStatus.ABORTED if error else GoalStatus.SUCCEEDED
            result = {"path": messages.path(0.0, poses), "error_msg": error, "error_code": 208 if error else 0}
            if answers:
                pool.submit(server.end, goal, status, **result)
            return True

        node, kind = session.node("planner_server", "/alice"), "nav2_msgs/action/ComputePathToPose"
        server = ActionServer(node, "compute_path_to_pose", kind, accept=accept, cancel=lambda _: None, pool=pool)
        made = {"action": "/alice/compute_path_to_pose", "network": f"@:{place.port}"}
        yield lambda **options: Nav2(**made, **options), goals


def plan(planner):
    return planner.problem(BlockCostmap(), FOOTPRINT, START, GOAL, max_speed_m_s=0.8)()


def test_the_path_is_that_of_nav2_between_start_and_goal():
    with nav2([(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 0.0, 0.0)]) as (made, _):
        path = plan(made())
    assert (path.start, path.goal.x_m, path.goal.y_m) == (START, GOAL.x_m, GOAL.y_m)
    assert np.cos(path.goal.yaw_rad - GOAL.yaw_rad) == pytest.approx(1.0)
    assert np.max(path.poses[:, 1]) == pytest.approx(1.0, abs=0.05)
    assert np.max(np.abs(np.diff(path.poses, axis=0))) < 0.15
    assert len(path.clearance_m) == len(path.poses)


def test_nav2_plans_on_its_own_map():
    with nav2([(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)]) as (made, goals):
        path = plan(made(map_pose=(1.0, 0.0, 0.0), planner_id="GridBased"))
    assert (goals[0].start.pose.position.x, goals[0].goal.pose.position.x) == (-1.0, 1.0)
    assert (goals[0].use_start, goals[0].planner_id, goals[0].goal.header.frame_id) == (True, "GridBased", "map")
    assert path.poses[:, 0].min() == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("poses", "options", "why"),
    [
        ([], {}, "ends inf m from the goal"),
        ([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], {}, "ends 1.00 m from the goal"),
        ([(np.nan, 0.0, 0.0)], {}, "not finite"),
        ([], {"error": "the goal is occupied"}, "no path leads to the goal, error 208, 'the goal is occupied'"),
        ([], {"answers": False}, "does not plan within 0.5 s"),
    ],
)
def test_a_path_that_cannot_be_used_is_a_planning_error(poses, options, why):
    with nav2(poses, **options) as (made, _), pytest.raises(PlanningError, match=why):
        plan(made(limit_s=0.5))


def test_the_robot_drives_along_the_path_of_nav2():
    clock, seen = VirtualClock(), []
    bench = SkillBench(ScriptedRobot(clock, capabilities=spot_capabilities()), clock)
    detour = [(0.0, 0.0, 0.8), (0.5, 0.5, 0.8), (1.0, 1.0, 0.0), (1.5, 0.5, -0.8), (2.0, 0.0, -0.8)]
    with nav2(detour) as (made, goals):
        context = replace(bench.context(), stack=replace(default_stack(), planner=made()))
        skill = installed_skills()["navigate"](context)
        skill.begin(skill.Inputs(Pose2D(2.0, 0.0, 0.0)))
        while isinstance(step := skill.step(), Running) and clock.now() < 60.0:
            seen.append(bench.robot.pose)
            clock.advance(0.05)
        skill.end()
    assert isinstance(step, Succeeded)
    assert len(goals) == 1
    assert max(pose.y_m for pose in seen) == pytest.approx(1.0, abs=0.15)
    assert seen[-1].x_m == pytest.approx(2.0, abs=0.1)


def test_no_nav2_is_a_planning_error():
    with pytest.raises(PlanningError, match="no Nav2 is active on /compute_path_to_pose"):
        plan(Nav2(network=f"@:{free_port()}", limit_s=0.3))
