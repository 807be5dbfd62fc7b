"""Bridge between a run, which goes at the pace of the wall clock, and ROS 2: `errand run ... --ros2 [DOMAIN]`."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import numpy as np
from py_trees.behaviour import Behaviour

from errand_ros2 import messages
from errand_ros2.driving import Driving
from errand_ros2.goals import Goals
from errand_ros2.messages import Fields
from errand_ros2.readings import FRAMES, TOPIC, planar_pose
from errand_ros2.robot_topics import Frames, RobotTopics
from errand_ros2.wire.node import Node, Place, Publisher, open_session
from errand_ros2.wire.types import LATCHED
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
from skills.estimate.grid_map import load_grid_map
from skills.inputs.errors import InputError
from skills.robot import Clock

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
    "local_costmap/costmap": "nav_msgs/msg/OccupancyGrid",
    "particle_cloud": "nav2_msgs/msg/ParticleCloud",
}
_DIAGNOSTICS_PERIOD_S, _POSE_PERIOD_S, _MOST_PARTICLES = 1.0, 0.5, 200
_LATE_S: Final = 0.5  # delay that a run does not catch up with


def observe(value: str) -> Observe:
    """Returns the observer for `--ros2 [DOMAIN][@HOST[:PORT]]`. Raises InputError for another value."""
    place = Place.parse(value)
    return lambda prepared, control: Bridge(prepared, control, place)


@dataclass
class _RobotBridge:
    """Publishers and inputs of one robot; `context` is that of its last mission, which lasts while it `is_active`."""

    node: Node
    driving: Driving
    goals: Goals
    out: Mapping[str, Publisher]
    context: SkillContext | None = None
    tree: CompiledTree | None = None
    topics: RobotTopics | None = None
    is_active: bool = False
    pose_due_s: float = 0.0
    initial: list[Any] = field(default_factory=list)


class Bridge(RunVisitor):
    """Visitor of one run that is a system of ROS 2."""

    def __init__(self, prepared: Prepared, control: Control, place: Place) -> None:
        """Opens the session. Raises InputError."""
        self._open, self._control = ExitStack(), control
        self._hurry = threading.Event()
        self.session = self._open.enter_context(open_session(place))
        self._pool = self._open.enter_context(ThreadPoolExecutor(1, thread_name_prefix="errand-ros2"))
        self._node = Node(self.session, "errand")
        self._clock = self._node.publisher("/clock", "rosgraph_msgs/msg/Clock")
        self._map = self._node.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED)
        self._diagnostics = self._node.publisher("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        self._frames = Frames(self._node)
        self._grid = load_grid_map(prepared.world.scan_map_path)
        self._map.put(messages.occupancy_grid(self._grid))
        self._conversations = Conversations(prepared, control)
        self._robots = {each.mission.robot_name: self._robot(each) for each in prepared.all}
        first = next(iter(self._robots.values()))  # RViz's buttons and teleoperation send without a namespace
        hear_pose = self._node.later(self._pool, first.goals.hear_pose)
        self._node.subscribe("/goal_pose", "geometry_msgs/msg/PoseStamped", hear_pose)
        self._node.subscribe("/initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped", first.initial.append)
        self._node.subscribe(f"/{TOPIC}", "geometry_msgs/msg/Twist", first.driving.hear)
        self._diagnostics_due_s = 0.0
        self._begun: tuple[float, float] | None = None

    def _robot(self, prepared: Prepared) -> _RobotBridge:
        name = prepared.mission.robot_name
        node = Node(self.session, "errand", f"/{ros_name(name)}")
        out = {topic: node.publisher(topic, kind) for topic, kind in _TOPICS.items()}

        def hear(said: Any) -> None:
            out["reply"].put({"data": self._conversations.hear(said.data, name).text})

        driving = Driving(name, self._control)
        goals = Goals(node, prepared, self._control, self._grid, self._pool, self._hurry)
        own = _RobotBridge(node, driving, goals, out)
        node.subscribe("goal_pose", "geometry_msgs/msg/PoseStamped", node.later(self._pool, goals.hear_pose))
        node.subscribe("initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped", own.initial.append)
        node.subscribe(TOPIC, "geometry_msgs/msg/Twist", driving.hear)
        node.subscribe("say", "std_msgs/msg/String", node.later(self._pool, hear))
        for what in ("pause", "resume", "cancel", "step"):
            node.answer(what, "std_srvs/srv/Trigger", partial(self._obey, name, what))
        return own

    def _obey(self, name: str, what: str, _: Any) -> Fields:
        """Answers a service by its command to a robot, or by the reason why it is refused."""
        control = self._control
        try:
            if what == "pause":
                control.pause("paused by ROS 2", robot=name)
            elif what == "cancel":
                control.cancel("cancelled by ROS 2", robot=name)
            elif what == "step":
                control.step()
            else:
                control.resume(robot=name)
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
        self._clock.put({"clock": messages.time_of(now_s)})
        for own in self._robots.values():
            if own.context is not None and own.topics is not None:
                self._tick_robot(own, own.context, own.topics, progress)
        if now_s >= self._diagnostics_due_s:
            self._diagnostics_due_s = now_s + _DIAGNOSTICS_PERIOD_S
            for name, own in self._robots.items():
                if own.context is not None:
                    self._put_diagnostics(name, own.context, progress)
        self._keep_pace(now_s)

    def _announce(self, tree: CompiledTree, clock: Clock, prepared: Prepared) -> None:
        publish: Any = self.message
        announce(publish, clock, tree.robot_name, tree.commands, prepared.knowledge, world=prepared.world.name, seed=0)

    def _tick_robot(self, own: _RobotBridge, context: SkillContext, topics: RobotTopics, progress: Progress) -> None:
        clock, now_s, tree = context.clock, context.clock.now(), progress.trees.get(context.robot.name)
        if tree is not None and tree is not own.tree:
            own.tree = tree
            self._node.guarded(partial(self._announce, tree, clock, own.goals.prepared), "a command")
        while own.initial:
            _set_pose(context, own.initial.pop(0))
        estimate = context.localiser.estimate()
        topics.publish(now_s, estimate.X_WO if estimate.localised else None)
        if estimate.localised and now_s >= own.pose_due_s:
            own.pose_due_s = now_s + _POSE_PERIOD_S
            own.out["amcl_pose"].put(messages.pose_with_covariance(now_s, context.X_WB(), estimate.covariance))
            if own.out["local_costmap/costmap"].is_heard:
                here = context.pose()
                own.out["local_costmap/costmap"].put(messages.costmap(now_s, context.costmap, (here.x_m, here.y_m)))
            if isinstance(context.localiser, ParticleView) and own.out["particle_cloud"].is_heard:
                own.out["particle_cloud"].put(messages.particles(now_s, context.localiser.particles_W(_MOST_PARTICLES)))
        if own.is_active:
            own.driving.tick(context)
            own.goals.tick(context, progress)

    def _put_diagnostics(self, name: str, context: SkillContext, progress: Progress) -> None:
        estimate, robot = context.localiser.estimate(), context.robot
        values = {
            "battery": f"{robot.battery().charge:.3f}",
            "localised": str(estimate.localised),
            "localisation health": f"{estimate.health:.3f}",
            "overruns": str(progress.overruns),
            "tick (ms)": f"{progress.tick_wall_s * 1e3:.1f}",
        }
        self._diagnostics.put(messages.diagnostics(progress.now_s, name, robot.faults(), values))

    def mission_ended(self, end: MissionEnd) -> None:
        """Ends the goals of a robot whose mission has ended."""
        own = self._robots[end.result.robot_name]
        own.is_active = False
        own.goals.end()

    def _keep_pace(self, now_s: float) -> None:
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


def _set_pose(context: SkillContext, stamped: Any) -> None:
    """Gives the localiser the pose of `initialpose`, if it can take one; ignores what is no pose on the map."""
    localiser, X_OB = context.localiser, context.robot.odometry().X_OB
    try:
        pose = planar_pose(stamped.pose.pose)
    except InputError:
        return
    if stamped.header.frame_id.strip("/") not in FRAMES or not isinstance(localiser, SearchingLocaliser):
        return
    X_WO = pose.transform(float(X_OB.translation()[2])) @ X_OB.inverse()
    covariance = np.asarray(stamped.pose.covariance).reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
    usable = np.all(np.isfinite(covariance)) and np.all(np.diag(covariance) > 0.0)
    shape = covariance if usable else np.diag([0.25, 0.25, 0.07])
    localiser.accept(LocalisationEstimate(context.clock.now(), X_WO, shape, localised=True))
