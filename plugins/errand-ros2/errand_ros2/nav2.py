"""Planner that asks the robot's own Nav2 for a path, in place of ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from errand_ros2.messages import MAP_FRAME, pose_stamped
from errand_ros2.readings import planar_pose
from errand_ros2.wire.actions import ActionClient, GoalStatus, NoAnswerError
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from skills.api import FreeSpace, PlanningError
from skills.footprint import Footprint, footprint_clearance_m, pose_array
from skills.geometry import compose, inverse
from skills.inputs.errors import InputError
from skills.path import Path, densify
from skills.quantities import Angle, Coordinate, Duration, Length
from skills.robot import Pose2D

_ACTION: Final = "nav2_msgs/action/ComputePathToPose"


@dataclass(frozen=True)
class Nav2:
    """Paths of the robot's own Nav2, by its action `compute_path_to_pose`. Our controller follows them.

    `action` is the action's absolute name, `planner_id` the planner's name in Nav2, and `network` the domain and the
    router as for `--ros2`. `map_pose` is the pose of the robot's frame `map` in the world, x, y (m) and yaw (rad). Nav2
    must answer within `limit_s`, and its path must end within `tolerance_m` of the goal.
    """

    action: str = "/compute_path_to_pose"
    planner_id: str = ""
    network: str = ""
    map_pose: tuple[Coordinate, Coordinate, Angle] = (0.0, 0.0, 0.0)
    limit_s: Duration = 5.0
    tolerance_m: Length = 0.25

    def problem(
        self, costmap: FreeSpace, footprint: Footprint, start: Pose2D, goal: Pose2D, **_: Any
    ) -> Callable[[], Path]:
        """Returns a function that asks Nav2 and raises PlanningError; Nav2 does not know zones and speed limits."""

        return partial(self._plan, costmap, footprint, start, goal)

    def _plan(self, costmap: FreeSpace, footprint: Footprint, start: Pose2D, goal: Pose2D) -> Path:
        X_WM = Pose2D(*self.map_pose)
        poses_M = [compose(inverse(X_WM), pose).transform() for pose in (start, goal)]
        here, there = (pose_stamped(0.0, MAP_FRAME, X_MB) for X_MB in poses_M)
        asked = {"start": here, "goal": there, "use_start": True, "planner_id": self.planner_id}
        with open_session(Place.parse(self.network)) as session:
            client = ActionClient(session.node("errand_planner"), self.action, _ACTION)
            try:
                sent = client.send(asked, limit_s=self.limit_s)
            except NoAnswerError as error:
                raise PlanningError(f"no Nav2 is active on {self.action} of the stack file ({session.told})") from error
            if sent is None or not sent.ended.wait(self.limit_s):
                raise PlanningError(f"Nav2 on {self.action} does not plan within {self.limit_s:g} s")
        result = sent.result
        if sent.status is not GoalStatus.SUCCEEDED:
            why, code = (getattr(result, each, "") for each in ("error_msg", "error_code"))  # which Humble lacks
            raise PlanningError(f"Nav2 finds no path: {why[:200] or code}")
        try:
            found = [compose(X_WM, planar_pose(each.pose)) for each in result.path.poses]
        except InputError as error:
            raise PlanningError(f"Nav2's path: {error}") from error
        off_m = np.hypot(found[-1].x_m - goal.x_m, found[-1].y_m - goal.y_m) if found else np.inf
        if off_m > self.tolerance_m:
            raise PlanningError(f"Nav2's path ends {off_m:.2f} m from the goal")
        rows = pose_array([start, *found, goal])
        rows[:, 2] = np.unwrap(rows[:, 2])
        poses = densify(rows, 0.05)
        return Path(poses, footprint_clearance_m(costmap, footprint, poses))
