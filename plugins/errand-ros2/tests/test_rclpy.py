"""A served robot and a run in processes of their own, as a program with rclpy alone sees and moves them."""

import json
import os

import pytest
from rclpy_client import LATCHED, client_of, errand, interface, profile, publish_for, stamped
from ros_client import soon
from ros_run import NAVIGATE, STORED, STRING, TOPICS, documented

pytestmark = pytest.mark.mission
START, NEAR = ("9.3", "4.05", "1.57"), (9.0, 4.5)
SUCCEEDED, CANCELED = 4, 5
DOMAIN = os.getpid() % 200
ODOM, EVENTS = "nav_msgs/msg/Odometry", "/alice/events"


@pytest.fixture(scope="module")
def served():
    words = ("serve-ros2", f"rclpy:{DOMAIN}", "--world", "flat", "--start", *START, "--map", "--ground-truth")
    with errand(*words, ready="ROS 2: /alice") as said:
        yield said


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    words = ("--say", "wait for ten minutes", "--world", "flat", "--start", *START, "--no-record", "--quiet")
    out = tmp_path_factory.mktemp("out")
    with errand("run", *words, "--out", out, "--ros2", f"rclpy:{DOMAIN + 1}", ready="ROS 2: ") as said:
        yield said


@pytest.fixture
def beside(served):
    with client_of(DOMAIN) as client:
        yield client


@pytest.fixture
def client(running):
    with client_of(DOMAIN + 1) as client:
        assert soon(lambda: client.node.get_publishers_info_by_topic("/alice/odom"))
        odom = client.hear("/alice/odom", ODOM)
        assert soon(lambda: odom, 60.0)
        yield client


def offers(client, topics):
    """Topics that are not published just once, with this type and quality of service."""
    wrong = []
    for topic, kind in topics.items():
        wanted, seen = profile(topic), client.node.get_publishers_info_by_topic(topic)
        found = [(each.topic_type, each.qos_profile.durability, each.qos_profile.reliability) for each in seen]
        if found != [(kind, wanted.durability, wanted.reliability)]:
            wrong.append((topic, found))
    return wrong


def test_every_topic_of_a_served_robot_is_decoded_with_its_quality_of_service(beside):
    for topic, kind in (TOPICS | STORED).items():
        beside.hear(topic, kind)
    assert soon(lambda: all(beside.heard.values()), 60.0), [topic for topic, heard in beside.heard.items() if not heard]
    assert offers(beside, TOPICS | STORED) == []


@pytest.mark.parametrize(("kind", "speed"), [("Twist", 0.3), ("TwistStamped", -0.3)])
def test_a_served_robot_drives_by_both_types_of_velocity(beside, kind, speed):
    made, odom = interface(f"geometry_msgs/msg/{kind}"), beside.hear("/alice/odom", ODOM)
    command = beside.node.create_publisher(made, "/alice/cmd_vel", 10)
    assert soon(lambda: odom and command.get_subscription_count())

    def velocity():
        message = made()
        if kind == "TwistStamped":
            message.header.stamp = odom[-1].header.stamp
        getattr(message, "twist", message).linear.x = speed
        return message

    publish_for(command, velocity, 1.0)
    assert odom[-1].twist.twist.linear.x == pytest.approx(speed, abs=0.15)
    assert soon(lambda: abs(odom[-1].twist.twist.linear.x) < 0.05, 3.0)


def test_a_goal_of_the_arm_that_is_refused_is_told_with_its_reason(served, beside):
    kind = "control_msgs/action/FollowJointTrajectory"
    goal = interface(kind).Goal()
    goal.trajectory.joint_names = ["elbow"]
    assert not beside.send(beside.action("/alice/arm_controller/follow_joint_trajectory", kind), goal).accepted
    assert soon(lambda: any("is refused: the trajectory moves elbow" in line for line in served))


def test_a_run_says_its_wire_in_one_line(running):
    assert [line for line in running if "rclpy with" in line] == [
        f"ROS 2: domain {DOMAIN + 1}, rclpy with rmw_fastrtps_cpp\n"
    ]


def test_every_topic_of_a_run_is_offered_as_the_manual_says(client):
    topics = documented("Published")
    assert soon(lambda: not offers(client, topics), 10.0), offers(client, topics)
    for topic in LATCHED - {"/alice/object_to_detect", "/alice/object_destination"}:
        client.hear(topic, topics[topic])
    assert soon(lambda: all(client.heard.values()), 30.0), client.heard.keys()


def wall_of(client):
    """A point in an obstacle of the map."""
    grids = client.hear("/map", "nav_msgs/msg/OccupancyGrid")
    assert soon(lambda: grids)
    info = grids[0].info
    row, column = divmod(list(grids[0].data).index(100), info.width)
    x, y = ((cell + 0.5) * info.resolution for cell in (column, row))
    return info.origin.position.x + x, info.origin.position.y + y


def goal_at(x, y):
    goal = interface(NAVIGATE).Goal()
    goal.pose = stamped(x, y)
    return goal


def test_a_run_reaches_a_goal_with_feedback_and_rejects_one_in_a_wall_with_its_reason(client):
    events, feedback = client.hear(EVENTS, STRING), []
    navigate = client.action("/alice/navigate_to_pose", NAVIGATE)
    wall = goal_at(*wall_of(client))
    assert soon(lambda: not client.send(navigate, wall).accepted and events)  # the run may not know of us at once
    assert "lies in an obstacle" in json.loads(events[-1].data)["message"]
    goal = client.send(navigate, goal_at(*NEAR), feedback.append)
    assert goal.accepted
    assert client.result_of(goal.get_result_async(), 60.0).status == SUCCEEDED
    assert feedback[0].feedback.distance_remaining > 0.1


def test_a_cancelled_goal_ends_and_the_base_stands(client):
    goal = client.send(client.action("/alice/navigate_to_pose", NAVIGATE), goal_at(6.0, 4.5))
    odom = client.heard["/alice/odom"]
    assert soon(lambda: abs(odom[-1].twist.twist.linear.x) > 0.2)
    ended = goal.get_result_async()
    assert client.result_of(goal.cancel_goal_async()).goals_canceling
    assert client.result_of(ended).status == CANCELED
    assert soon(lambda: abs(odom[-1].twist.twist.linear.x) < 0.05, 3.0)


def test_a_run_answers_what_nav2_simple_commander_asks_and_obeys_services(client):
    for name in ("/amcl", "/bt_navigator", "/alice/amcl", "/alice/bt_navigator"):
        state = client.call(f"{name}/get_state", "lifecycle_msgs/srv/GetState").current_state
        assert (state.id, state.label) == (3, "active")
    kind = "rcl_interfaces/srv/GetParameters"
    assert client.call("/alice/errand/get_parameters", kind, names=["use_sim_time"]).values[0].type == 1
    for name in ("pause", "resume"):
        assert client.call(f"/alice/{name}", "std_srvs/srv/Trigger").success
