"""Goals from ROS 2 for one robot in a run: missions that interrupt the present one; a new one replaces it."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final

from py_trees.common import Status
from pydrake.math import RigidTransform

from errand_ros2 import messages
from errand_ros2.readings import pose_on_map
from errand_ros2.robot_topics import frames_on_body
from errand_ros2.wire.actions import ActionServer, Goal, GoalStatus
from errand_ros2.wire.node import Node
from executive.app.prepare.prepared import Prepared
from executive.language.parser import load_parser
from executive.mission.load import load_mission
from executive.mission.resolve import mission_from_file
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.visitor import Progress
from executive.tree.compiler import CompiledTree
from executive.words.mission import Mission
from skills.api import SkillContext
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Pose2D

FEEDBACK_PERIOD_S, _PASSED_M = 0.5, 0.3  # a pose counts as passed within this distance
_STOP: Final = {"wait": {"seconds": 0.05}}
_MISSION: Final = "run_mission"
_ACTIONS: Final = {
    "navigate_to_pose": "nav2_msgs/action/NavigateToPose",
    "navigate_through_poses": "nav2_msgs/action/NavigateThroughPoses",
    _MISSION: "errand_msgs/action/RunMission",
}
_FAILED: Final = 9000  # error code of navigate_to_pose for any failure; its message has the cause


@dataclass
class _Pursued:
    """Goal that is pursued as a mission, whose place `stop` takes when it is cancelled; None: of the topic."""

    source: str
    goal: Goal | None
    poses: tuple[Pose2D, ...]
    stop: CompiledTree
    since_s: float | None = None
    passed: int = 0


class Goals:
    """Goals of one robot. Requests come from threads of Zenoh; the run calls `tick`, `message` and `end`."""

    def __init__(
        self, node: Node, prepared: Prepared, control: Control, grid: GridMap, pool: Executor, hurry: threading.Event
    ) -> None:
        """`pool` compiles goals; `hurry` lets the run go on at once."""
        self.prepared, self._control, self._grid, self._hurry = prepared, control, grid, hurry
        self.events = node.publisher("events", "std_msgs/msg/String")
        self._name = prepared.mission.robot_name
        self._numbers, self._lock = count(1), threading.RLock()
        self._pursued: dict[str, _Pursued] = {}
        self._frames: Mapping[str, RigidTransform] = {}
        self._due_s = -math.inf
        self._space = node.namespace.strip("/")
        make = partial(ActionServer, node, pool=pool, cancel=self._cancel)
        self._actions = {
            name: make(name, kind, accept=partial(self._accept_goal, name)) for name, kind in _ACTIONS.items()
        }

    def _accept_goal(self, action: str, goal: Goal) -> bool:
        poses = [goal.message.pose] if hasattr(goal.message, "pose") else getattr(goal.message, "poses", [])
        return self.accept(action, goal, getattr(poses, "goals", poses))

    def accept(self, source: str, goal: Goal | None, stamped: Sequence[Any]) -> bool:
        """Pursues a goal of a topic or action; tells why it cannot."""
        try:
            self._pursue(source, goal, tuple(pose_on_map(each, self._grid, self._frames) for each in stamped))
        except (InputError, ValueError) as error:
            self.events.put(messages.event("refused", {"message": f"{source} is refused: {error}"}))
            return False
        return True

    def _cancel(self, goal: Goal) -> None:
        """Ends a goal's mission; the run stops the robot before its clock's next step."""
        with self._lock:
            for name in [name for name, each in self._pursued.items() if each.goal is goal]:
                with suppress(ValueError):  # it is being cancelled already
                    self._control.replace(self._pursued[name].stop, instead_of=name)
                self._hurry.set()

    def _pursue(self, source: str, goal: Goal | None, poses: tuple[Pose2D, ...]) -> None:
        """Compiles a goal's mission, and lets it begin in place of the goal before. Raises InputError, ValueError."""
        if not self._control.state.missions.get(self._name):
            raise InputError(f"{self._name} has no mission any more", hint="send goals while its mission lasts")
        name = f"ros2 goal {next(self._numbers)}"
        asked = None if goal is None else goal.message
        drives = [{"skill": "navigate", "with": {"goal": asdict(pose)}} for pose in poses]
        mission = self._asked(name, asked) if source == _MISSION else self._mission_of(name, *drives)
        tree, stop = self._compiled(mission), self._compiled(self._mission_of(f"{name} cancelled", _STOP))
        with self._lock:
            before = next(reversed(self._pursued), None)
            self._pursued[name] = _Pursued(source, goal, poses, stop)
            try:
                if before is None:
                    self._control.preempt(tree)
                else:
                    self._control.replace(tree, instead_of=before)
            except ValueError:
                del self._pursued[name]
                raise

    def _compiled(self, mission: Mission) -> CompiledTree:
        return replace(self.prepared, others=()).with_mission(mission).tree

    def _mission_of(self, name: str, *steps: Mapping[str, Any]) -> Mission:
        world = self.prepared.world.name
        return Mission.model_validate({"name": name, "robot": self._name, "world": world, "steps": [*steps]})

    def _asked(self, name: str, goal: Any) -> Mission:
        """Reads the mission of a sentence or a file, under another name. Raises InputError."""
        if bool(goal.sentence) == bool(goal.file):
            raise InputError("a mission is a sentence or a file", hint="fill in one of the two")
        asked = self._mission_of(name, {"say": goal.sentence}) if goal.sentence else load_mission(Path(goal.file))
        found = mission_from_file(asked, parser=load_parser(), knowledge=self.prepared.knowledge)
        return found.model_copy(update={"name": name, "robot": self._name})

    def tick(self, context: SkillContext, progress: Progress) -> None:
        """Publishes feedback twice a second."""
        X_WB, space = context.X_WB(), self._space
        frames = {f"{space}/{name}": X_WB @ X_BF for name, X_BF in frames_on_body(context.robot).items()}
        self._frames = {**frames, f"{space}/odom": context.localiser.estimate().X_WO}
        if (now_s := context.clock.now()) < self._due_s:
            return
        self._due_s = now_s + FEEDBACK_PERIOD_S
        with self._lock:
            pursued = [*self._pursued.values()]
        for each in pursued:
            if each.goal is None:
                continue
            action = self._actions[each.source]
            if each.since_s is None:
                each.since_s = now_s
                action.set_status(each.goal, GoalStatus.EXECUTING)
            if each.source == _MISSION:
                states = progress.states[self._name].items()
                running = [(path, at.message) for path, at in states if at.status is Status.RUNNING]
                path, message = running[-1] if running else ("", "")
                action.tell(each.goal, step=path, message=message)
            else:
                action.tell(each.goal, **_feedback(each, context, now_s))

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
        if each.goal is None:
            return
        status = GoalStatus.SUCCEEDED if outcome is Outcome.SUCCESS else GoalStatus.ABORTED
        if status is GoalStatus.ABORTED and each.goal.status is GoalStatus.CANCELING:
            status, words = GoalStatus.CANCELED, "cancelled by its client"
        failed = status is not GoalStatus.SUCCEEDED
        result: dict[str, Any] = {"outcome": outcome.value, "cause": cause, "claim": words}
        if each.source != _MISSION:
            result = {"error_code": _FAILED if failed else 0, "error_msg": f"{cause}: {words}" if failed else ""}
        self._actions[each.source].end(each.goal, status, **result)


def _feedback(each: _Pursued, context: SkillContext, now_s: float) -> Mapping[str, Any]:
    """Returns the feedback of navigation; the distance is that of the straight lines between the poses."""
    here = (context.pose().x_m, context.pose().y_m)
    left = [(pose.x_m, pose.y_m) for pose in each.poses[each.passed :]]
    if len(left) > 1 and math.dist(here, left[0]) < _PASSED_M:
        each.passed, left = each.passed + 1, left[1:]
    feedback = {
        "current_pose": messages.pose_stamped(now_s, messages.MAP_FRAME, context.X_WB()),
        "navigation_time": messages.time_of(now_s - (each.since_s or now_s)),
        "distance_remaining": sum(map(math.dist, [here, *left], left)),
    }
    return feedback | ({"number_of_poses_remaining": len(left)} if len(each.poses) > 1 else {})
