"""A run of a scripted robot as a system of ROS 2, and a client in the same process that talks to it and steps it."""

import json
import queue
import re
import threading
import time
import uuid
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from ros_client import free_port, soon
from ros_lock_step import restore, state_of

from errand_ros2.bridge import Bridge
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import ros_types
from executive import Request
from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
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
_MANUAL = Path(__file__).parents[1] / "docs" / "ros2.md"
NAVIGATE, RUN = "nav2_msgs/action/NavigateToPose", "errand_msgs/action/RunMission"
THROUGH = "nav2_msgs/action/NavigateThroughPoses"
ACTIONS = {"navigate_to_pose": NAVIGATE, "navigate_through_poses": THROUGH, "run_mission": RUN}
PATIENCE_S = 20.0
HEARD = {
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/alice/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "/alice/plan": "nav_msgs/msg/Path",
    "/alice/odom": "nav_msgs/msg/Odometry",
    "/alice/local_costmap/costmap": "nav_msgs/msg/OccupancyGrid",
    "/alice/global_costmap/costmap": "nav_msgs/msg/OccupancyGrid",
    "/alice/particle_cloud": "nav2_msgs/msg/ParticleCloud",
}

IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
TOPICS = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/alice/odom": "nav_msgs/msg/Odometry",
    "/alice/joint_states": "sensor_msgs/msg/JointState",
    "/alice/imu": "sensor_msgs/msg/Imu",
    "/alice/scan": "sensor_msgs/msg/LaserScan",
    "/alice/points": "sensor_msgs/msg/PointCloud2",
    "/alice/battery_state": "sensor_msgs/msg/BatteryState",
    "/alice/gripper/holding": "std_msgs/msg/Bool",
    "/alice/gripper/force": "geometry_msgs/msg/WrenchStamped",
    "/ground_truth/alice/pose": "geometry_msgs/msg/PoseStamped",
    **{f"/alice/{each.source}/image": IMAGE for each in spot_capabilities().cameras},
    **{f"/alice/{each.source}/depth/image": IMAGE for each in spot_capabilities().cameras},
    **{
        f"/alice/{each.source}/image/compressed": "sensor_msgs/msg/CompressedImage"
        for each in spot_capabilities().cameras
    },
    **{
        f"/alice/{each.source}/depth/image/compressedDepth": "sensor_msgs/msg/CompressedImage"
        for each in spot_capabilities().cameras
    },
    **{f"/alice/{each.source}/camera_info": INFO for each in spot_capabilities().cameras},
    **{f"/alice/{each.source}/depth/camera_info": INFO for each in spot_capabilities().cameras},
}
STORED = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/alice/robot_description": "std_msgs/msg/String",
}
"""Topics of which a late subscription gets the last message."""


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

    def __init__(self):
        super().__init__()
        self.localiser = CloudPlace()
        self.robot.scan(), self.robot.image("hand")  # compiles them, which may take longer than a run waits

    def entry(self, tree, durable):
        return RunEntry(tree, self.robot, self.localiser, BlockCostmap(ROOM))


class SteppedBridge(Bridge):
    """Bridge of a run that another thread steps: between the steps the run stands, and velocities do not age."""

    def __init__(self, prepared, control, place):
        self._go, self._stands = threading.Semaphore(0), threading.Semaphore(0)
        self.now_s, self.has_ended = 0.0, False
        super().__init__(prepared, control, place, life=self.now)

    def now(self):
        return self.now_s

    def tick(self, progress):
        self.now_s = progress.now_s
        super().tick(progress)

    def keep_pace(self, now_s):
        self._stands.release()
        self._go.acquire()

    def stands(self):
        """Waits until the run stands between two ticks, or has ended."""
        self._stands.acquire()

    def step(self):
        self._go.release()
        self.stands()

    def run(self, work):
        """Calls the function that is the run; tells its end."""
        try:
            return work()
        finally:
            self.has_ended = True
            self._stands.release()

    def finish(self):
        """Cancels the run, and steps it to its end."""
        self._control.cancel("the test is over")
        while not self.has_ended:
            self.step()


class RealBridge(SteppedBridge):
    """Bridge of a run in real time; a step of its client waits for the run's next tick."""

    now, step = staticmethod(time.monotonic), SteppedBridge.stands

    def keep_pace(self, now_s):
        Bridge.keep_pace(self, now_s)
        self._stands.release()


class RosClient:
    """Another program, which steps the run: what it hears by topic, and what it sends."""

    def __init__(self, session, bridge, backend=None):
        self.node, self.place, self.bridge, self.heard = (
            session.node("client"),
            session.place,
            bridge,
            defaultdict(list),
        )
        self.backend, self.robot = backend, getattr(backend, "robot", None)
        self._begun = None if backend is None else state_of(self.robot)
        self._pool, self._clock = ThreadPoolExecutor(1), queue.SimpleQueue()
        self.node.subscribe("/clock", "rosgraph_msgs/msg/Clock", self._clock.put)
        for topic in ("/alice/events", "/alice/reply"):
            self.hear(topic, STRING)
        assert soon(lambda: bridge._clock.is_heard and bridge._robots["Alice"].goals.events.is_heard)

    def hear(self, topic, kind, *options):
        """Subscribes to a topic; returns the list of what comes."""
        self.node.subscribe(topic, kind, self.heard[topic].append, *options)
        return self.heard[topic]

    def step(self, count=1):
        """Steps the run, and waits until its clock is heard; a run in real time needs no step."""
        for _ in range(0 if self.bridge.has_ended else count):
            self.bridge.step()
            if not self.bridge.has_ended:
                self._clock.get(timeout=PATIENCE_S)

    def soon(self, condition, limit_s=60.0):
        """Steps the run until a condition holds, at most for some time of the robot; returns that time."""
        begun_s = self.bridge.now()
        while not condition() and self.bridge.now() < begun_s + limit_s and not self.bridge.has_ended:
            self.step()
        assert condition() or (self.bridge.has_ended and soon(condition)), "it did not come about"
        return self.bridge.now() - begun_s

    def meanwhile(self, call, limit_s=60.0):
        """Steps the run until a call has returned; returns what it returned."""
        made = self._pool.submit(call)
        self.soon(made.done, limit_s)
        return made.result()

    def events(self, topic):
        said = [json.loads(each.data) for each in self.heard["/alice/events"]]
        return [each for each in said if each["topic"] == topic]

    def controls(self):
        return [each["what"] for each in self.events("control")]

    def call(self, name):
        return self.node.client(f"/alice/{name}", TRIGGER).call({}, limit_s=PATIENCE_S)

    def publisher(self, topic, kind):
        made = self.node.publisher(topic, kind)
        assert soon(lambda: made.is_heard)
        return made

    def put(self, publisher, *messages):
        """Publishes messages, and waits until the run has handled them."""
        nodes = [self.bridge._node, *(each.node for each in self.bridge._robots.values())]
        wanted = sum(each.handled for each in nodes) + len(messages)
        for each in messages:
            publisher.put(each)
        assert soon(lambda: sum(each.handled for each in nodes) >= wanted)
        self.bridge._pool.submit(int).result()

    def tell(self, topic, kind, message):
        self.put(self.publisher(topic, kind), message)

    def still(self):
        return float(np.max(np.abs(self.robot.velocity))) < 0.02

    def begin_anew(self):
        """Ends all goals, lets the mission go on, and puts the robot where it began."""
        for name, kind in ACTIONS.items():
            ActionClient(self, name, kind).cancel(every=True)
        control = self.bridge._control
        if control.state.robots["Alice"].mode.value != "running":
            self.call("resume")
        self.soon(lambda: len(control.state.missions["Alice"]) == 1 and self.still())
        self.step(3)
        restore(self.robot, self._begun)
        self.backend.localiser.__init__()
        self.step(2)
        for each in self.heard.values():
            each.clear()

    def close(self):
        self._pool.shutdown()


class ActionClient:
    """Client of an action, which sends one goal."""

    def __init__(self, ros, name, kind=None):
        self.ros, self.kind = ros, kind or ACTIONS[name]
        base = f"/alice/{name}/_action"
        self._send = ros.node.client(f"{base}/send_goal", f"{self.kind}_SendGoal")
        self._result = ros.node.client(f"{base}/get_result", f"{self.kind}_GetResult")
        self._cancel = ros.node.client(f"{base}/cancel_goal", "action_msgs/srv/CancelGoal")
        self._feedback, self.feedback = f"{base}/feedback", []
        self.identity = {"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)}
        self.goal = ros_types().make(f"{self.kind}_Goal")

    def follow(self):
        """Collects the feedback."""
        self.ros.node.subscribe(self._feedback, f"{self.kind}_FeedbackMessage", self.feedback.append)
        return self

    def send(self):
        return self._send.call({"goal_id": self.identity, "goal": self.goal}, limit_s=PATIENCE_S).accepted

    def result(self, limit_s=60.0):
        return self.ros.meanwhile(partial(self.asked, limit_s), limit_s)

    def asked(self, limit_s=60.0):
        """Asks for the result while somebody else steps the run."""
        return self._result.call({"goal_id": self.identity}, limit_s=limit_s)

    def cancel(self, *, every=False):
        info = {} if every else {"goal_id": self.identity}
        return self._cancel.call({"goal_info": info}, limit_s=PATIENCE_S).return_code


class PartClient(ActionClient):
    """Client of an action whose goals the run takes in its ticks."""

    def send(self):
        return self.ros.meanwhile(super().send)


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


def small_room(folder):
    """Prepares a mission of Alice that waits in the small room."""
    folder.mkdir(exist_ok=True)
    room, mission = write_small_room(folder / "room"), folder / "wait.yaml"
    mission.write_text("name: wait\nsteps:\n  - wait: {seconds: 3000}\n")
    return prepare(Request(file=mission, world=str(room), out=folder / "out", seed=1, time_limit_s=3500.0))


@contextmanager
def run_of_alice(folder, place=None, *, pace=SteppedBridge, before=lambda place: None):
    """Runs a mission that waits, in a thread; yields a client, which has the run's `report` after the block.

    `before` is called when the bridge is open, and the run has not begun.
    """
    prepared, control, backend = small_room(folder), Control(pace=None), RoomBackend()
    place = place or Place(port=free_port())
    bridge = pace(prepared, control, place)
    before(place)

    def work():
        return run_request(prepared, backend, visitors=[bridge], control=control).report

    with ThreadPoolExecutor(1) as pool, pytest.MonkeyPatch.context() as patch:
        patch.setattr("executive.run.guarded_robot.call_aside", lambda call, *_: call())  # a thread for each verb
        run = pool.submit(bridge.run, work)
        bridge.stands()
        try:
            with open_session(place) as session, closing(RosClient(session, bridge, backend)) as ros:
                ros.prepared = prepared
                yield ros
        finally:
            bridge.finish()
            report = run.result()
        ros.report = report


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
    feedback = {f"{space}/{name}/_action/feedback": f"{kind}_FeedbackMessage" for name, kind in ACTIONS.items()}
    return feedback | {f"{space}/{name}/_action/status": "action_msgs/msg/GoalStatusArray" for name in ACTIONS}


def provoke(ros):
    """Lets a run say something on each topic: a drive, two missions, and what a search would find."""
    drive, through, mission = (ActionClient(ros, name).follow() for name in ACTIONS)
    through.goal.poses.goals = [stamped(-0.4, 0.0), stamped(-0.4, 0.4)]
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
