"""A run of a scripted robot as a system of ROS 2: goals, cancelling, velocities, sentences, services, odd input."""

import math
import uuid
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_run import (
    HEARD,
    NAVIGATE,
    POSE,
    STRING,
    THROUGH,
    TWIST,
    ActionClient,
    PartClient,
    RealBridge,
    run_of_alice,
    stamped,
    text,
    twist,
)

from errand_ros2.bridge import observe
from errand_ros2.wire.actions import GoalStatus
from errand_ros2.wire.types import LATCHED, older_types, ros_types
from errand_ros2.wire.zenoh_node import ZenohClient
from executive.run.control import Control
from skills.inputs.errors import InputError
from skills.navigate.follower import FollowerOptions

TRAJECTORY = "control_msgs/action/FollowJointTrajectory"
ARM_RAD = [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]


def test_a_run_publishes_clock_pose_plan_map_events_and_diagnostics(ros):
    for topic, kind in HEARD.items():
        ros.hear(topic, kind)
    for topic, kind in {"/map": "nav_msgs/msg/OccupancyGrid", "/alice/robot_description": STRING}.items():
        ros.hear(topic, kind, LATCHED)
    clock = ros.hear("/clock", "rosgraph_msgs/msg/Clock")
    ros.tell("/goal_pose", POSE, stamped(0.3, -0.6))
    ros.soon(lambda: ros.events("outcome"))
    ros.soon(lambda: len(clock) > 1 and all(ros.heard[topic] for topic in HEARD))
    heard = {topic: messages[-1] for topic, messages in ros.heard.items() if messages}
    assert (heard["/clock"].clock.sec, heard["/clock"].clock.nanosec) > (clock[0].clock.sec, clock[0].clock.nanosec)
    assert heard["/diagnostics"].status[0].hardware_id == "Alice"
    assert heard["/alice/plan"].poses[-1].pose.position.y == pytest.approx(-0.6, abs=0.1)
    assert heard["/alice/amcl_pose"].pose.pose.position.y == pytest.approx(-0.6, abs=0.1)
    assert max(heard["/alice/local_costmap/costmap"].data) == 100
    whole, known = heard["/alice/global_costmap/costmap"].info, heard["/map"].info
    assert whole.origin.position == known.origin.position
    assert whole.width * whole.resolution == pytest.approx(known.width * known.resolution, abs=0.1)
    assert [each.pose.position.x for each in heard["/alice/particle_cloud"].particles] == [0.5, 0.7]
    assert known.resolution == pytest.approx(0.025)
    assert "<robot" in heard["/alice/robot_description"].data


def test_a_run_in_real_time_reaches_a_goal_stops_at_a_cancelled_one_and_outlives_velocities(tmp_path):
    with run_of_alice(tmp_path, pace=RealBridge) as ros:
        begun_s, (near, far) = ros.bridge.now(), (ActionClient(ros, "navigate_to_pose") for _ in range(2))
        near.goal.pose, far.goal.pose = stamped(0.3, 0.0), stamped(-0.6, 1.2)
        assert near.send() and near.result().status == GoalStatus.SUCCEEDED
        assert ros.bridge.now() - begun_s > 0.3 / FollowerOptions().max_speed_m_s
        assert far.send()
        ros.soon(lambda: not ros.still())
        assert far.cancel() == 0
        assert ros.soon(ros.still) < 0.4
        command = ros.publisher("/cmd_vel", TWIST)
        ros.soon(lambda: command.put(twist(0.0, 0.5)) or abs(ros.robot.velocity[2] - 0.5) < 0.05)
        assert ros.soon(ros.still) < 0.6
        ros.soon(lambda: ros.controls()[-2:] == ["pause", "resume"])
    assert (ros.report.outcome, ros.report.message) == ("cancelled", "the test is over")


def test_a_goal_of_navigate_to_pose_is_reached(ros):
    action = ActionClient(ros, "navigate_to_pose").follow()
    action.goal.pose = stamped(0.6, -1.2)
    assert action.send()
    result = action.result()
    assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
    assert math.hypot(ros.robot.pose.x_m - 0.6, ros.robot.pose.y_m + 1.2) < 0.15
    assert action.feedback[0].feedback.distance_remaining > 0.5
    assert action.cancel() == 3  # it has ended


def test_a_client_of_an_older_distribution_gets_the_result_in_its_form(ros):
    action, older = ActionClient(ros, "navigate_to_pose"), older_types().service(f"{NAVIGATE}_GetResult")
    assert older.key != ros_types().service(f"{NAVIGATE}_GetResult").key
    action.goal.pose = stamped(0.3, 0.0)
    assert action.send()
    client = ZenohClient(ros.node, "/alice/navigate_to_pose/_action/get_result", older)
    result = ros.meanwhile(lambda: client.call({"goal_id": action.identity}, limit_s=60.0))
    assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
    assert not hasattr(result.result, "error_msg")


def test_a_goal_of_navigate_through_poses_passes_them_in_order(ros):
    action = ActionClient(ros, "navigate_through_poses").follow()
    action.goal.poses.goals = [stamped(0.3, -0.5), stamped(-0.4, -0.5), stamped(-0.4, 0.3)]
    assert action.send()
    result = action.result()
    assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
    assert math.hypot(ros.robot.pose.x_m + 0.4, ros.robot.pose.y_m - 0.3) < 0.15
    left = [each.feedback.number_of_poses_remaining for each in action.feedback]
    assert left == sorted(left, reverse=True) and {1, 2, 3} == {*left}
    far_m = [each.feedback.distance_remaining for each in action.feedback]
    assert far_m[0] > 1.5 and far_m[-1] < 0.8


def test_a_client_of_jazzy_sends_poses_in_its_form(ros):
    send = older_types().service(f"{THROUGH}_SendGoal")
    identity = {"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)}
    client = ZenohClient(ros.node, "/alice/navigate_through_poses/_action/send_goal", send)
    poses = [stamped(0.3, 0.0), stamped(0.3, -0.3)]
    assert client.call({"goal_id": identity, "goal": {"poses": poses}}, limit_s=20.0).accepted
    ros.soon(lambda: ros.events("outcome"))
    assert ros.robot.pose.y_m == pytest.approx(-0.3, abs=0.1)


def test_detections_are_boxes_in_pixels(ros):
    heard = ros.hear("/alice/detections", "vision_msgs/msg/Detection2DArray")
    ros.soon(lambda: ros.bridge._robots["Alice"].out["detections"].is_heard)
    found = [{"class_name": "coke", "score": 0.9, "box": [10, 20, 30, 60], "class_id": 3, "surface": ""}]
    ros.bridge.message("detections", {"stamp_s": 2.5, "source": "hand", "detections": found, "image": None})
    ros.soon(lambda: heard)
    assert (heard[0].header.frame_id, heard[0].header.stamp.nanosec) == ("alice/hand_camera", 500_000_000)
    (each,) = heard[0].detections
    assert (each.results[0].hypothesis.class_id, each.results[0].hypothesis.score) == ("coke", 0.9)
    assert (each.bbox.center.position.x, each.bbox.center.position.y) == (20.0, 40.0)
    assert (each.bbox.size_x, each.bbox.size_y) == (20.0, 40.0)


def test_a_viewer_asks_for_the_tree_and_sees_its_changes(ros):
    kind = "py_trees_ros_interfaces/srv/OpenSnapshotStream"
    opened = ros.node.client("/alice/tree/snapshot_streams/open", kind).call({}, limit_s=5.0)
    heard = ros.hear(opened.topic_name, "py_trees_ros_interfaces/msg/BehaviourTree", LATCHED)
    ros.soon(lambda: heard)
    assert [each.name for each in heard[0].behaviours if each.is_active][-1].startswith("wait")
    ros.tell("/goal_pose", POSE, stamped(0.3, -0.6))
    ros.soon(lambda: any("navigate" in each.name for each in heard[-1].behaviours if each.is_active))
    before = len(heard)
    ros.soon(lambda: ros.events("outcome"))
    assert 0 < len(heard) - before < 60


def test_things_and_people_that_are_seen_are_markers(ros):
    heard, kind = defaultdict(list), "visualization_msgs/msg/MarkerArray"
    for topic in ("objects", "people"):
        ros.node.subscribe(f"/alice/{topic}", kind, heard[topic].append)
        ros.soon(lambda topic=topic: ros.bridge._robots["Alice"].out[topic].is_heard)
    tracks = [
        {"class_name": name, "position_W": [1.0, 2.0, 0.8], "confirmed": sure}
        for name, sure in (("coke", True), ("beer", False))
    ]
    ros.bridge.message("tracks", {"stamp": 2.5, "robot_name": "Alice", "tracks": tracks})
    ros.bridge.message("people", {"stamp": 2.5, "robot": "Alice", "people": [{"position_W": [3.0, 1.0]}]})
    ros.soon(lambda: heard["objects"] and heard["people"])
    assert [each.text for each in heard["objects"][0].markers if each.text] == ["coke"]
    (person,) = (each for each in heard["people"][0].markers if each.text)
    assert (person.text, person.pose.position.x) == ("person", 3.0)


def test_commands_and_wanted_objects_are_typed_messages(ros):
    heard, kinds = defaultdict(list), {"task_channel": "TaskMessage", "object_to_detect": "ObjectToDetect"}
    kinds["object_destination"] = "ObjectDestination"
    for topic, kind in kinds.items():
        ros.node.subscribe(f"/alice/{topic}", f"errand_msgs/msg/{kind}", heard[topic].append)
        ros.soon(lambda topic=topic: ros.bridge._robots["Alice"].out[topic].is_heard)
    action = ActionClient(ros, "run_mission")
    action.goal.sentence = "go to the table"
    assert action.send()
    ros.soon(lambda: heard["task_channel"])
    task, late = heard["task_channel"][0], []
    ros.node.subscribe("/alice/task_channel", "errand_msgs/msg/TaskMessage", late.append, LATCHED)
    ros.soon(lambda: late)  # a late subscription gets it, too
    assert (task.robot_name, task.mission_count, task.task_count, task.cmd_type) == ("Alice", 1, 1, 0)
    assert (task.item_type.tolist(), task.obj_type.tolist()) == ([0], [0])
    assert math.isfinite(task.goal_x)
    told = {"stamp": 2.5, "robot_name": "Alice", "class_id": [3, 4], "class_name": ["coke", "beer"]}
    ros.bridge.message("object_to_detect", told)
    place = {f"goal_{axis}": value for axis, value in zip("xyz", (1.0, 2.0, 0.5), strict=True)}
    ros.bridge.message("object_destination", {"stamp": 2.5, "sequence": 2500, "class_name": "coke", **place})
    ros.soon(lambda: heard["object_destination"] and heard["object_to_detect"])  # topics keep no common order
    wanted, found = heard["object_to_detect"][0], heard["object_destination"][0]
    assert (wanted.class_id.tolist(), wanted.class_name, wanted.stamp.sec) == ([3, 4], ["coke", "beer"], 2)
    assert (found.class_name, found.sequence, found.goal_y) == ("coke", 2500, 2.0)


def test_a_cancelled_goal_stops_the_robot(ros):
    action = ActionClient(ros, "navigate_to_pose")
    action.goal.pose = stamped(0.6, -1.2)
    assert action.send()
    ros.soon(lambda: abs(ros.robot.velocity[0]) > 0.3)
    assert action.cancel() == 0
    assert ros.soon(ros.still) < 0.4
    result = action.result()
    assert result.status == GoalStatus.CANCELED
    assert "cancelled by its client" in result.result.error_msg


# Frames of a goal half a metre ahead and to the left of the body, whose yaw is 0 there.
@pytest.mark.parametrize("frame", ["alice/odom", "alice/body", "/alice/base_link"])
def test_a_goal_in_a_frame_of_the_robot_is_where_that_frame_has_it(ros, frame):
    here, action = ros.robot.pose, ActionClient(ros, "navigate_to_pose")
    action.goal.pose = stamped(-0.5, 0.5, frame=frame)
    assert action.send()
    assert action.result().status == GoalStatus.SUCCEEDED
    assert (ros.robot.pose.x_m - here.x_m, ros.robot.pose.y_m - here.y_m) == pytest.approx((-0.5, 0.5), abs=0.1)


def test_a_new_goal_takes_the_place_of_the_one_before(ros):
    first, second = (ActionClient(ros, "navigate_to_pose") for _ in range(2))
    first.goal.pose, second.goal.pose = stamped(0.6, -1.2), stamped(-0.6, 1.2)
    assert first.send()
    assert second.send()
    assert first.result().status == GoalStatus.ABORTED
    assert second.result().status == GoalStatus.SUCCEEDED
    assert ros.robot.pose.y_m == pytest.approx(1.2, abs=0.15)


def test_a_goal_too_near_to_an_obstacle_fails_with_its_cause_and_no_motion(ros):
    action = ActionClient(ros, "navigate_to_pose")
    action.goal.pose = stamped(1.1, 0.0)  # just before the table
    assert action.send()
    result = action.result()
    assert result.status == GoalStatus.ABORTED
    assert result.result.error_msg.startswith("PLANNING: ")
    assert ros.robot.pose.x_m == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (stamped(math.nan, 0.0), "not finite"),
        (stamped(1e9, 0.0), "not on the map"),
        (stamped(1.5, 0.0), "in an obstacle"),  # under the table
        (stamped(0.0, 0.0, frame="mars"), "no frame 'mars'"),
        (stamped(0.0, 0.0, w=0.0), "quaternion"),
    ],
)
def test_a_goal_that_is_none_is_rejected_with_a_reason(ros, goal, why):
    action = ActionClient(ros, "navigate_to_pose")
    action.goal.pose = goal
    assert not action.send()
    assert action.result().status == GoalStatus.UNKNOWN
    ros.tell("/goal_pose", POSE, goal)
    ros.soon(lambda: len(ros.events("refused")) == 2)
    assert all(why in each["message"] for each in ros.events("refused"))
    assert ros.still()


def test_a_mission_of_a_sentence_runs_with_feedback(ros):
    action = ActionClient(ros, "run_mission").follow()
    action.goal.sentence = "wait for two seconds"
    assert action.send()
    result = action.result()
    assert (result.status, result.result.outcome) == (GoalStatus.SUCCEEDED, "success")
    assert action.feedback[-1].feedback.step.startswith("alice/ros2-goal-1")


@pytest.mark.parametrize(
    ("sentence", "file"), [("", ""), ("go", "x.yaml"), ("colourless ideas", ""), ("", "absent.yaml")]
)
def test_a_mission_that_is_none_is_rejected(ros, sentence, file):
    action = ActionClient(ros, "run_mission")
    action.goal.sentence, action.goal.file = sentence, file
    assert not action.send()
    ros.soon(lambda: ros.events("refused"))


def test_velocities_pause_the_mission_and_their_end_resumes_it(ros):
    command = ros.publisher("/cmd_vel", TWIST)
    for _ in range(20):
        ros.put(command, twist(0.0, 0.5))
        ros.step()
    assert ros.robot.velocity[2] == pytest.approx(0.5, abs=0.05)
    assert ros.soon(ros.still) < 0.6
    assert ros.controls() == ["pause"]
    assert 0.4 < ros.soon(lambda: ros.controls() == ["pause", "resume"]) < 1.5


def arm_goal(ros, seconds):
    """An action of the arm whose goal takes some seconds."""
    action = PartClient(ros, "arm_controller/follow_joint_trajectory", TRAJECTORY)
    points = [{"positions": ARM_RAD, "time_from_start": {"sec": seconds, "nanosec": 0}}]
    names = [*ros.robot.capabilities().arm.joint_names]
    action.goal.trajectory = ros_types().make("trajectory_msgs/msg/JointTrajectory", joint_names=names, points=points)
    return action


def test_a_trajectory_moves_the_arm_while_the_mission_is_paused(ros):
    action = arm_goal(ros, 1).follow()
    assert action.send()
    result = action.result()
    assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
    assert ros.robot.q_rad == pytest.approx(ARM_RAD, abs=0.02)
    told = [each.feedback.actual.positions for each in action.feedback]
    assert len(told) >= 8 and told[-1] == pytest.approx(ARM_RAD, abs=0.3)
    ros.soon(lambda: ros.controls() == ["pause", "resume"])


def test_a_trajectory_whose_stamp_has_passed_goes_on_from_where_it_would_be_and_one_that_has_ended_is_rejected(ros):
    now_s, late = ros.robot.joints().stamp_s, arm_goal(ros, 3)
    late.goal.trajectory.header.stamp.sec = int(now_s) - 1
    begun_s = ros.bridge.now()
    assert late.send()
    assert late.result().status == GoalStatus.SUCCEEDED
    assert ros.bridge.now() - begun_s < 2.8
    ended = arm_goal(ros, 1)
    ended.goal.trajectory.header.stamp.sec = 1 + int(ros.bridge.now()) - 5
    assert not ended.send()


@pytest.mark.parametrize("frame", ["alice/base_link", "alice/frontleft_camera_optical", "alice/hand", "alice/lidar"])
def test_a_goal_in_any_frame_that_the_robot_carries_is_accepted(ros, frame):
    action = ActionClient(ros, "navigate_to_pose")
    action.goal.pose = stamped(0.0, 0.0, frame)
    assert action.send()


@pytest.mark.parametrize("name", ["/amcl", "/alice/amcl", "/bt_navigator", "/alice/bt_navigator"])
def test_nodes_of_nav2_are_active_while_a_mission_lasts(ros, name):
    kind = "lifecycle_msgs/srv/GetState"
    assert ros.node.client(f"{name}/get_state", kind).call({}, limit_s=5.0).current_state.label == "active"


def test_the_force_of_the_gripper_is_told_in_the_frame_of_the_hand(ros):
    force, tf = (
        ros.hear("/alice/gripper/force", "geometry_msgs/msg/WrenchStamped"),
        ros.hear("/tf", "tf2_msgs/msg/TFMessage"),
    )
    ros.soon(lambda: force and tf)
    assert force[-1].header.frame_id == "alice/hand"
    (hand,) = (each for each in tf[-1].transforms if each.child_frame_id == "alice/hand")
    assert hand.header.frame_id == "alice/body" and hand.transform.translation.x != 0.0


def test_a_trajectory_of_other_joints_is_rejected(ros):
    action = PartClient(ros, "arm_controller/follow_joint_trajectory", TRAJECTORY)
    action.goal.trajectory.joint_names = ["elbow"]
    assert not action.send()


def test_a_cancelled_trajectory_stops_the_arm(ros):
    action = arm_goal(ros, 20)
    assert action.send()
    ros.soon(lambda: "move_arm" in ros.robot.moving_parts)
    action.cancel()
    assert action.result().status == GoalStatus.CANCELED
    assert "move_arm" not in ros.robot.moving_parts


def test_the_gripper_is_opened_and_tells_its_opening(ros):
    action = PartClient(ros, "gripper_controller/gripper_cmd", "control_msgs/action/GripperCommand")
    action.goal.command.position = -0.8  # the joint's angle, as in joint_states
    assert action.send()
    result = action.result()
    assert result.status == GoalStatus.SUCCEEDED
    assert (result.result.position, result.result.reached_goal) == (pytest.approx(-0.8, abs=0.02), True)


@pytest.mark.parametrize("short_rad", [0.2, -0.2])
def test_a_gripper_that_ends_short_of_its_goal_has_stalled(ros, monkeypatch, short_rad):
    action, read = (
        PartClient(ros, "gripper_controller/gripper_cmd", "control_msgs/action/GripperCommand"),
        ros.robot.gripper,
    )
    monkeypatch.setattr(ros.robot, "gripper", lambda: replace(read(), opening=read().opening + short_rad))
    action.goal.command.position = -0.8
    assert action.send()
    result = action.result().result
    assert (result.stalled, result.reached_goal) == (True, False)


def test_velocities_do_not_drive_the_robot_into_a_wall(ros):
    command = ros.publisher("/alice/cmd_vel", TWIST)
    for _ in range(80):
        ros.put(command, twist(0.6))  # the table stands 1.2 m ahead
        ros.step()
    assert 0.05 < ros.robot.pose.x_m < 0.65


def test_a_sentence_is_answered(ros):
    ros.tell("/alice/say", STRING, text("what do you do?"))
    ros.soon(lambda: ros.heard["/alice/reply"])
    assert ros.heard["/alice/reply"][0].data


def test_a_question_is_answered_from_the_run(ros):
    ros.tell("/alice/say", STRING, text("what are you doing?"))
    ros.soon(lambda: ros.heard["/alice/reply"])
    assert "not begun" not in ros.heard["/alice/reply"][0].data
    assert "wait" in ros.heard["/alice/reply"][0].data


def test_a_run_beside_another_in_one_domain_is_refused(ros):
    with pytest.raises(InputError, match="/clock is published in domain 0 already"):
        observe(f"0@{ros.place.host}:{ros.place.port}")(ros.prepared, Control(pace=None))


def test_services_pause_resume_and_cancel_which_ends_the_mission_and_a_goal_of_the_arm(tmp_path):
    with run_of_alice(tmp_path) as ros:
        for name in ("pause", "resume", "step", "resume"):
            assert ros.call(name).success, name
        arm = arm_goal(ros, 60)
        assert arm.send()
        ros.soon(lambda: "move_arm" in ros.robot.moving_parts)
        with ThreadPoolExecutor(1) as pool:
            asked = pool.submit(arm.asked)
            assert ros.call("cancel").success
            ros.soon(asked.done)
        assert asked.result().status == GoalStatus.ABORTED
        ros.soon(lambda: ros.events("outcome"))
        assert (ros.controls()[0], ros.controls()[-1]) == ("pause", "cancel")
    assert ros.report.message == "cancelled by ROS 2"


@pytest.mark.parametrize("value", ["x", "300", "0@:99999"])
def test_a_domain_that_is_none_is_refused_at_once(value):
    with pytest.raises(InputError):
        observe(value)
