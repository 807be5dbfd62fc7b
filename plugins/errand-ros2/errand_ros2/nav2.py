"""Planner and controller that leave paths, and whole drives, to the robot's own Nav2."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path as File
from typing import Any, Final

import numpy as np

from errand_ros2.messages import MAP_FRAME, Fields, pose_stamped
from errand_ros2.readings import planar_pose
from errand_ros2.wire.actions import ActionClient, GoalStatus, SentGoal
from errand_ros2.wire.node import Place, Publisher
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import ros_types
from skills.api import Cause, FreeSpace, PlanningError
from skills.footprint import Footprint, footprint_clearance_m, pose_array
from skills.geometry import compose, inverse
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import read_yaml
from skills.navigate.follower import FollowerOptions, PathFollower
from skills.path import Drive, Path, densify, progress_m
from skills.quantities import Angle, Coordinate, Duration, Length, Margin
from skills.robot import BaseKind, FloatArray, Pose2D
from skills.routine import SkillFailure

_PLAN: Final = "nav2_msgs/action/ComputePathToPose"
_TO_POSE, _THROUGH = (f"nav2_msgs/action/{each}" for each in ("NavigateToPose", "NavigateThroughPoses"))
_LIMIT, _STEP_M = "nav2_msgs/msg/SpeedLimit", 0.05


@cache
def _meanings() -> Mapping[int, tuple[Cause, str]]:
    """Returns causes and words of Nav2's error codes."""
    table = read_yaml(File(__file__).with_name("nav2_errors.yaml")).data.items()
    return {code: (Cause[cause], words) for cause, rows in table for words, codes in rows.items() for code in codes}


def failure_of(result: Any) -> tuple[Cause, str]:
    """Returns the cause of a failure, and its words, by the error code and the message of a result."""
    code, said = getattr(result, "error_code", 0), getattr(result, "error_msg", "")
    cause, words = _meanings().get(code, (Cause.EXECUTION, "it does not say why" if not said else ""))
    return cause, ", ".join(filter(None, [words, f"error {code}" if code else "", f"'{said[:200]}'" if said else ""]))


def _in_map(map_pose: Sequence[float], pose: Pose2D) -> Fields:
    """Message of a pose in the robot's frame `map`."""
    return pose_stamped(0.0, MAP_FRAME, compose(inverse(Pose2D(*map_pose)), pose).transform())


def _path(rows: FloatArray, costmap: FreeSpace, footprint: Footprint) -> Path:
    rows[:, 2] = np.unwrap(rows[:, 2])
    poses = densify(rows, _STEP_M)
    return Path(poses, footprint_clearance_m(costmap, footprint, poses))


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
        X_WM, here, there = Pose2D(*self.map_pose), *(_in_map(self.map_pose, pose) for pose in (start, goal))
        asked = {"start": here, "goal": there, "use_start": True, "planner_id": self.planner_id}
        with open_session(Place.parse(self.network)) as session:
            client = ActionClient(session.node("errand_planner"), self.action, _PLAN)
            try:
                sent = client.send(asked, limit_s=self.limit_s)
            except TimeoutError as error:
                raise PlanningError(f"no Nav2 is active on {self.action} of the stack file ({session.told})") from error
            if sent is None or not sent.ended.wait(self.limit_s):
                raise PlanningError(f"Nav2 on {self.action} does not plan within {self.limit_s:g} s")
        result = sent.result
        if sent.status is not GoalStatus.SUCCEEDED:
            raise PlanningError(f"Nav2 finds no path: {failure_of(result)[1]}")
        try:
            found = [compose(X_WM, planar_pose(each.pose)) for each in result.path.poses]
        except InputError as error:
            raise PlanningError(f"Nav2's path: {error}") from error
        off_m = np.hypot(found[-1].x_m - goal.x_m, found[-1].y_m - goal.y_m) if found else np.inf
        if off_m > self.tolerance_m:
            raise PlanningError(f"Nav2's path ends {off_m:.2f} m from the goal")
        return _path(pose_array([start, *found, goal]), costmap, footprint)


@dataclass(frozen=True)
class Nav2Drive(FollowerOptions):
    """Whole drives by the robot's own Nav2: its action `navigate_to_pose` gets the goal of each path.

    With `through_m`, poses of the path so far apart (m) go to its action `navigate_through_poses`. Its topic
    `speed_limit` gets what zones, people and the mission allow below `max_speed_m_s`, Nav2's own. `action` is the
    action's absolute name, `behavior_tree` that of Nav2's file; `network` and `map_pose` as for the planner `nav2`.
    Nav2 must accept a goal within `limit_s` (of the wall clock), and send feedback each `silent_s` (of the robot's).
    Within `near_m` of the goal Errand drives by the options of `path_follower`: Nav2 stops less exactly.
    """

    action: str = "/navigate_to_pose"
    through_m: Margin = 0.0
    behavior_tree: str = ""
    network: str = ""
    map_pose: tuple[Coordinate, Coordinate, Angle] = (0.0, 0.0, 0.0)
    limit_s: Duration = 5.0
    silent_s: Duration = 5.0
    near_m: Length = 0.5

    def build(self, path: Path, footprint: Footprint, *, max_speed_m_s: float) -> PathFollower:
        """Creates what drives along one path: Nav2, or Errand itself along a short one."""
        own = super().build(path, footprint, max_speed_m_s=max_speed_m_s)
        is_near = math.hypot(*(path.poses[-1] - path.poses[0])[:2]) <= self.near_m
        return own if is_near else Nav2Follower(path, footprint, self)


class _Trip:
    """Goal of Nav2 in a thread of its own, since a tick waits for nobody. Set `over` to cancel it, or once it ended."""

    def __init__(self, options: Nav2Drive, poses: Sequence[Fields]) -> None:
        self.left_m, self.heard, self.over = 0.0, 0, threading.Event()  # distance by the last of the messages heard
        self.sent: SentGoal | None = None
        self.failure: SkillFailure | None = None
        self._limit: Publisher | None = None
        threading.Thread(target=self._pursue, args=(options, poses), daemon=True).start()

    def _pursue(self, options: Nav2Drive, poses: Sequence[Fields]) -> None:
        """Sends the goal, and cancels it when the trip is over before the goal has ended."""
        kind, told = _THROUGH if options.through_m else _TO_POSE, ""
        try:
            with open_session(Place.parse(options.network)) as session:
                node, told = session.node("errand_drive"), f" ({session.told})"
                node.subscribe(f"{options.action}/_action/feedback", f"{kind}_FeedbackMessage", self._hear)
                self._limit = node.publisher(f"{options.action.rpartition('/')[0]}/speed_limit", _LIMIT)
                client = ActionClient(node, options.action, kind)
                if (sent := _sent(client, options, poses)) is None:
                    self.failure = SkillFailure(Cause.PLANNING, f"Nav2 rejects the goal on {options.action}.")
                    return
                self.sent = sent
                self.over.wait()
                self.limit_to(math.inf)
                if not sent.ended.is_set():
                    client.cancel(sent)
                    sent.ended.wait(options.limit_s)
        except Exception as error:  # of the wire, too
            what = f"There is no drive by Nav2 on {options.action}{told}: {error}."
            self.failure = SkillFailure(Cause.PRECONDITION, what, final=True)

    def limit_to(self, most_m_s: float) -> None:
        """Tells Nav2 a speed limit, once it pursues the goal; infinity lifts it."""
        if self._limit is not None and self.sent is not None:
            self._limit.put({"speed_limit": most_m_s if most_m_s < math.inf else 0.0})

    def _hear(self, message: Any) -> None:
        if self.sent is not None and bytes(message.goal_id.uuid) == bytes(self.sent.identity["uuid"]):
            left_m, self.heard = float(message.feedback.distance_remaining), self.heard + 1
            self.left_m = left_m if math.isfinite(left_m) else self.left_m


def _sent(client: ActionClient, options: Nav2Drive, poses: Sequence[Fields]) -> SentGoal | None:
    """Sends the poses, or the last of them, as a goal; None when Nav2 rejects it. Raises TimeoutError."""
    tree = {"behavior_tree": options.behavior_tree}
    if not options.through_m:
        return client.send({"pose": poses[-1], **tree}, limit_s=options.limit_s)
    try:
        goals = ros_types().make("nav_msgs/msg/Goals", goals=poses)
        return client.send({"poses": goals, **tree}, limit_s=options.limit_s)
    except TypeError:  # before Kilted they are a list
        return client.send({"poses": poses, **tree}, limit_s=options.limit_s)


class Nav2Follower(PathFollower):
    """Leaves a path to Nav2; drives the last part itself, where Nav2 says that it has arrived."""

    def __init__(self, path: Path, footprint: Footprint, options: Nav2Drive) -> None:
        super().__init__(path, footprint, options)
        self._by, self._arrived = options, False
        step_m = options.through_m or math.inf
        along = step_m * np.arange(1.0, self.length_m / step_m)
        rows = [*path.poses[np.searchsorted(progress_m(path.poses), along)], path.poses[-1]]
        self._poses = [_in_map(options.map_pose, Pose2D(*row.tolist())) for row in rows]
        self._trip: _Trip | None = None
        self._heard, self._silent_s, self._left_m = 0, 0.0, 0.0

    def command(
        self,
        pose: Pose2D,
        velocity: tuple[float, float, float],
        last: FloatArray,
        costmap: FreeSpace,
        most_m_s: float = math.inf,
    ) -> Drive:
        """Sends Nav2 its goal, and again after a halt; at a speed of 0 the robot stands. Raises SkillFailure."""
        own = super().command(pose, velocity, last, costmap, most_m_s)
        if self._arrived:
            return own
        stands = Drive((0.0, 0.0, 0.0), own.remaining_m, 0.0, None)
        if most_m_s <= 0.0:
            return stands
        self._trip = trip = self._trip or _Trip(self._by, self._poses)
        if trip.failure is not None:
            raise trip.failure
        if trip.sent is not None and trip.sent.ended.is_set():
            self.halt()
            self._end(trip.sent, pose, costmap)
            return stands
        trip.limit_to(most_m_s if most_m_s < self._by.max_speed_m_s else math.inf)
        is_silent = trip.sent is not None and trip.heard == self._heard
        self._heard, self._silent_s = trip.heard, self._silent_s + self._by.period_s if is_silent else 0.0
        if self._silent_s > self._by.silent_s:
            what = f"Nav2 on {self._by.action} has sent neither feedback nor a result for {self._by.silent_s:g} s."
            raise SkillFailure(Cause.EXECUTION, what)
        self._left_m = trip.left_m or self._left_m or own.remaining_m
        return replace(stands, remaining_m=self._left_m, halt=self.halt)

    def halt(self) -> None:
        """Lets Nav2 cancel its goal, if it has one."""
        if self._trip is not None:
            self._trip.over.set()
        self._trip, self._silent_s = None, 0.0

    def _end(self, sent: SentGoal, pose: Pose2D, costmap: FreeSpace) -> None:
        """Judges how Nav2's goal ended, by the robot's pose; plans the last part. Raises SkillFailure."""
        if sent.status is GoalStatus.CANCELED:
            raise SkillFailure(Cause.EXECUTION, "Another program has cancelled Nav2's goal.")
        if sent.status is not GoalStatus.SUCCEEDED:
            cause, words = failure_of(sent.result)
            raise SkillFailure(cause, f"Nav2 gave up: {words}.", final=cause is Cause.PRECONDITION)
        rows = pose_array([pose, self._path.goal])
        off_m = math.dist(rows[0, :2], rows[1, :2])
        if off_m > self._by.near_m:
            raise SkillFailure(Cause.POSTCONDITION, f"Nav2 says it is there, and the robot is {off_m:.2f} m off.")
        if self._footprint.base_kind is BaseKind.DIFFERENTIAL and off_m > _STEP_M:
            heading = math.atan2(*(rows[1] - rows[0])[1::-1])
            rows = np.insert(rows, 1, [[*rows[0, :2], heading], [*rows[1, :2], heading]], axis=0)
        super().__init__(_path(rows, costmap, self._footprint), self._footprint, self._by)
        self._arrived = True
