"""Whole drives by a Nav2 that is a program of rclpy alone, over the installed middleware."""

import os
import threading
from contextlib import closing

import pytest
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy_client import client_of, interface
from ros_client import soon
from test_nav2_drive import GOAL, Drives

from errand_ros2.nav2 import Nav2Drive
from skills.api import Cause

DOMAIN = (os.getpid() + 1) % 200
KINDS = [("to_pose", "NavigateToPose", 0.0), ("through_poses", "NavigateThroughPoses", 2.0)]
ABORTED_BY = 206


class RclpyNav2:
    """A server of rclpy: gives feedback until the test lets the goal `end` with a code (0: success)."""

    def __init__(self, client, action, kind):
        self.kind, self.goals, self.rejects, self.cancelled, self.code = interface(kind), [], False, 0, None
        self._gone_on = threading.Event()
        self._server = ActionServer(
            client.node,
            self.kind,
            action,
            execute_callback=self._execute,
            goal_callback=lambda _: GoalResponse.REJECT if self.rejects else GoalResponse.ACCEPT,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def _execute(self, handle):
        self.goals.append(handle.request)
        while self.code is None and not handle.is_cancel_requested:
            handle.publish_feedback(self.kind.Feedback(distance_remaining=3.5))
            self._gone_on.wait(0.02)
        result = self.kind.Result()
        if handle.is_cancel_requested:
            handle.canceled()
            self.cancelled += 1
        elif self.code == 0:
            handle.succeed()
        else:
            result.error_code, result.error_msg = self.code, "occupied"
            handle.abort()
        return result

    def close(self):
        self.code = 0
        self._server.destroy()


@pytest.fixture(scope="module")
def client():
    with client_of(DOMAIN) as client:
        yield client


@pytest.fixture(params=KINDS, ids=lambda kind: kind[0])
def given(request, client):
    """The server, and a controller that leaves drives to it."""
    name, kind, through_m = request.param
    action = f"/alice/navigate_{name}"
    with closing(RclpyNav2(client, action, f"nav2_msgs/action/{kind}")) as nav2:
        yield nav2, Drives(Nav2Drive(action=action, through_m=through_m, network=f"rclpy:{DOMAIN}"))


def test_feedback_of_rclpy_is_the_way_left_and_a_halt_cancels(given):
    nav2, drives = given
    drives.until(lambda: drives.follower._trip.heard)
    assert drives.tick().remaining_m == pytest.approx(3.5)
    goal = nav2.goals[0]
    last = goal.pose if hasattr(goal, "pose") else goal.poses.goals[-1]
    assert (last.header.frame_id, last.pose.position.x) == ("map", pytest.approx(GOAL.x_m))
    drives.follower.halt()
    assert soon(lambda: nav2.cancelled == 1)


def test_an_abort_of_rclpy_has_its_cause(given):
    nav2, drives = given
    drives.until(lambda: drives.follower._trip.heard)
    nav2.code = ABORTED_BY
    failure = drives.fails()
    assert (failure.cause, failure.message) == (
        Cause.PLANNING,
        "Nav2 gave up: the goal lies in an obstacle, error 206, 'occupied'.",
    )


def test_success_of_rclpy_is_judged_by_the_robots_pose(given):
    nav2, drives = given
    drives.until(lambda: drives.follower._trip.heard)
    nav2.code = 0
    assert drives.fails().cause is Cause.POSTCONDITION


def test_a_goal_that_rclpy_rejects_is_a_failure(given):
    nav2, drives = given
    nav2.rejects = True
    assert drives.fails().cause is Cause.PLANNING
