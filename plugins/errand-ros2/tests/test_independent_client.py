"""A run as a client hears and drives it that shares no code with the plug-in; its bytes, as two decoders read them."""

import math
import re
import uuid
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from mcap_ros2._dynamic import generate_dynamic
from ros_client import EMPTY, connected, soon
from ros_run import NAVIGATE, POSE, STORED, TRIGGER, action_topics, documented, provoke, run_of_alice
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh import ext
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.discovery import get_service_names_and_types, get_topic_info, get_topic_names_and_types

from errand_ros2.wire.actions import GoalStatus
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import LATCHED
from tests.tables import yaml_beside

TAKEN = {"goal_pose": POSE, "cmd_vel": "geometry_msgs/msg/Twist"}
TAKEN["initialpose"] = "geometry_msgs/msg/PoseWithCovarianceStamped"
HASHES = yaml_beside(Path(__file__).with_name("wire") / "test_types.py", "test_types.yaml")["service"]
PART_ACTIONS = {
    "arm_controller/follow_joint_trajectory": "control_msgs/action/FollowJointTrajectory",
    "gripper_controller/gripper_cmd": "control_msgs/action/GripperCommand",
}
PARTS = {"send_goal": f"{NAVIGATE}_SendGoal", "get_result": f"{NAVIGATE}_GetResult"}


class Navigation:
    """The action navigate_to_pose through the independent client, which has no actions: three services, one topic.

    It takes the requests and responses of an action's services for types in a folder srv, hashes those, and so needs
    the public hash.
    """

    def __init__(self, session, port):
        self.types, base = session.store.types, "/alice/navigate_to_pose/_action"
        services = {part: (kind, f"RIHS01_{HASHES[kind]}") for part, kind in PARTS.items()}
        services["cancel_goal"] = ("action_msgs/srv/CancelGoal", None)
        self.services = {
            part: ROS2ServiceClient(f"{base}/{part}", kind, type_hash=known, router_port=port)
            for part, (kind, known) in services.items()
        }
        self.feedback = []
        ROS2Subscriber(f"{base}/feedback", f"{NAVIGATE}_FeedbackMessage", self.feedback.append, router_port=port)
        self.identity = self.made("unique_identifier_msgs", "UUID", uuid=np.frombuffer(uuid.uuid4().bytes, np.uint8))

    def made(self, package, name, **values):
        return self.types[f"{package}/msg/{name}"](**values)

    def pose(self, x, y):
        return stamped_by(self.types, x, y)

    def send(self, x, y):
        goal = self.types[f"{NAVIGATE}_Goal"](pose=self.pose(x, y), behavior_tree="")
        return self.services["send_goal"].call(goal_id=self.identity, goal=goal)

    def result(self):
        return self.services["get_result"].call(goal_id=self.identity)

    def cancel(self):
        stamp = self.made("builtin_interfaces", "Time", sec=0, nanosec=0)
        info = self.made("action_msgs", "GoalInfo", goal_id=self.identity, stamp=stamp)
        return self.services["cancel_goal"].call(goal_info=info)


def stamped_by(types, x, y):
    """A pose on the map in the client's types."""
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "map")
    point, turn = types["geometry_msgs/msg/Point"](x, y, 0.0), types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    return types[POSE](header, types["geometry_msgs/msg/Pose"](point, turn))


@pytest.fixture(scope="module")
def run_and_topics(message_files, tmp_path_factory):
    """A run to which the client listens from before its beginning, and what it, and a plain subscription, then heard.

    The client's one session is open meanwhile.
    """
    heard, raw, topics = {}, {}, documented("Published") | action_topics()

    def keep(sample):
        raw.setdefault("/" + "/".join(str(sample.key_expr).split("/")[1:-2]), sample.payload.to_bytes())

    def missing():
        return topics.keys() - (heard.keys() & raw.keys())

    with ExitStack() as ends:

        def listen(place):
            ends.plain = ends.enter_context(open_session(place)).inner
            ends.callback(ends.plain.declare_subscriber("0/**", keep).undeclare)
            ends.sdk = ends.enter_context(connected(place.port, message_files))
            subscribe(place, topics)

        def subscribe(place, these):
            for topic in these:
                if stored := topic in STORED:
                    history = ext.HistoryConfig(max_samples=1)
                    late = ext.declare_advanced_subscriber(ends.plain, f"0{topic}/**", keep, history=history)
                    ends.callback(late.undeclare)
                hear, qos = partial(heard.setdefault, topic), LATCHED.text() if stored else None
                ROS2Subscriber(topic, topics[topic], hear, router_port=place.port, qos=qos)

        with run_of_alice(tmp_path_factory.mktemp("run"), before=listen) as ros:
            for _ in range(8):  # a router drops what a busy client does not take in time
                provoke(ros)
                ros.step(5)
                if soon(lambda: not missing(), 5.0):
                    break
                subscribe(ros.place, missing() & STORED.keys())
            assert missing() == set()
            ros.sdk = ends.sdk
            yield ros, topics, heard, raw


@pytest.fixture
def ros(run_and_topics):
    run_and_topics[0].begin_anew()
    return run_and_topics[0]


def test_the_independent_client_hears_every_topic_of_a_run(run_and_topics):
    _, topics, heard, _ = run_and_topics
    assert heard.keys() == topics.keys()
    assert heard["/map"].info.resolution == pytest.approx(0.025)
    assert heard["/alice/detections"].detections[0].results[0].hypothesis.class_id == "coke"
    assert heard["/alice/object_destination"].goal_y == 2.0
    assert len(heard["/alice/particle_cloud"].particles) == 2
    assert heard["/alice/navigate_through_poses/_action/feedback"].feedback.number_of_poses_remaining == 2
    assert {each.child_frame_id for each in heard["/tf"].transforms} == {"alice/body", "alice/odom", "alice/hand"}


def test_the_independent_client_lists_every_topic_and_service_of_a_run(ros):
    published = documented("Published") | action_topics()
    taken = {f"{space}/{name}": kind for name, kind in TAKEN.items() for space in ("", "/alice")}
    taken["/alice/say"] = "std_msgs/msg/String"
    for name, kind in PART_ACTIONS.items():
        base = f"/alice/{name}/_action"
        taken |= {f"{base}/feedback": f"{kind}_FeedbackMessage", f"{base}/status": "action_msgs/msg/GoalStatusArray"}

    listed = dict(get_topic_names_and_types(router_port=ros.place.port))
    velocities = {key: [TAKEN["cmd_vel"], "geometry_msgs/msg/TwistStamped"] for key in ("/cmd_vel", "/alice/cmd_vel")}
    assert listed == {topic: [kind] for topic, kind in (published | taken).items()} | velocities
    for topic, kind in published.items():
        told = get_topic_info(topic, router_port=ros.place.port, verbose=True)
        (publisher,) = told.publishers
        space = "/alice" if topic.startswith("/alice/") else "/"
        assert (publisher.topic_type, publisher.node_name, publisher.node_namespace) == (kind, "errand", space)
    services = dict(get_service_names_and_types(router_port=ros.place.port))
    assert services.keys() >= {f"/alice/{name}" for name in ("pause", "resume", "cancel", "step")}
    base = "/alice/navigate_to_pose/_action"
    assert services[f"{base}/cancel_goal"] == ["action_msgs/srv/CancelGoal"]
    assert {part: services[f"{base}/{part}"] for part in PARTS} == {part: [PARTS[part]] for part in PARTS}


def test_the_independent_client_reaches_a_goal_and_cancels_another(ros):
    first = Navigation(ros.sdk, ros.place.port)
    assert first.send(0.3, -0.3).accepted
    ended = ros.meanwhile(first.result)
    assert (ended.status, ended.result.error_code, ended.result.error_msg) == (GoalStatus.SUCCEEDED, 0, "")
    assert math.hypot(ros.robot.pose.x_m - 0.3, ros.robot.pose.y_m + 0.3) < 0.15
    assert first.feedback[0].feedback.distance_remaining == pytest.approx(0.42, abs=0.15)
    second = Navigation(ros.sdk, ros.place.port)
    assert second.send(-0.6, 1.2).accepted
    ros.soon(lambda: not ros.still())
    answer = second.cancel()
    assert answer.return_code == 0
    assert [each.goal_id.uuid.tolist() for each in answer.goals_canceling] == [second.identity.uuid.tolist()]
    assert ros.meanwhile(second.result).status == GoalStatus.CANCELED
    assert ros.soon(ros.still) < 0.4


def test_the_independent_client_drives_and_calls_the_services(ros):
    port, answers = ros.place.port, {"response_definition": "bool success\nstring message"}
    goal, to = ROS2Publisher("/goal_pose", POSE, router_port=port), stamped_by(ros.sdk.store.types, 0.3, 0.0)

    before = ros.bridge._node.handled
    while ros.bridge._node.handled == before:  # the router may not know the publisher at once
        goal.publish(header=to.header, pose=to.pose)
        soon(lambda: ros.bridge._node.handled > before, 0.5)
    ros.soon(lambda: ros.robot.pose.x_m > 0.15)
    for name in ("pause", "step", "resume", "cancel"):
        client = ROS2ServiceClient(f"/alice/{name}", TRIGGER, request_definition=EMPTY, **answers, router_port=port)
        told = client.call()
        assert (told.success, told.message) == (True, name)
    ros.soon(lambda: "CANCELLED" in str(ros.events("outcome")))


def plain(value):
    """A decoded message of either decoder as nested dictionaries and lists; NaN becomes text, which equals itself."""
    names = getattr(value, "__dataclass_fields__", getattr(value, "__slots__", ()))
    if names and not isinstance(value, (np.ndarray, np.generic)):  # constants are in capital letters
        return {name: plain(getattr(value, name)) for name in names if name.islower() and name != "__msgtype__"}
    value = value.tolist() if isinstance(value, np.ndarray) else value
    if isinstance(value, (bytes, bytearray, memoryview, list, tuple)):
        return list(value) if len(value) and type(value[0]) is int else [plain(each) for each in value]
    value = value.item() if isinstance(value, np.generic) else value
    return "nan" if isinstance(value, float) and math.isnan(value) else value


def decoders(folder):
    """A function that lets both decoders read bytes of a type; for them, who know no actions, all are messages."""
    store, known = get_typestore(Stores.ROS2_JAZZY), partial(re.compile(r"/action/(\w+)_(\w+)").sub, r"/msg/\1\2")
    for file in folder.glob("*/*/*.msg"):
        if (name := known("/".join((*file.parts[-3:-1], file.stem)))) not in store.types and "/srv/" not in name:
            store.register(get_types_from_msg(known(file.read_text()), name))

    def read(kind, data):
        name = known(kind)
        definition, _ = store.generate_msgdef(name, ros_version=2)
        message = store.deserialize_cdr(data, name)
        assert bytes(store.serialize_cdr(message, name)) == data, kind
        return plain(generate_dynamic(name, definition)[name](data)), plain(message)

    return read


def test_two_decoders_read_the_same_in_the_bytes_of_every_topic_of_a_run(run_and_topics, message_files):
    (_, topics, _, raw), read = run_and_topics, decoders(message_files)
    told = {topic: read(kind, raw[topic]) for topic, kind in topics.items()}
    assert [topic for topic, (one, other) in told.items() if one != other] == []
    assert told["/alice/object_destination"][0]["class_name"] == "coke"
    assert told["/alice/detections"][0]["detections"][0]["bbox"]["center"]["position"] == {"x": 20.0, "y": 40.0}
    assert [each["weight"] for each in told["/alice/particle_cloud"][0]["particles"]] == [0.5, 0.5]
