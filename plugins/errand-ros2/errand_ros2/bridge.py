"""Bridge between a run, which goes at the pace of the wall clock, and ROS 2: `errand run ... --ros2 [DOMAIN]`."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from py_trees.behaviour import Behaviour

from errand_ros2 import messages
from errand_ros2.driving import Driving
from errand_ros2.goals import Goals
from errand_ros2.messages import Fields
from errand_ros2.part_actions import PartActions
from errand_ros2.readings import pose_on_map
from errand_ros2.robot_topics import Frames, RobotTopics
from errand_ros2.tree_topic import TreeTopic
from errand_ros2.wire.node import Node, Place, Publisher
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import LATCHED, Qos
from executive.app.prepare.prepared import Prepared
from executive.app.runs.backend import Observe
from executive.app.runs.conversations import Conversations
from executive.record.announce import announce
from executive.record.other_tools import ros_name
from executive.run.control import Control
from executive.run.outcome import RunResult
from executive.run.visitor import MissionEnd, Progress, RunVisitor
from executive.tree.compiler import CompiledTree
from skills.api import LocalisationEstimate, ParticleView, SearchingLocaliser, SkillContext
from skills.grid_map import GridMap, load_grid_map

_LOG: Final = logging.getLogger(__name__)
_STATES: Final = {True: {"id": 3, "label": "active"}, False: {"id": 2, "label": "inactive"}}  # of a lifecycle node
_GET_STATE: Final = "lifecycle_msgs/srv/GetState"
_EVENTS: Final = frozenset({"transitions", "control", "outcome", "speech", "errors", "object_to_detect"})
"""Topics of the log whose messages are published as events."""
_TOPICS: Final = {
    "reply": "std_msgs/msg/String",
    "plan": "nav_msgs/msg/Path",
    "detections": "vision_msgs/msg/Detection2DArray",
    "amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "task_channel": "errand_msgs/msg/TaskMessage",
    "object_to_detect": "errand_msgs/msg/ObjectToDetect",
    "object_destination": "errand_msgs/msg/ObjectDestination",
    **dict.fromkeys(("local_costmap/costmap", "global_costmap/costmap"), "nav_msgs/msg/OccupancyGrid"),
    **dict.fromkeys(("objects", "people"), "visualization_msgs/msg/MarkerArray"),
    "particle_cloud": "nav2_msgs/msg/ParticleCloud",
}
_PERIOD_S, _MOST_PARTICLES, _MOST_VARIANCE = 0.5, 200, 1e6  # variances in m² and rad²
_LATE_S, _CHEST_M, _HALF_M = 0.5, 1.2, 3.0  # delay not caught up; height of people's markers; half the local costmap


def observe(value: str) -> Observe:
    """Returns the observer for `--ros2`, whose value `Place.parse` reads. Raises InputError for another value."""
    place = Place.parse(value)
    return lambda prepared, control: Bridge(prepared, control, place)


@dataclass
class _RobotBridge:
    """Publishers and inputs of one robot; `context` is that of its last mission, which lasts while it `is_active`."""

    node: Node
    driving: Driving
    goals: Goals
    out: Mapping[str, Publisher]
    tree_topic: TreeTopic
    context: SkillContext | None = None
    tree: CompiledTree | None = None
    topics: RobotTopics | None = None
    parts: PartActions | None = None
    is_active: bool = False
    due_s: float = 0.0
    initial: list[Any] = field(default_factory=list)


class Bridge(RunVisitor):
    """Visitor of one run that is a system of ROS 2."""

    def __init__(
        self, prepared: Prepared, control: Control, place: Place, life: Callable[[], float] = time.monotonic
    ) -> None:
        """Opens the session; velocities die by the clock `life` (s). Raises InputError."""
        self._open, self._control, self._life, self._hurry = ExitStack(), control, life, threading.Event()
        self.session = self._open.enter_context(open_session(place))
        _LOG.warning("ROS 2: %s", self.session.told)
        self._pool = self._open.enter_context(ThreadPoolExecutor(1, thread_name_prefix="errand-ros2"))
        self._node = self.session.node("errand")
        self._node.claim("/clock")
        self._clock = self._node.publisher("/clock", "rosgraph_msgs/msg/Clock")
        self._diagnostics = self._node.publisher("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        self._frames = Frames(self._node)
        self._grid = load_grid_map(prepared.world.scan_map_path)
        self._node.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED).put(messages.occupancy_grid(self._grid))
        self._conversations = Conversations(prepared, control)
        self._conversations.set_missions()
        self._robots = {each.mission.robot_name: self._robot(each) for each in prepared.all}
        self._hear(self._node, next(iter(self._robots.values())))  # RViz and teleoperation send without a namespace
        self._begun: tuple[float, float] | None = None

    def _robot(self, prepared: Prepared) -> _RobotBridge:
        name = prepared.mission.robot_name
        node = self.session.node("errand", f"/{ros_name(name)}")
        node.claim("odom")
        out = {topic: node.publisher(topic, kind, Qos(10, "errand_msgs" in kind)) for topic, kind in _TOPICS.items()}

        def hear(said: Any) -> None:
            out["reply"].put({"data": self._conversations.hear(said.data, name).text})

        goals = Goals(node, prepared, self._control, self._grid, self._pool, self._hurry)
        own = _RobotBridge(node, Driving(name, self._control, self._life), goals, out, TreeTopic(node))
        self._hear(node, own)
        node.subscribe("say", "std_msgs/msg/String", node.later(self._pool, hear))
        for what in ("pause", "resume", "cancel", "step"):
            node.answer(what, "std_srvs/srv/Trigger", partial(self._obey, name, what))
        return own

    def _hear(self, node: Node, own: _RobotBridge) -> None:
        """Takes goals, poses and velocities for a robot."""
        drive = node.later(self._pool, lambda stamped: own.goals.accept("goal_pose", None, [stamped]))
        node.subscribe("goal_pose", "geometry_msgs/msg/PoseStamped", drive)
        node.subscribe("initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped", own.initial.append)
        own.driving.listen(node, lambda: 0.0 if own.context is None else own.context.clock.now())
        for name in ("amcl", "bt_navigator"):  # whose states nav2_simple_commander awaits
            node.answer(f"{name}/get_state", _GET_STATE, lambda _: {"current_state": _STATES[own.is_active]})

    def _obey(self, name: str, what: str, _: Any) -> Fields:
        """Answers a service by its command to a robot, or by the reason why it is refused."""
        control = self._control
        verbs: Mapping[str, Callable[[], None]] = {
            "pause": partial(control.pause, "paused by ROS 2", robot=name),
            "cancel": partial(control.cancel, "cancelled by ROS 2", robot=name),
            "resume": partial(control.resume, robot=name),
            "step": control.step,
        }
        try:
            verbs[what]()
            if what == "resume":
                control.resume()
        except ValueError as error:
            return {"success": False, "message": str(error)}
        self._hurry.set()
        return {"success": True, "message": what}

    def mission_begun(self, nodes: Sequence[Behaviour], context: SkillContext) -> None:
        """Takes the context of a robot's new mission; publishes the robot's description and cameras at the first."""
        own = self._robots[context.robot.name]
        own.context, own.is_active = context, True
        if own.topics is None:
            own.topics = RobotTopics(own.node, context.robot, self._frames)
            own.parts = PartActions(own.node, context.robot, context.clock, lambda: (own.context or context).lease)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Publishes paths and events; ends the goal whose mission has ended."""
        own = self._robots.get(str(message.get("robot") or message.get("robot_name") or ""))
        own = own or (next(iter(self._robots.values())) if len(self._robots) == 1 else None)
        if own is None:
            return message
        if topic == "path" and own.context is not None:
            own.out["plan"].put(messages.path(own.context.clock.now(), message["poses"]))
        elif topic == "detections":
            head = messages.header(message["stamp_s"], f"{own.node.namespace.strip('/')}/{message['source']}_camera")
            own.out["detections"].put(messages.detections(head, message["detections"]))
        elif topic == "tracks":
            seen = [(each["class_name"], each["position_W"]) for each in message["tracks"] if each["confirmed"]]
            own.out["objects"].put(messages.markers(message["stamp"], seen))
        elif topic == "people":
            seen = [("person", (*each["position_W"], _CHEST_M)) for each in message["people"]]
            own.out["people"].put(messages.markers(message["stamp"], seen))
        elif topic in _EVENTS:
            own.goals.events.put(messages.event(topic, message))
        name = {"taskChannel": "task_channel"}.get(topic, topic)
        if (kind := _TOPICS.get(name, "")).startswith("errand_msgs/"):
            own.out[name].put(messages.typed(kind, message))
        if topic == "outcome":
            own.goals.message(message)
        return message

    def tick(self, progress: Progress) -> None:
        """Publishes what is due, sends commands of `/cmd_vel`, and waits for the wall clock."""
        now_s = progress.now_s
        self._conversations.tick(progress)
        self._clock.put({"clock": messages.time_of(now_s)})
        for own in self._robots.values():
            if own.context is not None and own.topics is not None:
                self._tick_robot(own, own.context, own.topics, progress)
        self.keep_pace(now_s)

    def _tick_robot(self, own: _RobotBridge, context: SkillContext, topics: RobotTopics, progress: Progress) -> None:
        now_s, tree = context.clock.now(), progress.trees.get(context.robot.name)
        if tree is not None and tree is not own.tree:
            own.tree = tree
            publish: Any = self.message
            world, knowledge = own.goals.prepared.world.name, own.goals.prepared.knowledge
            told = partial(announce, publish, context.clock, tree.robot_name, tree.commands, knowledge)
            self._node.guarded(partial(told, world=world, seed=0), "a command")
        while own.initial:
            self._node.guarded(partial(_set_pose, context, self._grid, own.initial.pop(0)), "initialpose")
        estimate = context.localiser.estimate()
        topics.publish(now_s, estimate.X_WO if estimate.localised else None)
        if now_s >= own.due_s:
            own.due_s = now_s + _PERIOD_S
            self._put_slowly(own, context, estimate, progress)
            if tree is not None:
                own.tree_topic.put(now_s, tree, progress.states[context.robot.name])
        if own.is_active and own.parts is not None:
            own.driving.tick(context, own.parts)
            own.goals.tick(context, progress)

    def _put_slowly(
        self, own: _RobotBridge, context: SkillContext, estimate: LocalisationEstimate, progress: Progress
    ) -> None:
        """Publishes the robot's health, and while it is localised pose, costmaps and particles."""
        robot, now_s = context.robot, context.clock.now()
        values = {"overruns": str(progress.overruns), "tick (ms)": f"{progress.tick_wall_s * 1e3:.1f}"}
        values |= {"localised": str(estimate.localised), "localisation health": f"{estimate.health:.3f}"}
        values |= {"battery": f"{robot.battery().charge:.3f}"}
        self._diagnostics.put(messages.diagnostics(progress.now_s, robot.name, robot.faults(), values))
        if not estimate.localised:
            return
        own.out["amcl_pose"].put(messages.pose_with_covariance(now_s, context.X_WB(), estimate.covariance))
        low_m = context.pose().x_m - _HALF_M, context.pose().y_m - _HALF_M
        areas = {"local": (low_m, (2.0 * _HALF_M,) * 2), "global": (self._grid.origin_m, self._grid.size_m)}
        for name, area in areas.items():
            if (out := own.out[f"{name}_costmap/costmap"]).is_heard:
                out.put(messages.costmap(now_s, context.costmap, *area))
        if isinstance(context.localiser, ParticleView) and own.out["particle_cloud"].is_heard:
            own.out["particle_cloud"].put(messages.particles(now_s, context.localiser.particles_W(_MOST_PARTICLES)))

    def mission_ended(self, end: MissionEnd) -> None:
        """Ends the goals of a robot whose mission has ended."""
        own = self._robots[end.result.robot_name]
        own.is_active = False
        own.goals.end()
        if own.parts is not None:
            own.parts.end()

    def keep_pace(self, now_s: float) -> None:
        """Waits for the wall clock, unless a request is in a hurry; forgets a delay that is too long."""
        wall_s = time.monotonic()
        begun_s, begun_wall_s = self._begun = self._begun or (now_s, wall_s)
        ahead_s = now_s - begun_s - (wall_s - begun_wall_s)
        if ahead_s > 0.0:
            self._hurry.wait(ahead_s)
        elif ahead_s < -_LATE_S:
            self._begun = (now_s, wall_s)
        self._hurry.clear()

    def end(self, result: RunResult) -> None:
        """Ends all goals and leaves the graph."""
        for own in self._robots.values():
            own.goals.end()
        self._open.close()


def _set_pose(context: SkillContext, grid: GridMap, stamped: Any) -> None:
    """Gives the localiser the pose of `initialpose`, if it can take one. Raises InputError for one off the map."""
    localiser, X_OB = context.localiser, context.robot.odometry().X_OB
    pose = pose_on_map(SimpleNamespace(header=stamped.header, pose=stamped.pose.pose), grid, {})
    if not isinstance(localiser, SearchingLocaliser):
        return
    X_WO = pose.transform(float(X_OB.translation()[2])) @ X_OB.inverse()
    covariance = np.asarray(stamped.pose.covariance).reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
    covariance = 0.5 * (covariance + covariance.T)
    usable = np.all(np.abs(covariance) < _MOST_VARIANCE) and np.all(np.linalg.eigvalsh(covariance) > 0.0)
    shape = covariance if usable else np.diag([0.25, 0.25, 0.07])
    localiser.accept(LocalisationEstimate(context.clock.now(), X_WO, shape, localised=True))
