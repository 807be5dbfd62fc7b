"""Missions through ROS 2: adapter and server in lock-step, judged by the plant's referee."""

from contextlib import closing

import cv2
import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros2_benchmarks import in_flat
from ros2_missions import through_ros
from ros_run import PATIENCE_S, STRING, ActionClient, PartClient, RosClient, SteppedBridge
from scripted_nav2 import THROUGH, TO_POSE, by_nav2

from errand_ros2.part_actions import GRIPPER, TRAJECTORY
from errand_ros2.wire.actions import GoalStatus
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import ros_types
from executive import Request
from executive.run.control import Control
from tests.benchmarks.served_missions import MISSIONS, Cut

TREE = "py_trees_ros_interfaces/msg/BehaviourTree"
OPEN = "py_trees_ros_interfaces/srv/OpenSnapshotStream"
RAISED_RAD = {"arm_sh0": 0.0, "arm_sh1": -1.8, "arm_el0": 2.0, "arm_el1": 0.0, "arm_wr0": 0.2, "arm_wr1": 0.0}


@pytest.mark.mission
@pytest.mark.parametrize(
    "what",
    [
        {"file": MISSIONS / "go_to_pose.yaml", "given": {"x": 8.6, "y": 4.5, "yaw": 1.57}, "seed": 3},
        pytest.param({"sentence": "go to the kitchen", "seed": 3}, marks=pytest.mark.nightly),
        pytest.param({"file": MISSIONS / "fetch_drink.yaml", "seed": 1}, marks=pytest.mark.nightly),
    ],
    ids=["go a metre", "go", "fetch"],
)
def test_a_mission_through_ros_is_fulfilled(what, tmp_path):
    ended = through_ros(Request(**what, record=False, out=tmp_path / "out"))
    assert (ended.outcome, ended.verdict) == ("success", True), ended


@pytest.mark.mission
@pytest.mark.nightly
def test_a_run_whose_robot_is_silent_for_a_while_goes_on_by_itself(tmp_path):
    control, cuts = Control(attended=True, pace=None), []

    def with_cut(step):
        cuts.append(Cut(step.cut, control, tick=100))
        return {"visitors": cuts, "control": control}

    ended = through_ros(Request(sentence="go to the kitchen", seed=3, record=False, out=tmp_path / "out"), with_cut)
    seen = [(mode.value, reason) for mode, reason in cuts[0].seen]
    assert seen == [("running", ""), ("paused", "Alice has not answered for 3 s"), ("running", "")]
    assert (ended.outcome, ended.verdict) == ("success", True), ended


@pytest.mark.mission
def test_a_mission_drives_by_nav2_stands_at_once_when_paused_and_goes_on(tmp_path):
    request = Request(file=MISSIONS / "go_to_pose.yaml", given={"x": 8.6, "y": 4.5, "yaw": 1.57}, seed=3)
    ended, driven = by_nav2(request, tmp_path, TO_POSE, pauses=1)
    assert (ended.outcome, ended.verdict) == ("success", True), ended
    assert max(driven.stands_after_s) <= 0.2  # on the robot's clock
    assert (len(driven.nav2.goals), driven.nav2.cancelled) == (2, 1)


@pytest.mark.mission
@pytest.mark.nightly
def test_drives_of_a_fetch_go_by_nav2_through_the_poses_of_errands_path(tmp_path):
    ended, driven = by_nav2(Request(file=MISSIONS / "fetch_drink.yaml", seed=1), tmp_path, THROUGH, 1.0)
    assert (ended.outcome, ended.verdict) == ("success", True), ended
    assert driven.driven > 200


def talked_to(says):
    """Lets a client in a thread talk to a run in the flat, which waits, and step it."""
    errors = []

    def client(place, bridge):
        bridge.stands()
        try:
            with open_session(place) as session, closing(RosClient(session, bridge)) as ros:
                says(ros)
        except BaseException as error:
            errors.append(error)
        finally:
            bridge.finish()

    in_flat(client, SteppedBridge)
    if errors:
        raise errors[0]


@pytest.mark.mission
def test_a_client_moves_arm_and_gripper_in_the_plant_and_sees_depth_and_costs():
    def says(ros):
        joints = ros.hear("/alice/joint_states", "sensor_msgs/msg/JointState")
        arm = PartClient(ros, "arm_controller/follow_joint_trajectory", TRAJECTORY)
        points = [{"positions": list(RAISED_RAD.values()), "time_from_start": {"sec": 3, "nanosec": 0}}]
        arm.goal.trajectory = ros_types().make(
            "trajectory_msgs/msg/JointTrajectory", joint_names=list(RAISED_RAD), points=points
        )
        assert arm.send()
        moved = arm.result()
        assert moved.status == GoalStatus.SUCCEEDED, moved.result.error_string
        ros.step(2)
        angles = dict(zip(joints[-1].name, joints[-1].position, strict=True))
        assert {name: angles[name] for name in RAISED_RAD} == pytest.approx(RAISED_RAD, abs=0.05)
        gripper = PartClient(ros, "gripper_controller/gripper_cmd", GRIPPER)
        gripper.goal.command.position = -0.8
        assert gripper.send()
        assert gripper.result().result.position == pytest.approx(-0.8, abs=0.05)
        ros.tell("/alice/say", STRING, {"data": "what are you doing?"})
        ros.soon(lambda: ros.heard["/alice/reply"])
        assert "'wait'" in ros.heard["/alice/reply"][0].data
        depth = ros.hear("/alice/hand/depth/image/compressedDepth", "sensor_msgs/msg/CompressedImage")
        costs = ros.hear("/alice/global_costmap/costmap", "nav_msgs/msg/OccupancyGrid")
        ros.soon(lambda: depth and costs)
        depth_mm = cv2.imdecode(depth[0].data[12:], cv2.IMREAD_UNCHANGED)
        assert depth_mm.shape == (240, 320) and 300 < np.median(depth_mm[depth_mm > 0]) < 5000
        cells = np.asarray(costs[0].data)
        assert 0.05 < np.mean(cells == 100) < 0.9 and 0.05 < np.mean(cells < 50) < 0.9  # walls, and open floor

    talked_to(says)


@pytest.mark.mission
@pytest.mark.nightly
def test_a_client_watches_the_tree_and_the_objects_of_a_search():
    def says(ros):
        opener = ros.node.client("/alice/tree/snapshot_streams/open", OPEN)
        trees = ros.hear(opener.call({}, limit_s=PATIENCE_S).topic_name, TREE)
        objects = ros.hear("/alice/objects", "visualization_msgs/msg/MarkerArray")
        search = ActionClient(ros, "run_mission")
        search.goal.sentence = "find a coke in the kitchen"
        assert search.send()
        found = search.result(limit_s=300.0).result
        assert found.outcome == "success", found.claim
        active = {each.name for tree in trees for each in tree.behaviours if each.is_active}
        assert any("detect" in name for name in active), active
        assert "coke" in {each.text for found in objects for each in found.markers}

    talked_to(says)
