"""A run of a scripted robot as a system of ROS 2, and a client that talks to it.

The run is in the caller's thread, and what a client does in another, which ends the run.
"""

import json
import re
import threading
import time
import uuid
from collections import defaultdict
from pathlib import Path

import numpy as np
from ros_client import free_port

from errand_ros2.bridge import Bridge
from errand_ros2.wire.node import Client, Node, Place, open_session
from errand_ros2.wire.types import ActionType, ros_types
from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.visitor import RunEntry
from executive.testing.bench import write_small_room
from plant.robots.spot.kind import spot_capabilities
from skills.testing.blocks import ROOM
from skills.testing.estimators import BlockCostmap, KnownPlace
from tests.executive.app.runs.scripted_backend import ScriptedBackend

TWIST, POSE, STRING, TRIGGER = (
    *("geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseStamped"),
    *("std_msgs/msg/String", "std_srvs/srv/Trigger"),
)
_MANUAL = Path(__file__).parents[3] / "docs" / "how-to" / "ros2.md"
NAVIGATE, RUN = "nav2_msgs/action/NavigateToPose", "errand_msgs/action/RunMission"
THROUGH = "nav2_msgs/action/NavigateThroughPoses"
HEARD = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/alice/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/alice/plan": "nav_msgs/msg/Path",
    "/alice/events": STRING,
    "/alice/reply": STRING,
    "/alice/odom": "nav_msgs/msg/Odometry",
    "/alice/local_costmap/costmap": "nav_msgs/msg/OccupancyGrid",
    "/alice/global_costmap/costmap": "nav_msgs/msg/OccupancyGrid",
    "/alice/particle_cloud": "nav2_msgs/msg/ParticleCloud",
}


class CloudPlace(KnownPlace):
    """A localiser with particles, which stores what it accepts."""

    def __init__(self):
        super().__init__()
        self.accepted = []

    def accept(self, estimate):
        super().accept(estimate)
        self.accepted.append(estimate)

    def particles_W(self, most):
        return np.array([[0.5, 0.0, 0.0], [0.7, 0.0, 0.0]])


class RoomBackend(ScriptedBackend):
    """A scripted robot that knows the small room's walls."""

    def entry(self, tree, durable):
        return RunEntry(tree, self.robot, CloudPlace(), BlockCostmap(ROOM))


class RosClient:
    """Another program: what it hears by topic, and goals that it sends."""

    def __init__(self, session, robot, bridge):
        self.node, self.robot, self.bridge, self.heard = Node(session, "client"), robot, bridge, defaultdict(list)
        self.place = session.place
        for topic, kind in HEARD.items():
            self.node.subscribe(topic, kind, self.heard[topic].append)

    def soon(self, condition, limit_s=20.0):
        until_s = time.monotonic() + limit_s
        while not condition() and time.monotonic() < until_s:
            time.sleep(0.01)
        assert condition(), "it did not come about"

    def events(self, topic):
        said = [json.loads(each.data) for each in self.heard["/alice/events"]]
        return [each for each in said if each["topic"] == topic]

    def call(self, name):
        return Client(self.node, f"/alice/{name}", ros_types().service(TRIGGER)).call({}, limit_s=5.0)

    def publisher(self, topic, kind):
        made = self.node.publisher(topic, kind)
        self.soon(lambda: made.is_heard)
        return made

    def still(self):
        return float(np.max(np.abs(self.robot.velocity))) < 0.02


class ActionClient:
    """Client of an action, which sends one goal."""

    def __init__(self, client, name, kind):
        self.kind, node = ActionType(ros_types(), kind), client.node
        base = f"/alice/{name}/_action"
        self._send = Client(node, f"{base}/send_goal", self.kind.send_goal)
        self._result = Client(node, f"{base}/get_result", self.kind.get_result)
        self._cancel = Client(node, f"{base}/cancel_goal", self.kind.cancel_goal)
        self.feedback = []
        node.subscribe(f"{base}/feedback", self.kind.feedback_message.name, self.feedback.append)
        self.identity = {"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)}
        self.goal = ros_types().make(f"{kind}_Goal")

    def send(self):
        return self._send.call({"goal_id": self.identity, "goal": self.goal}, limit_s=20.0).accepted

    def result(self, limit_s=60.0):
        return self._result.call({"goal_id": self.identity}, limit_s=limit_s)

    def cancel(self):
        return self._cancel.call({"goal_info": {"goal_id": self.identity}}, limit_s=5.0).return_code


def stamped(x, y, frame="map", w=1.0):
    message = ros_types().make(POSE)
    message.header.frame_id, message.pose.position.x, message.pose.position.y = frame, x, y
    message.pose.orientation.w = w
    return message


def twist(x, wz=0.0):
    message = ros_types().make(TWIST)
    message.linear.x, message.angular.z = x, wz
    return message


def text(value):
    return {"data": value}


class ScriptedRun:
    """Runs a mission that waits, while a function talks to it as a client; then cancels it, and returns the report."""

    def __init__(self, folder):
        folder.mkdir(exist_ok=True)
        room, mission = write_small_room(folder / "room"), folder / "wait.yaml"
        mission.write_text("name: wait\nsteps:\n  - wait: {seconds: 600}\n")
        self.prepared = prepare(Request(file=mission, world=str(room), out=folder / "out", seed=1))

    def __call__(self, says, place=None, *, before=lambda place: None):
        """`before` is called when the bridge is open, and the run has not begun."""
        place, control, backend, errors = place or Place(port=free_port()), Control(pace=None), RoomBackend(), []
        backend.robot.scan(), backend.robot.image("hand")  # compiles them, which may take longer than a run waits
        bridge = Bridge(self.prepared, control, place)

        def client():
            try:
                with open_session(place) as session:
                    ros = RosClient(session, backend.robot, bridge)
                    ros.soon(lambda: ros.heard["/alice/odom"])
                    says(ros)
            except BaseException as error:
                errors.append(error)
            finally:
                control.cancel("the test is over")

        before(place)
        thread = threading.Thread(target=client)
        thread.start()
        try:
            report = run_request(self.prepared, backend, visitors=[bridge], control=control).report
        finally:
            thread.join()
        if errors:
            raise errors[0]
        return report


def documented(heading, space="/alice"):
    """Topics below a heading of the manual, with their types; those of cameras for each camera of a Spot."""
    section = _MANUAL.read_text(encoding="utf-8").partition(f"\n### {heading}\n")[2].partition("\n##")[0]
    found = {}
    for names, kinds in re.findall(r"^\| (`[^|]*) \| (`[^|]*) \|", section, re.MULTILINE):
        kinds = [each.replace("/", "/msg/") for each in re.findall(r"`([^`]+)`", kinds)]
        names = re.findall(r"`([^`]+)`", names)
        kinds = kinds * len(names) if len(kinds) == 1 else kinds
        if len(kinds) < len(names):  # pictures, then their intrinsics
            kinds = [kinds["info" in name] for name in names]
        found |= dict(zip(names, kinds, strict=True))
    cameras = [each.source for each in spot_capabilities().cameras]
    placed = {name: [name.replace("CAMERA", each) for each in cameras] for name in found if "CAMERA" in name}
    every = {each: kind for name, kind in found.items() for each in placed.get(name, [name])}
    return {name if name.startswith("/") else f"{space}/{name}": kind for name, kind in every.items()}


def action_topics(space="/alice"):
    """Topics of a run's actions, with their types."""
    kinds = {"navigate_to_pose": NAVIGATE, "navigate_through_poses": THROUGH, "run_mission": RUN}
    feedback = {f"{space}/{name}/_action/feedback": f"{kind}_FeedbackMessage" for name, kind in kinds.items()}
    return feedback | {f"{space}/{name}/_action/status": "action_msgs/msg/GoalStatusArray" for name in kinds}


def provoke(ros):
    """Lets a run say something on each topic: a drive, two missions, and what a search would find."""
    through = ActionClient(ros, "navigate_through_poses", THROUGH)
    through.goal.poses.goals = [stamped(-0.4, 0.0), stamped(-0.4, 0.4)]
    drive, mission = ActionClient(ros, "navigate_to_pose", NAVIGATE), ActionClient(ros, "run_mission", RUN)
    drive.goal.pose, mission.goal.sentence = stamped(0.3, -0.6), "go to the table"
    for action in (through, drive, mission):
        assert action.send()
        ros.soon(lambda action=action: action.feedback)
    box = {"class_name": "coke", "score": 0.9, "box": [10, 20, 30, 60], "class_id": 3, "surface": ""}
    ros.bridge.message("detections", {"stamp_s": 2.5, "source": "hand", "detections": [box], "image": None})
    wanted = {"stamp": 2.5, "robot_name": "Alice", "class_id": [3, 4], "class_name": ["coke", "beer"]}
    ros.bridge.message("object_to_detect", wanted)
    place = {f"goal_{axis}": value for axis, value in zip("xyz", (1.0, 2.0, 0.5), strict=True)}
    found = {"stamp": 2.5, "sequence": 2500, "class_name": "coke", **place}
    ros.bridge.message("object_destination", found)
    track = {"class_name": "coke", "position_W": [1.0, 2.0, 0.8], "confirmed": True}
    ros.bridge.message("tracks", {"stamp": 2.5, "robot_name": "Alice", "tracks": [track]})
    ros.bridge.message("people", {"stamp": 2.5, "robot": "Alice", "people": [{"position_W": [3.0, 1.0]}]})
    ros.publisher("/alice/say", STRING).put(text("what do you do?"))
