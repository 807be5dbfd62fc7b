"""A Nav2 whose behaviour a test scripts: it takes goals of whole drives, and drives straight to them."""

import math
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import yaml
from ros_client import free_port, soon
from ros_lock_step import LockStep

from errand_ros2 import messages
from errand_ros2.readings import planar_pose
from errand_ros2.server import PERIOD_S
from errand_ros2.wire.actions import ActionServer, GoalStatus
from errand_ros2.wire.node import Place
from executive.app.prepare.from_request import prepare
from executive.run.control import Control
from executive.run.visitor import RunVisitor
from skills.geometry import compose, wrap
from tests.benchmarks.served_missions import run_served

TO_POSE, THROUGH = "navigate_to_pose", "navigate_through_poses"
KINDS = {TO_POSE: "nav2_msgs/action/NavigateToPose", THROUGH: "nav2_msgs/action/NavigateThroughPoses"}
SPEED_M_S, TURN_RAD_S, NEAR_M, NEAR_RAD = 0.5, 1.0, 0.25, 0.25
FAST_M_S, STILL_M_S, PAUSED_TICKS = 0.4, 0.05, 40
"""Speeds, and the tolerances within which Nav2 by default counts a goal as reached."""


class ScriptedNav2:
    """Serves one action below a namespace. The test calls `step` at each tick with the pose of the base on Nav2's map.

    `rejects`, `is_deaf` to goals, `dies` after acceptance (neither feedback nor result), aborts with the code `fails`
    and what it `says`, `lies` that it has arrived. `poses` are those of the last goal; `told` counts feedback messages,
    `cancelled` goals; `limits_m_s` are the speed limits that it was told.
    """

    def __init__(self, session, action=TO_POSE, space="/alice"):
        self.rejects, self.is_deaf, self.dies, self.fails, self.says, self.lies = False, False, False, 0, "", False
        self._ended = threading.Event()
        self.goals, self.poses, self.told, self.cancelled = [], [], 0, 0
        self._goal, self._left, self._pool = None, [], ThreadPoolExecutor(2)
        self.name, node = f"{space}/{action}", session.node("bt_navigator", space)
        self.limits_m_s = []
        node.subscribe("speed_limit", "nav2_msgs/msg/SpeedLimit", lambda told: self.limits_m_s.append(told.speed_limit))
        self._server = ActionServer(
            node, action, KINDS[action], accept=self._accept, cancel=self._cancel, pool=self._pool
        )

    def _accept(self, goal):
        if self.is_deaf:
            self._ended.wait()
        if self.rejects or self.is_deaf:
            return False
        message = goal.message
        stamped = [message.pose] if hasattr(message, "pose") else message.poses.goals
        self.poses = [planar_pose(each.pose) for each in stamped]
        self._left = [*self.poses]
        self._goal = goal
        self.goals.append(goal)
        return True

    def _cancel(self, goal):
        self.cancelled += 1
        self._goal = None
        self._server.end(goal, GoalStatus.CANCELED)

    def cancel(self):
        """Cancels the goal as another program does."""
        self._cancel(self._goal)

    @property
    def drives(self):
        return self._goal is not None

    def step(self, pose):
        """Returns the velocity (vx, wz) of the base; gives feedback, or ends the goal."""
        if self._goal is None or self.dies:
            return 0.0, 0.0
        if self.fails or self.lies:
            goal, self._goal = self._goal, None
            status = GoalStatus.SUCCEEDED if self.lies else GoalStatus.ABORTED
            self._server.end(goal, status, error_code=self.fails, error_msg=self.says)
            return 0.0, 0.0
        to = self._left[0]
        off_m = math.hypot(to.x_m - pose.x_m, to.y_m - pose.y_m)
        turn = wrap((to.yaw_rad if off_m < NEAR_M else math.atan2(to.y_m - pose.y_m, to.x_m - pose.x_m)) - pose.yaw_rad)
        if off_m < NEAR_M and (len(self._left) > 1 or abs(turn) < NEAR_RAD):
            self._left.pop(0)
        if not self._left:
            goal, self._goal = self._goal, None
            self._server.end(goal, GoalStatus.SUCCEEDED)
            return 0.0, 0.0
        self.told += 1
        more = {"number_of_poses_remaining": len(self._left)} if len(self.poses) > 1 else {}
        here = messages.pose_stamped(0.0, "map", pose.transform())
        self._server.tell(self._goal, current_pose=here, distance_remaining=off_m, **more)
        wz = max(-TURN_RAD_S, min(TURN_RAD_S, 2.0 * turn))
        return (SPEED_M_S if off_m >= NEAR_M and abs(turn) < 0.3 else 0.0), wz

    def close(self):
        self._ended.set()
        self._pool.shutdown()


class DrivenByNav2(RunVisitor):
    """Moves a served robot by `cmd_vel` while Nav2 has a goal, and pauses it so often for two seconds while it is fast.

    Nav2 localises the robot by odometry from `start`. `stands_after_s` are times from a pause until the base stands.
    """

    def __init__(self, step, nav2, start, control, pauses):
        self.step, self.nav2, self.start, self._control, self._pauses = step, nav2, start, control, pauses
        self._velocity = step.node.publisher("/alice/cmd_vel", "geometry_msgs/msg/Twist")
        self.driven, self.stands_after_s, self._ticks = 0, [], None

    def tick(self, progress):
        if self._ticks == 0:
            assert soon(lambda: not self.nav2.drives)  # which takes milliseconds: no step of a robot's clock
        odometry = self.step.served.odometry()
        if self.nav2.drives:
            self.driven += 1
            vx, wz = self.nav2.step(compose(self.start, odometry.pose))
            self._velocity.put(messages.twist((vx, 0.0, wz)))
        speed = math.hypot(*odometry.velocity[:2])
        if self._ticks is None and speed > FAST_M_S and len(self.stands_after_s) < self._pauses:
            self._ticks = -1
            self.stands_after_s.append(math.inf)
            self._control.pause(robot="Alice")
        elif self._ticks is not None:
            self._ticks += 1
            if speed >= STILL_M_S:
                self.stands_after_s[-1] = math.inf
            elif self.stands_after_s[-1] == math.inf:
                self.stands_after_s[-1] = round(self._ticks * PERIOD_S, 3)
            if self._ticks == PAUSED_TICKS:
                self._ticks = None
                self._control.resume(robot="Alice")


def by_nav2(request, out, action, through_m=0.0, pauses=0, pace=None):
    """Runs a request whose drives go by a scripted Nav2; returns how it ended, and what moved the robot."""
    place, made = Place(port=free_port()), []
    options = {"use": "nav2", "action": f"/alice/{action}", "through_m": through_m, "network": f"zenoh:@:{place.port}"}
    (stack := out / "nav2.yaml").write_text(yaml.safe_dump({"controller": options}))
    request, control = replace(request, stack=stack, record=False, out=out / "out"), Control(pace=pace)
    start = prepare(request).world.start

    def driven(step):
        made.append(DrivenByNav2(step, ScriptedNav2(step.node.session, action), start, control, pauses))
        return {"visitors": made, "control": control}

    return run_served(request, lambda build: LockStep(build, place), driven), made[0]
