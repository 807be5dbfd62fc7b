"""Runs that share a router, senders that share a topic, and random bytes on every input of a run."""

import math
import os
from importlib.util import find_spec

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import soon
from ros_run import ACTIONS, POSE, STRING, TRIGGER, TWIST, ActionClient, run_of_alice, stamped, twist

from errand_ros2.wire.actions import GoalStatus
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import Attachment, ros_types, service_forms
from skills.navigate.follower import FollowerOptions

INPUTS = {"goal_pose": POSE, "cmd_vel": TWIST, "initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped"}
BYTES = 200_000
SLACK = 0.05


def topics_of(ros):
    """Topics of runs in all domains, by domain, as the tokens of nodes tell them."""
    tokens = [str(each.ok.key_expr).split("/") for each in ros.node.session.liveliness.get("@ros2_lv/**", timeout=1.0)]
    found = {int(each[1]): set() for each in tokens}
    for each in tokens:
        if each[5] == "MP" and each[8] == "errand":
            found[int(each[1])].add(each[9].replace("%", "/"))
    return found


def test_runs_in_two_domains_of_one_router_hear_their_own_goals_only(ros, tmp_path):
    with run_of_alice(tmp_path, Place(domain=7, port=ros.place.port)) as ros_7:
        told = {"/alice/odom", "/clock"}
        # both runs are of Alice, and publish the same topics, which the router tells one by one
        assert soon(lambda: (listed := topics_of(ros_7))[0] == listed[7] and told < listed[7])
        for here, there in ((ros, ros_7), (ros_7, ros)):
            there.step(10)
            began, told = there.robot.pose, len(there.events("refused") + there.events("outcome"))
            action = ActionClient(here, "navigate_to_pose")
            action.goal.pose = stamped(-0.4, 0.0)
            assert action.send()
            here.tell("/goal_pose", POSE, stamped(-0.4, 0.3))
            assert action.result().status == GoalStatus.ABORTED  # the second goal takes its place
            here.soon(lambda here=here: here.robot.pose.y_m > 0.15)
            assert here.call("pause").success
            here.soon(here.still)
            there.step(10)
            assert math.hypot(there.robot.pose.x_m - began.x_m, there.robot.pose.y_m - began.y_m) < 0.02
            assert len(there.events("refused") + there.events("outcome")) == told
            here.call("resume")
            here.soon(lambda here=here: len(here.events("outcome")) == 2)


@pytest.mark.parametrize("speeds", [(0.3, 0.6), (-0.4, 0.4), (0.5, 100.0)])
def test_two_senders_of_velocities_keep_the_robot_between_them_until_both_are_silent(ros, speeds):
    most, rates = FollowerOptions().turn_rad_s, []
    senders = [ros.publisher("/cmd_vel", TWIST) for _ in speeds]
    for tick in range(36):
        for command, wz in list(zip(senders, speeds, strict=True))[:: 1 if tick % 3 else -1]:
            ros.put(command, twist(0.0, wz))
            ros.step(tick % 2)
        ros.step()
        rates.append(float(ros.robot.velocity[2]))
    assert ros.soon(ros.still) < 0.6
    assert min(speeds) - SLACK <= min(rates[16:]) and max(rates) <= min(max(speeds), most) + SLACK
    assert np.hypot(*ros.robot.velocity[:2]) < 0.01


def initial_pose(x, frame="map", covariance=None):
    """A message of RViz's button 2D Pose Estimate; the covariance is that of x, y and yaw."""
    message = ros_types().make(INPUTS["initialpose"])
    message.header.frame_id, message.pose.pose.position.x, message.pose.pose.orientation.w = frame, x, 1.0
    whole = np.zeros((6, 6))
    whole[np.ix_([0, 1, 5], [0, 1, 5])] = np.eye(3) if covariance is None else covariance
    message.pose.covariance = whole.ravel()
    return message


def test_an_initial_pose_that_is_no_pose_on_the_map_is_ignored(ros):
    poses = [(1e300, "map"), (9.0, "map"), (math.nan, "map"), (-math.inf, "map"), (0.1, "mars"), (0.5, "map")]
    ros.put(ros.publisher("/initialpose", INPUTS["initialpose"]), *(initial_pose(*each) for each in poses))
    ros.step()
    assert [each.X_WO.translation()[0] for each in ros.backend.localiser.accepted] == [0.5]


def test_the_covariance_of_an_initial_pose_is_that_of_its_message_if_it_is_one(ros):
    usual, good = np.diag([0.25, 0.25, 0.07]), np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.1], [0.0, 0.1, 0.3]])
    leaning = np.array([[1.0, 5.0, 0.0], [5.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # no covariance: one variance is negative
    cases = [(good, good), (leaning, usual), (np.zeros((3, 3)), usual), (math.nan * np.eye(3), usual)]
    cases += [(1e300 * np.eye(3), usual), (-np.eye(3), usual)]

    poses = [initial_pose(0.5, covariance=told) for told, _ in cases]
    ros.put(ros.publisher("/initialpose", INPUTS["initialpose"]), *poses)
    ros.step()
    for (_, wanted), each in zip(cases, ros.backend.localiser.accepted, strict=True):
        assert each.covariance == pytest.approx(wanted)


def services_of():
    """Services of a run of Alice, with their types, in all forms."""
    found = [(f"/alice/{name}", ros_types().service(TRIGGER)) for name in ("pause", "resume", "step", "cancel")]
    for name, kind in ACTIONS.items():
        base = f"/alice/{name}/_action"
        found.append((f"{base}/cancel_goal", ros_types().service("action_msgs/srv/CancelGoal")))
        for part, service in (("send_goal", "SendGoal"), ("get_result", "GetResult")):
            found += [(f"{base}/{part}", each) for each in service_forms(f"{kind}_{service}")]
    return found


def chunks(chance, most, header):
    """Random bytes, 200 000 in all, in messages of up to so many; some have the header of a message."""
    left = BYTES
    while left > 0:
        data = header[: int(chance.integers(0, 5))] + chance.bytes(int(chance.integers(0, most)))
        left -= len(data)
        yield data


def test_random_bytes_on_every_input_of_a_run_move_nothing(ros, capfd):
    types, chance, session = ros_types(), np.random.default_rng(1), ros.node.session.inner
    topics = {f"{space}/{name}": kind for name, kind in INPUTS.items() for space in ("", "/alice")}
    topics["/alice/say"] = STRING
    for topic, kind in topics.items():
        key = ros.node.key.data_key(topic, types.message(kind).key)
        for data in chunks(chance, 9000, b"\0\1\0\0"):
            if not 52 <= len(data) < 60:  # random bytes of a velocity's length are a velocity
                session.put(key, data)
        ros.step()
    head = Attachment(1, 2, bytes(16)).encoded()
    for name, kind in services_of():
        key = ros.node.key.data_key(name, kind.key)
        for data in chunks(chance, 9000, b"\0\1\0\0"):
            if len(data) >= 32:  # random bytes of a request's length may be a request
                session.get(key, timeout=0.2, payload=data, attachment=head)
        ros.step()
    assert ActionClient(ros, "run_mission").asked().status == GoalStatus.UNKNOWN  # all else has come
    ros.step(10)
    assert ros.still() and (ros.robot.pose.x_m, ros.robot.pose.yaw_rad) == (0.0, 0.0)
    assert ros.controls() == [] and ros.events("outcome") == []
    assert ros.call("pause").success
    ros.soon(lambda: ros.events("control"))
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.skipif(not (find_spec("rclpy") and find_spec("nav2_msgs")), reason="not installed: make ros")
def test_random_bytes_from_rclpy_on_every_topic_of_a_run_move_nothing(tmp_path, capfd):
    chance, place = np.random.default_rng(1), Place(os.getpid() % 200, by_rclpy=True)
    topics = {f"{space}/{name}": kind for name, kind in INPUTS.items() for space in ("", "/alice")}
    topics["/alice/say"] = STRING
    with run_of_alice(tmp_path, place) as ros, open_session(place) as others:
        rows, other = [(ros.node, topic, kind) for topic, kind in topics.items()], others.node("other")
        rows += [(other, f"{space}/cmd_vel", "geometry_msgs/msg/TwistStamped") for space in ("", "/alice")]
        kinds = [node.session.interface(kind, topic) for node, topic, kind in rows]
        senders = [
            node.inner.create_publisher(kind, topic, 10) for (node, topic, _), kind in zip(rows, kinds, strict=True)
        ]
        assert soon(lambda: all(each.get_subscription_count() for each in senders))
        for sender in senders:
            for number, data in enumerate(chunks(chance, 44 if "cmd_vel" in sender.topic else 9000, b"\0\1\0\0")):
                sender.publish(data)
                if number % 10 == 0:
                    ros.step()
        ros.step(10)
        assert ros.still() and (ros.robot.pose.x_m, ros.robot.pose.yaw_rad) == (0.0, 0.0)
        assert ros.controls() == [] and ros.events("outcome") == []
        assert ros.call("pause").success
        ros.soon(lambda: ros.events("control"))
    assert "Traceback" not in capfd.readouterr().err


def test_goals_and_poses_with_wrong_bytes_leave_a_run_that_answers(tmp_path, caplog):
    types, chance = ros_types(), np.random.default_rng(1)
    kinds = {"/goal_pose": POSE, "/initialpose": INPUTS["initialpose"], "/alice/say": STRING}
    messages = {"/goal_pose": stamped(0.2, 0.1), "/initialpose": initial_pose(0.0), "/alice/say": {"data": "go"}}
    through = {"goals": [stamped(0.2, 0.1), stamped(0.0, 0.1)]}
    goals = {"navigate_to_pose": {"pose": stamped(0.2, 0.1)}, "run_mission": {"sentence": "go"}}
    goals["navigate_through_poses"] = {"poses": through}

    def changed(data):
        """Bytes of a message with some others behind its header."""
        wrong = bytearray(data)
        for at in chance.integers(4, len(data), int(chance.integers(1, 6))):
            wrong[at] = int(chance.integers(0, 256))
        return bytes(wrong)

    with run_of_alice(tmp_path) as ros:
        session, head = ros.node.session.inner, Attachment(1, 2, bytes(16)).encoded()
        for _ in range(40):
            for topic, kind in kinds.items():
                message = types.message(kind)
                session.put(ros.node.key.data_key(topic, message.key), changed(message.encode(messages[topic])))
            for name, goal in goals.items():
                send = types.service(f"{ACTIONS[name]}_SendGoal")
                asked = {"goal_id": {"uuid": np.frombuffer(chance.bytes(16), np.uint8)}, "goal": goal}
                key = ros.node.key.data_key(f"/alice/{name}/_action/send_goal", send.key)
                session.get(key, timeout=0.2, payload=changed(send.request.encode(asked)), attachment=head)
            ros.step()
        assert ros.call("pause").success
        ros.soon(lambda: ros.events("refused") and ros.events("outcome"))

    assert ros.report.message == "the test is over"
    assert not [line for line in caplog.messages if "could not be handled" in line and "(InputError: " not in line]
