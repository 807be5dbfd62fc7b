"""A run of a scripted robot as a system of ROS 2: goals, cancelling, velocities, sentences, services, odd input."""

import math
import threading
import time
import uuid
from collections import defaultdict

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_run import HEARD, NAVIGATE, POSE, RUN, STRING, THROUGH, TWIST, ActionClient, stamped, text, twist

from errand_ros2.bridge import observe
from errand_ros2.wire.actions import GoalStatus
from errand_ros2.wire.node import Client
from errand_ros2.wire.types import LATCHED, older_types, ros_types
from executive.run.control import Control
from skills.inputs.errors import InputError

TRAJECTORY = "control_msgs/action/FollowJointTrajectory"
ARM_RAD = [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]


def test_a_run_publishes_clock_pose_plan_map_events_and_diagnostics(talk):
    def says(ros):
        late = defaultdict(list)
        for topic, kind in (("/map", "nav_msgs/msg/OccupancyGrid"), ("/alice/robot_description", STRING)):
            ros.node.subscribe(topic, kind, late[topic].append, LATCHED)
        ros.publisher("/goal_pose", POSE).put(stamped(0.6, -1.2))
        ros.soon(lambda: ros.events("outcome"))
        ros.soon(lambda: all(ros.heard[topic] for topic in HEARD if topic != "/alice/reply"))
        first, last = ros.heard["/clock"][0].clock, ros.heard["/clock"][-1].clock
        assert (last.sec, last.nanosec) > (first.sec, first.nanosec)
        assert ros.heard["/diagnostics"][-1].status[0].hardware_id == "Alice"
        assert ros.heard["/alice/plan"][-1].poses[-1].pose.position.y == pytest.approx(-1.2, abs=0.1)
        assert ros.heard["/alice/amcl_pose"][-1].pose.pose.position.y == pytest.approx(-1.2, abs=0.1)
        assert max(ros.heard["/alice/local_costmap/costmap"][-1].data) == 100
        whole, known = ros.heard["/alice/global_costmap/costmap"][-1].info, late["/map"][0].info
        assert whole.origin.position == known.origin.position
        assert whole.width * whole.resolution == pytest.approx(known.width * known.resolution, abs=0.1)
        assert [each.pose.position.x for each in ros.heard["/alice/particle_cloud"][-1].particles] == [0.5, 0.7]
        assert late["/map"][0].info.resolution == pytest.approx(0.025)
        assert "<robot" in late["/alice/robot_description"][0].data

    report = talk(says)
    assert (report.outcome, report.message) == ("cancelled", "the test is over")


def test_a_goal_of_navigate_to_pose_is_reached(talk):
    def says(ros):
        action = ActionClient(ros, "navigate_to_pose", NAVIGATE)
        action.goal.pose = stamped(0.6, -1.2)
        assert action.send()
        result = action.result()
        assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
        assert math.hypot(ros.robot.pose.x_m - 0.6, ros.robot.pose.y_m + 1.2) < 0.15
        assert action.feedback[0].feedback.distance_remaining > 0.5
        assert action.cancel() == 3  # it has ended

    talk(says)


def test_a_client_of_an_older_distribution_gets_the_result_in_its_form(talk):
    def says(ros):
        action, older = ActionClient(ros, "navigate_to_pose", NAVIGATE), older_types().service(f"{NAVIGATE}_GetResult")
        assert older.key != action.kind.get_result.key
        action.goal.pose = stamped(0.3, 0.0)
        assert action.send()
        client = Client(ros.node, "/alice/navigate_to_pose/_action/get_result", older)
        result = client.call({"goal_id": action.identity}, limit_s=60.0)
        assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
        assert not hasattr(result.result, "error_msg")

    talk(says)


def test_a_goal_of_navigate_through_poses_passes_them_in_order(talk):
    def says(ros):
        action = ActionClient(ros, "navigate_through_poses", THROUGH)
        action.goal.poses.goals = [stamped(0.3, -0.5), stamped(-0.4, -0.5), stamped(-0.4, 0.3)]
        assert action.send()
        result = action.result()
        assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
        assert math.hypot(ros.robot.pose.x_m + 0.4, ros.robot.pose.y_m - 0.3) < 0.15
        left = [each.feedback.number_of_poses_remaining for each in action.feedback]
        assert left == sorted(left, reverse=True) and {1, 2, 3} == {*left}
        far_m = [each.feedback.distance_remaining for each in action.feedback]
        assert far_m[0] > 1.5 and far_m[-1] < 0.8

    talk(says)


def test_a_client_of_jazzy_sends_poses_in_its_form(talk):
    def says(ros):
        send = older_types().service(f"{THROUGH}_SendGoal")
        identity = {"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)}
        client = Client(ros.node, "/alice/navigate_through_poses/_action/send_goal", send)
        poses = [stamped(0.3, 0.0), stamped(0.3, -0.3)]
        assert client.call({"goal_id": identity, "goal": {"poses": poses}}, limit_s=20.0).accepted
        ros.soon(lambda: ros.events("outcome"), 60.0)
        assert ros.robot.pose.y_m == pytest.approx(-0.3, abs=0.1)

    talk(says)


def test_detections_are_boxes_in_pixels(talk):
    def says(ros):
        heard = []
        ros.node.subscribe("/alice/detections", "vision_msgs/msg/Detection2DArray", heard.append)
        ros.soon(lambda: ros.bridge._robots["Alice"].out["detections"].is_heard)
        found = [{"class_name": "coke", "score": 0.9, "box": [10, 20, 30, 60], "class_id": 3, "surface": ""}]
        ros.bridge.message("detections", {"stamp_s": 2.5, "source": "hand", "detections": found, "image": None})
        ros.soon(lambda: heard)
        assert (heard[0].header.frame_id, heard[0].header.stamp.nanosec) == ("alice/hand_camera", 500_000_000)
        (each,) = heard[0].detections
        assert (each.results[0].hypothesis.class_id, each.results[0].hypothesis.score) == ("coke", 0.9)
        assert (each.bbox.center.position.x, each.bbox.center.position.y) == (20.0, 40.0)
        assert (each.bbox.size_x, each.bbox.size_y) == (20.0, 40.0)

    talk(says)


def test_a_viewer_asks_for_the_tree_and_sees_its_changes(talk):
    def says(ros):
        kind, heard = "py_trees_ros_interfaces/srv/OpenSnapshotStream", []
        opened = Client(ros.node, "/alice/tree/snapshot_streams/open", ros_types().service(kind)).call({}, limit_s=5.0)
        ros.node.subscribe(opened.topic_name, "py_trees_ros_interfaces/msg/BehaviourTree", heard.append, LATCHED)
        ros.soon(lambda: heard)
        assert [each.name for each in heard[0].behaviours if each.is_active][-1].startswith("wait")
        ros.publisher("/goal_pose", POSE).put(stamped(0.6, -1.2))
        ros.soon(lambda: any("navigate" in each.name for each in heard[-1].behaviours if each.is_active))
        before = len(heard)
        ros.soon(lambda: ros.events("outcome"))
        assert 0 < len(heard) - before < 60

    talk(says)


def test_things_and_people_that_are_seen_are_markers(talk):
    def says(ros):
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

    talk(says)


def test_commands_and_wanted_objects_are_typed_messages(talk):
    def says(ros):
        heard, kinds = defaultdict(list), {"task_channel": "TaskMessage", "object_to_detect": "ObjectToDetect"}
        kinds["object_destination"] = "ObjectDestination"
        for topic, kind in kinds.items():
            ros.node.subscribe(f"/alice/{topic}", f"errand_msgs/msg/{kind}", heard[topic].append)
            ros.soon(lambda topic=topic: ros.bridge._robots["Alice"].out[topic].is_heard)
        action = ActionClient(ros, "run_mission", RUN)
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
        ros.soon(lambda: heard["object_destination"])
        wanted, found = heard["object_to_detect"][0], heard["object_destination"][0]
        assert (wanted.class_id.tolist(), wanted.class_name, wanted.stamp.sec) == ([3, 4], ["coke", "beer"], 2)
        assert (found.class_name, found.sequence, found.goal_y) == ("coke", 2500, 2.0)

    talk(says)


def test_a_cancelled_goal_stops_the_robot(talk):
    def says(ros):
        action = ActionClient(ros, "navigate_to_pose", NAVIGATE)
        action.goal.pose = stamped(0.6, -1.2)
        assert action.send()
        ros.soon(lambda: abs(ros.robot.velocity[0]) > 0.3)
        assert action.cancel() == 0
        begun_s = time.monotonic()
        result = action.result()
        assert result.status == GoalStatus.CANCELED
        assert "cancelled by its client" in result.result.error_msg
        ros.soon(ros.still, 1.0)
        assert time.monotonic() - begun_s < 0.4

    talk(says)


def test_a_new_goal_takes_the_place_of_the_one_before(talk):
    def says(ros):
        first, second = (ActionClient(ros, "navigate_to_pose", NAVIGATE) for _ in range(2))
        first.goal.pose, second.goal.pose = stamped(0.6, -1.2), stamped(-0.6, 1.2)
        assert first.send()
        assert second.send()
        assert first.result().status == GoalStatus.ABORTED
        assert second.result().status == GoalStatus.SUCCEEDED
        assert ros.robot.pose.y_m == pytest.approx(1.2, abs=0.15)

    talk(says)


def test_a_goal_in_an_obstacle_fails_with_its_cause_and_no_motion(talk):
    def says(ros):
        action = ActionClient(ros, "navigate_to_pose", NAVIGATE)
        action.goal.pose = stamped(1.5, 0.0)  # under the table
        assert action.send()
        result = action.result()
        assert result.status == GoalStatus.ABORTED
        assert result.result.error_msg.startswith("PLANNING: ")
        assert ros.robot.pose.x_m == pytest.approx(0.0, abs=0.01)

    talk(says)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (stamped(math.nan, 0.0), "not finite"),
        (stamped(1e9, 0.0), "not on the map"),
        (stamped(0.0, 0.0, frame="mars"), "no frame 'mars'"),
        (stamped(0.0, 0.0, w=0.0), "quaternion"),
    ],
)
def test_a_goal_that_is_none_is_rejected_with_a_reason(talk, goal, why):
    def says(ros):
        action = ActionClient(ros, "navigate_to_pose", NAVIGATE)
        action.goal.pose = goal
        assert not action.send()
        assert action.result().status == GoalStatus.UNKNOWN
        ros.publisher("/goal_pose", POSE).put(goal)
        ros.soon(lambda: len(ros.events("refused")) == 2)
        assert all(why in each["message"] for each in ros.events("refused"))
        assert ros.still()

    talk(says)


def test_a_mission_of_a_sentence_runs_with_feedback(talk):
    def says(ros):
        action = ActionClient(ros, "run_mission", RUN)
        action.goal.sentence = "wait for two seconds"
        assert action.send()
        result = action.result()
        assert (result.status, result.result.outcome) == (GoalStatus.SUCCEEDED, "success")
        assert action.feedback[-1].feedback.step.startswith("alice/ros2-goal-1")

    talk(says)


@pytest.mark.parametrize(
    ("sentence", "file"), [("", ""), ("go", "x.yaml"), ("colourless ideas", ""), ("", "absent.yaml")]
)
def test_a_mission_that_is_none_is_rejected(talk, sentence, file):
    def says(ros):
        action = ActionClient(ros, "run_mission", RUN)
        action.goal.sentence, action.goal.file = sentence, file
        assert not action.send()
        ros.soon(lambda: ros.events("refused"))

    talk(says)


def test_velocities_pause_the_mission_and_their_end_resumes_it(talk):
    def says(ros):
        command = ros.publisher("/cmd_vel", TWIST)
        for _ in range(20):
            command.put(twist(0.0, 0.5))
            time.sleep(0.05)
        assert ros.robot.velocity[2] == pytest.approx(0.5, abs=0.05)
        silent_s = time.monotonic()
        ros.soon(ros.still, 2.0)
        assert time.monotonic() - silent_s < 0.6
        ros.soon(lambda: [each["what"] for each in ros.events("control")] == ["pause", "resume"], 5.0)

    talk(says)


def arm_goal(ros, seconds):
    """An action of the arm whose goal takes some seconds."""
    action = ActionClient(ros, "arm_controller/follow_joint_trajectory", TRAJECTORY)
    points = [{"positions": ARM_RAD, "time_from_start": {"sec": seconds, "nanosec": 0}}]
    names = [*ros.robot.capabilities().arm.joint_names]
    action.goal.trajectory = ros_types().make("trajectory_msgs/msg/JointTrajectory", joint_names=names, points=points)
    return action


def test_a_trajectory_moves_the_arm_while_the_mission_is_paused(talk):
    def says(ros):
        action = arm_goal(ros, 1)
        assert action.send()
        result = action.result()
        assert (result.status, result.result.error_code) == (GoalStatus.SUCCEEDED, 0)
        assert ros.robot.q_rad == pytest.approx(ARM_RAD, abs=0.02)
        ros.soon(lambda: [each["what"] for each in ros.events("control")] == ["pause", "resume"], 5.0)

    talk(says)


def test_a_trajectory_of_other_joints_is_rejected(talk):
    def says(ros):
        action = ActionClient(ros, "arm_controller/follow_joint_trajectory", TRAJECTORY)
        action.goal.trajectory.joint_names = ["elbow"]
        assert not action.send()

    talk(says)


def test_a_cancelled_trajectory_stops_the_arm(talk):
    def says(ros):
        action = arm_goal(ros, 20)
        assert action.send()
        ros.soon(lambda: "move_arm" in ros.robot.moving_parts)
        action.cancel()
        assert action.result().status == GoalStatus.CANCELED
        assert "move_arm" not in ros.robot.moving_parts

    talk(says)


def test_the_gripper_is_opened_and_tells_its_opening(talk):
    def says(ros):
        action = ActionClient(ros, "gripper_controller/gripper_cmd", "control_msgs/action/GripperCommand")
        action.goal.command.position = 0.8
        assert action.send()
        result = action.result()
        assert result.status == GoalStatus.SUCCEEDED
        assert (result.result.position, result.result.reached_goal) == (pytest.approx(0.8, abs=0.02), True)

    talk(says)


def test_a_goal_of_the_arm_ends_with_the_mission(talk):
    def says(ros):
        action = arm_goal(ros, 60)
        assert action.send()
        ros.soon(lambda: "move_arm" in ros.robot.moving_parts)
        results = []
        asking = threading.Thread(target=lambda: results.append(action.result()))
        asking.start()
        time.sleep(0.3)  # until it waits
        assert ros.call("cancel").success
        asking.join()
        assert results[0].status == GoalStatus.ABORTED

    assert talk(says).message == "cancelled by ROS 2"


def test_velocities_do_not_drive_the_robot_into_a_wall(talk):
    def says(ros):
        command = ros.publisher("/alice/cmd_vel", TWIST)
        for _ in range(80):
            command.put(twist(0.6))  # the table stands 1.2 m ahead
            time.sleep(0.05)
        assert 0.05 < ros.robot.pose.x_m < 0.65

    talk(says)


def test_a_sentence_is_answered(talk):
    def says(ros):
        ros.publisher("/alice/say", STRING).put(text("what do you do?"))
        ros.soon(lambda: ros.heard["/alice/reply"])
        assert ros.heard["/alice/reply"][0].data

    talk(says)


def test_a_question_is_answered_from_the_run(talk):
    def says(ros):
        ros.publisher("/alice/say", STRING).put(text("what are you doing?"))
        ros.soon(lambda: ros.heard["/alice/reply"])
        assert "not begun" not in ros.heard["/alice/reply"][0].data
        assert "wait" in ros.heard["/alice/reply"][0].data

    talk(says)


def test_a_run_beside_another_in_one_domain_is_refused(talk):
    def says(ros):
        with pytest.raises(InputError, match="/clock is published in domain 0 already"):
            observe(f"0@{ros.place.host}:{ros.place.port}")(talk.prepared, Control(pace=None))

    talk(says)


def test_services_pause_resume_and_cancel(talk):
    def says(ros):
        for name in ("pause", "resume", "step", "resume", "cancel"):
            assert ros.call(name).success, name
        ros.soon(lambda: ros.events("outcome"))
        told = [each["what"] for each in ros.events("control")]
        assert [told[0], told[-1]] == ["pause", "cancel"]

    assert talk(says).message == "cancelled by ROS 2"


@pytest.mark.parametrize("value", ["x", "300", "0@:99999"])
def test_a_domain_that_is_none_is_refused_at_once(value):
    with pytest.raises(InputError):
        observe(value)
