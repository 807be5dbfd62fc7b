"""Goals from ROS 2 for one robot during a run: `goal_pose`, and the actions `navigate_to_pose` and `run_mission`.

A goal becomes a mission that interrupts the robot's present one, which goes on afterwards. A new goal takes the place
of the one before.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final

from errand_ros2 import messages
from errand_ros2.inputs import pose_on_map
from errand_ros2.wire.actions import ActionServer, Goal, GoalStatus
from errand_ros2.wire.node import Node
from errand_ros2.wire.types import ros_types
from executive.app.prepare.prepared import Prepared
from executive.language.parser import load_parser
from executive.mission.load import load_mission
from executive.mission.resolve import mission_from_file
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.compiler import CompiledTree
from executive.words.mission import Mission
from skills.api import SkillContext
from skills.estimate.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Pose2D

FEEDBACK_PERIOD_S: Final = 0.5
_STOP: Final = {"wait": {"seconds": 0.05}}
_FAILED: Final = 9000
"""Error code of navigate_to_pose for any failure; its message has the cause."""


@dataclass
class _Pursued:
    """Goal that is pursued as a mission; the mission `stop` takes its place when it is cancelled.

    `goal` is None for one of the topic `goal_pose`.
    """

    mission: str
    stop: CompiledTree
    server: ActionServer | None
    goal: Goal | None
    pose: Pose2D | None
    since_s: float | None = None


class Goals:
    """Goals of one robot. Requests come from threads of Zenoh; the run calls `tick`, `message` and `end`."""

    def __init__(
        self,
        node: Node,
        prepared: Prepared,
        control: Control,
        grid: GridMap,
        pool: Executor,
        refuse: Callable[[str], None],
        hurry: Callable[[], None] = lambda: None,
    ) -> None:
        """`prepared` is the robot's part of the run; `pool` compiles goals, `refuse` tells why one is refused.

        `hurry` lets the next tick begin at once.
        """
        self._hurry = hurry
        self._prepared, self._control, self._grid, self._refuse = prepared, control, grid, refuse
        self._name = prepared.mission.robot_name
        self._numbers, self._lock = count(1), threading.RLock()
        self._pursued: dict[str, _Pursued] = {}
        self._frames: Mapping[str, Pose2D] = {}
        self._due_s = -math.inf
        self._duration = ros_types().message("builtin_interfaces/msg/Duration").make
        self._odom = f"{node.namespace.strip('/')}/odom"
        make = partial(ActionServer, node, pool=pool, cancel=self._cancel)
        self._navigate = make("navigate_to_pose", "nav2_msgs/action/NavigateToPose", accept=self._accept_pose)
        self._run = make("run_mission", "errand_msgs/action/RunMission", accept=self._accept_mission)

    def hear_pose(self, stamped: Any) -> None:
        """Drives to a pose of `goal_pose`; tells why it cannot."""
        try:
            pose = pose_on_map(stamped, self._grid, self._frames)
            self._pursue(lambda name: self._to_pose(name, pose), None, None, pose)
        except (InputError, ValueError) as error:
            self._refuse(f"goal_pose is refused: {error}")

    def _accept_pose(self, goal: Goal) -> bool:
        try:
            pose = pose_on_map(goal.message.pose, self._grid, self._frames)
            self._pursue(lambda name: self._to_pose(name, pose), self._navigate, goal, pose)
        except (InputError, ValueError) as error:
            self._refuse(f"navigate_to_pose is refused: {error}")
            return False
        return True

    def _accept_mission(self, goal: Goal) -> bool:
        try:
            self._pursue(partial(self._mission, goal.message.sentence, goal.message.file), self._run, goal, None)
        except (InputError, ValueError) as error:
            self._refuse(f"run_mission is refused: {error}")
            return False
        return True

    def _cancel(self, goal: Goal) -> None:
        """Ends a goal's mission; the robot stops at the next tick."""
        with self._lock:
            found = next((each for each in self._pursued.values() if each.goal is goal), None)
            if found is not None:
                with suppress(ValueError):  # it is being cancelled already
                    self._control.replace(found.stop, instead_of=found.mission)
                self._hurry()

    def _pursue(
        self, mission: Callable[[str], Mission], server: ActionServer | None, goal: Goal | None, pose: Pose2D | None
    ) -> None:
        """Compiles a goal's mission, and lets it begin in place of the goal before. Raises InputError, ValueError."""
        if not self._control.state.missions.get(self._name):
            raise InputError(f"{self._name} has no mission any more", hint="send goals while its mission lasts")
        name = f"ros2 goal {next(self._numbers)}"
        tree, stop = self._compiled(mission(name)), self._compiled(self._mission_of(f"{name} cancelled", _STOP))
        with self._lock:
            before = next(reversed(self._pursued), None)
            self._pursued[name] = _Pursued(name, stop, server, goal, pose)
            try:
                if before is None:
                    self._control.preempt(tree)
                else:
                    self._control.replace(tree, instead_of=before)
            except ValueError:
                del self._pursued[name]
                raise

    def _compiled(self, mission: Mission) -> CompiledTree:
        return replace(self._prepared, others=()).with_mission(mission).tree

    def _mission_of(self, name: str, *steps: Mapping[str, Any]) -> Mission:
        world = self._prepared.world.name
        return Mission.model_validate({"name": name, "robot": self._name, "world": world, "steps": [*steps]})

    def _to_pose(self, name: str, pose: Pose2D) -> Mission:
        goal = {"x_m": pose.x_m, "y_m": pose.y_m, "yaw_rad": pose.yaw_rad}
        return self._mission_of(name, {"skill": "navigate", "with": {"goal": goal}})

    def _mission(self, sentence: str, file: str, name: str) -> Mission:
        """Reads the mission of a sentence or a file, under another name. Raises InputError."""
        if bool(sentence) == bool(file):
            raise InputError("a mission is a sentence or a file", hint="fill in one of the two")
        asked = self._mission_of(name, {"say": sentence}) if sentence else load_mission(Path(file))
        found = mission_from_file(asked, parser=load_parser(), knowledge=self._prepared.knowledge)
        return found.model_copy(update={"name": name, "robot": self._name})

    @property
    def are_any(self) -> bool:
        """Returns whether a goal is pursued."""
        return bool(self._pursued)

    def tick(self, context: SkillContext, now_s: float, step: tuple[str, str]) -> None:
        """Publishes feedback twice a second; `step` is the path id of the running node, and what it says."""
        self._frames = {self._odom: Pose2D.from_transform(context.localiser.estimate().X_WO)}
        if now_s < self._due_s:
            return
        self._due_s = now_s + FEEDBACK_PERIOD_S
        with self._lock:
            pursued = [*self._pursued.values()]
        for each in pursued:
            if each.server is None or each.goal is None:
                continue
            if each.since_s is None:
                each.since_s = now_s
                each.server.begin(each.goal)
            if each.server is self._run:
                each.server.tell(each.goal, each.server.kind.feedback.make(*step))
            else:
                self._tell_distance(each, context, now_s)

    def _tell_distance(self, each: _Pursued, context: SkillContext, now_s: float) -> None:
        """Publishes feedback of navigate_to_pose; the distance is that of the straight line."""
        assert each.server is not None and each.goal is not None and each.pose is not None and each.since_s is not None
        here, took_s = context.pose(), now_s - each.since_s
        left_m = math.hypot(each.pose.x_m - here.x_m, each.pose.y_m - here.y_m)
        whole_s, part_s = divmod(took_s, 1.0)
        pose = messages.pose_stamped(now_s, messages.MAP_FRAME, context.X_WB())
        spent, left = self._duration(int(whole_s), int(part_s * 1e9)), self._duration(0, 0)
        each.server.tell(each.goal, each.server.kind.feedback.make(pose, spent, left, 0, left_m))

    def message(self, message: Mapping[str, Any]) -> None:
        """Ends the goal whose mission ended, by the message of its outcome."""
        with self._lock:
            each = self._pursued.pop(str(message.get("mission", "")), None)
        if each is not None:
            cause = message.get("cause")
            self._end(each, Outcome(message["outcome"]), getattr(cause, "value", cause) or "", str(message["message"]))

    def end(self) -> None:
        """Ends all goals, because the run ends."""
        with self._lock:
            left, self._pursued = [*self._pursued.values()], {}
        for each in left:
            self._end(each, Outcome.CANCELLED, "CANCELLED", "the run has ended")

    def _end(self, each: _Pursued, outcome: Outcome, cause: str, words: str) -> None:
        if each.server is None or each.goal is None:
            return
        status = GoalStatus.SUCCEEDED if outcome is Outcome.SUCCESS else GoalStatus.ABORTED
        if status is GoalStatus.ABORTED and each.goal.status is GoalStatus.CANCELING:
            status, words = GoalStatus.CANCELED, "cancelled by its client"
        if each.server is self._run:
            result = each.server.kind.result.make(outcome.value, cause, words)
        else:
            code = 0 if status is GoalStatus.SUCCEEDED else _FAILED
            result = each.server.kind.result.make(code, "" if code == 0 else f"{cause}: {words}")
        each.server.end(each.goal, status, result)
