"""Every verb of a robot of ROS 2 against the server in lock-step, expiry, refusals and silence."""

import math

import numpy as np
import pytest
from ros_client import soon

from errand_ros2.adapter.description import served_file
from errand_ros2.adapter.sensors import SILENT_S
from errand_ros2.part_actions import GRIPPER, TRAJECTORY
from errand_ros2.wire.actions import GoalStatus
from errand_ros2.wire.types import Attachment, ros_types
from skills.robot import ArmTrajectory, CommandCause, CommandState, LeaseError


def within(step, seconds):
    return {"until_s": step.now() + seconds, "lease": step.lease}


def arm_to(step, offset_rad, seconds=1.0):
    there = step.served.q_rad + np.array([offset_rad, 0.0, 0.0, 0.0, 0.0, 0.0])
    return ArmTrajectory(np.array([seconds]), there[None, :])


def test_readings_are_those_of_the_served_robot(step):
    step.advance(0.2)
    robot, served = step.robot, step.served
    assert robot.odometry().stamp_s == pytest.approx(step.now())
    assert robot.odometry().X_OB.translation() == pytest.approx(served.odometry().X_OB.translation(), abs=1e-6)
    assert robot.joints().position_rad["arm_sh1"] == pytest.approx(served.q_rad[1])
    assert robot.battery().charge == pytest.approx(served.charge, abs=1e-3)
    assert robot.imu().linear_acceleration_B[2] == pytest.approx(9.81)
    assert robot.faults() == ()


def test_a_scan_through_points_sees_the_wall_where_it_is(step):
    step.advance(0.2)
    points = step.robot.scan().points_B()
    ahead = points[(np.abs(points[:, 1]) < 0.2) & (points[:, 0] > 0.0)]
    assert np.median(ahead[:, 0]) == pytest.approx(3.0, abs=0.03)


@pytest.mark.parametrize(("visual", "depth"), [(True, True), (True, False), (False, True)])
def test_a_picture_has_pixels_depth_and_frames_of_one_time(step, visual, depth):
    image = step.robot.image("hand", visual=visual, depth=depth)
    own = step.served.image("hand")
    assert image.stamp_s == pytest.approx(step.now())
    assert (image.grey.size > 0, image.depth_m.size > 0) == (visual, depth)
    assert image.frames.pose("hand_camera").translation() == pytest.approx(
        own.frames.pose("hand_camera").translation(), abs=1e-6
    )
    if visual:
        assert image.colour.shape == own.colour.shape
        assert (image.intrinsics.fx, image.intrinsics.cx) == pytest.approx((own.intrinsics.fx, own.intrinsics.cx))
    if depth:
        assert image.depth_intrinsics == own.depth_intrinsics
        assert np.median(image.depth_m) == pytest.approx(np.median(own.depth_m), abs=0.02)


def test_no_camera_of_that_name_is_an_error(step):
    with pytest.raises(ValueError, match="no camera 'nose'"):
        step.robot.image("nose")


def test_a_drive_ends_by_itself(step):
    drive = step.robot.drive(0.5, 0.0, 0.2, **within(step, 0.3))
    step.advance(0.2)
    assert step.served.velocity[0] > 0.3
    assert step.ends(drive).state is CommandState.DONE
    step.until(lambda: not step.served.velocity.any(), 0.6)
    assert not step.served.velocity.any()


def test_a_drive_lives_for_0_6_s_at_most(step):
    begun_s, drive = step.now(), step.robot.drive(0.5, 0.0, 0.0, **within(step, 30.0))
    assert step.ends(drive).state is CommandState.DONE
    assert step.now() - begun_s <= 0.65 + 1e-6


def test_a_new_drive_replaces_the_one_before(step):
    first = step.robot.drive(0.3, 0.0, 0.0, **within(step, 0.3))
    step.robot.drive(0.2, 0.0, 0.0, **within(step, 0.3))
    assert step.robot.command_status(first).state is CommandState.STOPPED


def test_the_arm_follows_a_trajectory(step):
    goal_rad = step.served.q_rad[0] + 0.4
    assert step.ends(step.robot.move_arm(arm_to(step, 0.4), **within(step, 5.0))).state is CommandState.DONE
    assert step.served.q_rad[0] == pytest.approx(goal_rad, abs=0.02)


def test_stop_cancels_the_arm_and_the_base(step):
    arm = step.robot.move_arm(arm_to(step, 0.8, 4.0), **within(step, 8.0))
    drive = step.robot.drive(0.5, 0.0, 0.0, **within(step, 0.5))
    step.advance(0.3)
    step.robot.stop(lease=step.lease)
    assert {step.robot.command_status(each).state for each in (arm, drive)} == {CommandState.STOPPED}
    assert step.until(lambda: not step.served.moving_parts, 1.0)


def test_stop_of_one_command_leaves_the_others(step):
    arm = step.robot.move_arm(arm_to(step, 0.4, 1.0), **within(step, 5.0))
    drive = step.robot.drive(0.3, 0.0, 0.0, **within(step, 0.5))
    step.advance(0.1)
    step.robot.stop(lease=step.lease, only=drive)
    assert step.ends(arm).state is CommandState.DONE


def test_an_arm_that_is_late_is_cancelled(step):
    arm = step.robot.move_arm(arm_to(step, 0.8, 4.0), **within(step, 0.5))
    status = step.ends(arm)
    assert (status.state, status.cause) == (CommandState.STOPPED, CommandCause.LATE)
    assert step.until(lambda: not step.served.moving_parts, 1.0)


def test_a_trajectory_that_the_controller_rejects_is_refused(step):
    far = ArmTrajectory(np.array([0.0]), (step.served.q_rad + 2.0)[None, :])  # it is not there
    status = step.robot.command_status(step.robot.move_arm(far, **within(step, 5.0)))
    assert (status.state, status.cause) == (CommandState.REFUSED, CommandCause.REFUSED)


def test_the_gripper_opens_and_closes_on_an_object(step):
    assert step.ends(step.robot.set_gripper(1.0, 20.0, **within(step, 5.0))).state is CommandState.DONE
    assert step.robot.gripper().opening == pytest.approx(step.served.opening, abs=0.02)
    step.served.in_gripper_rad = 0.4
    status = step.ends(step.robot.set_gripper(0.0, 20.0, **within(step, 5.0)))
    assert status.state is CommandState.DONE
    step.advance(0.1)
    assert step.robot.gripper().holding
    step.robot.carry(True, lease=step.lease)
    step.advance(0.05)
    assert step.served.carries


def test_the_body_takes_a_posture(step):
    assert step.ends(step.robot.stand(0.45, 0.1, **within(step, 5.0))).state is CommandState.DONE
    assert (step.served.height_m, step.served.pitch_rad) == pytest.approx((0.45, 0.1), abs=0.03)


@pytest.mark.parametrize("verb", ["sit", "undock"])
def test_verbs_without_a_topic_are_unsupported(step, verb):
    status = step.robot.command_status(getattr(step.robot, verb)(**within(step, 5.0)))
    assert (status.state, status.cause) == (CommandState.REFUSED, CommandCause.UNSUPPORTED)


@pytest.mark.parametrize(
    ("cause", "command"),
    [
        (CommandCause.INVALID, lambda step: step.robot.drive(math.nan, 0.0, 0.0, **within(step, 0.3))),
        (CommandCause.INVALID, lambda step: step.robot.stand(2.0, 0.0, **within(step, 5.0))),
        (CommandCause.LATE, lambda step: step.robot.drive(0.3, 0.0, 0.0, **within(step, -0.1))),
        (CommandCause.UNSUPPORTED, lambda step: step.robot.point_head(0.0, 0.0, **within(step, 5.0))),
        (
            CommandCause.NO_LEASE,
            lambda step: step.robot.drive(
                0.3, 0.0, 0.0, until_s=step.now() + 1.0, lease=step.robot.take_lease("x") and step.lease
            ),
        ),
    ],
    ids=["nan", "height", "late", "head", "lease"],
)
def test_a_command_that_is_not_allowed_moves_nothing(step, cause, command):
    status = step.robot.command_status(command(step))
    assert (status.state, status.cause) == (CommandState.REFUSED, cause)
    step.advance(0.2)
    assert not step.served.moving_parts


def test_the_lease_counts_within_the_program(step):
    with pytest.raises(LeaseError, match="held by 'test'"):
        step.robot.acquire_lease("other")
    step.robot.return_lease(step.lease)
    assert step.robot.lease_holder() is None


def test_a_silent_robot_is_not_driven_and_its_arm_stops_when_it_answers_again(step):
    arm = step.robot.move_arm(arm_to(step, 1.5, 20.0), **within(step, 40.0))
    step.advance(0.2)
    with step.cut():
        step.advance(0.6)
        assert step.robot.command_status(arm).cause is CommandCause.NO_ANSWER
        refused = step.robot.command_status(step.robot.drive(0.3, 0.0, 0.0, **within(step, 0.3)))
        assert (refused.state, refused.cause) == (CommandState.REFUSED, CommandCause.NO_ANSWER)
        step.advance(SILENT_S)
        assert step.robot.faults() == ("the robot has not answered for 4 s",)
        assert step.robot.stopped_because() == ""
        assert step.served.moving_parts == ("move_arm",)
    assert step.until(lambda: not step.served.moving_parts, 2.0)
    assert step.robot.faults() == ()
    with step.cut():
        step.advance(15.5)
        assert "has not answered for 15 s" in step.robot.stopped_because()


def test_random_bytes_on_every_topic_and_service_move_nothing(step, capfd):
    types, chance, space, length = ros_types(), np.random.default_rng(1), "/alice", 200_000
    file, session = served_file("spot"), step.node.session.inner
    topics = {file.base.command: "geometry_msgs/msg/Twist", "body_pose": "geometry_msgs/msg/Pose"}
    topics |= {"gripper/carry": "std_msgs/msg/Bool", "odom": "nav_msgs/msg/Odometry"}
    topics |= {"joint_states": "sensor_msgs/msg/JointState", "points": "sensor_msgs/msg/PointCloud2"}
    topics |= {"imu": "sensor_msgs/msg/Imu", "battery_state": "sensor_msgs/msg/BatteryState"}
    keys = [step.node.key.data_key(f"{space}/{name}", types.message(kind).key) for name, kind in topics.items()]
    keys.append(step.node.key.data_key("/tf_static", types.message("tf2_msgs/msg/TFMessage").key))
    nodes, sent = (step.node, step.server.node), 0

    def taken():
        return sum(each.handled + each.dropped for each in nodes)

    before, begun = taken(), (step.served.pose, step.served.q_rad.copy(), step.served.opening)
    for key in keys:
        left = length
        while left > 0:
            data = b"\0\1\0\0"[: int(chance.integers(0, 5))] + chance.bytes(int(chance.integers(0, 2000)))
            left -= len(data)
            if len(data) not in (52, 60):  # the bytes of a velocity or a posture are one
                session.put(key, data)
                sent += 1
    attachment = Attachment(1, 2, bytes(16)).encoded()
    for name, kind in ((file.arm.action, TRAJECTORY), (file.gripper.action, GRIPPER)):
        parts = {"send_goal": f"{kind}_SendGoal", "get_result": f"{kind}_GetResult"}
        for part, service in (parts | {"cancel_goal": "action_msgs/srv/CancelGoal"}).items():
            key = step.node.key.data_key(f"{space}/{name}/_action/{part}", types.service(service).key)
            for _ in range(20):
                payload = b"\0\1\0\0" + chance.bytes(length // 20)
                session.get(key, timeout=0.2, payload=payload, attachment=attachment)
    answer = step.node.client(f"{space}/{name}/_action/get_result", parts["get_result"]).call({}, limit_s=20.0)
    assert answer.status == GoalStatus.UNKNOWN  # all else has come
    soon(lambda: taken() >= before + sent, 2.0)  # a message may be lost
    step.server.work.submit(step.server.step).result()
    assert "Traceback" not in capfd.readouterr().err
    assert (step.served.pose, step.served.opening) == (begun[0], begun[2])
    assert np.array_equal(step.served.q_rad, begun[1])
    assert step.served.moving_parts in ((), ("stand",))
