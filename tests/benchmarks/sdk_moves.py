"""Program of Spot's SDK that moves base, body and arm in each way: python sdk_moves.py HOSTNAME

`tests.benchmarks.sdk_motion` runs it against a server, and judges each motion.
"""

import sys
import time

import bosdyn.client
import bosdyn.client.util
from bosdyn.client.frame_helpers import get_a_tform_b
from bosdyn.client.lease import LeaseKeepAlive
from bosdyn.client.math_helpers import SE3Pose
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.client.robot_command import block_for_trajectory_cmd, block_until_arm_arrives, blocking_stand
from bosdyn.geometry import EulerZXY
from bosdyn.util import seconds_to_duration


def main():
    robot = bosdyn.client.create_standard_sdk("sdk-moves").create_robot(sys.argv[1])
    bosdyn.client.util.authenticate(robot)
    robot.time_sync.wait_for_sync()
    with LeaseKeepAlive(robot.ensure_client("lease"), must_acquire=True, return_at_exit=True):
        robot.power_on(timeout_sec=20)
        commands, states = robot.ensure_client("robot-command"), robot.ensure_client("robot-state")
        blocking_stand(commands, timeout_sec=10)

        def send(command, ahead_s=10.0):
            return commands.robot_command(command, end_time_secs=time.time() + ahead_s)

        def in_odom(x, y, z):
            tree = states.get_robot_state().kinematic_state.transforms_snapshot
            return get_a_tform_b(tree, "odom", "flat_body") * SE3Pose(x, y, z, SE3Pose.from_identity().rot)

        def hand_to(x, y, z, seconds=2.0):
            pose = in_odom(x, y, z)
            rotation = pose.rot
            turn = (rotation.w, rotation.x, rotation.y, rotation.z)
            return Build.arm_pose_command(pose.x, pose.y, pose.z, *turn, "odom", seconds)

        def walk(x, y, yaw):
            tree = states.get_robot_state().kinematic_state.transforms_snapshot
            return Build.synchro_trajectory_command_in_body_frame(x, y, yaw, tree)

        def square(side, each_s):
            """Command of a closed square to the left of the robot, a corner each `each_s`."""
            command = walk(0.0, 0.0, 0.0)
            trajectory = command.synchronized_command.mobility_command.se2_trajectory_request.trajectory
            corners = ((side, 0.0), (side, side), (0.0, side), (0.0, 0.0))
            del trajectory.points[:]
            for k, (x, y) in enumerate(corners):
                corner = in_odom(x, y, 0.0)
                point = trajectory.points.add(time_since_reference=seconds_to_duration((k + 1) * each_s))
                point.pose.position.x, point.pose.position.y, point.pose.angle = corner.x, corner.y, corner.rot.to_yaw()
            return command

        def block(command):
            block_until_arm_arrives(commands, command, timeout_sec=15)

        for yaw in (0.4, 0.0):
            blocking_stand(commands, timeout_sec=10, params=Build.mobility_params(footprint_R_body=EulerZXY(yaw=yaw)))
        block_for_trajectory_cmd(commands, send(square(0.5, 2.0)), timeout_sec=10)
        blocking_stand(commands, timeout_sec=10, params=Build.mobility_params(body_height=-0.08))
        block_for_trajectory_cmd(commands, send(walk(0.5, 0.1, 0.4)), timeout_sec=10)
        block_for_trajectory_cmd(commands, send(walk(-0.3, 0.0, -0.4)), timeout_sec=10)
        send(Build.synchro_velocity_command(-0.3, 0.0, 0.1), ahead_s=1.5)
        time.sleep(2.0)
        block(send(Build.arm_ready_command()))
        block(send(hand_to(0.75, 0.15, 0.3)))
        block(send(Build.arm_joint_command(0.3, -1.2, 1.9, 0.2, -0.6, 0.1)))
        target = in_odom(2.0, 0.5, -0.2)
        block(send(Build.arm_gaze_command(target.x, target.y, target.z, "odom")))
        block(send(Build.build_synchro_command(Build.follow_arm_command(), hand_to(1.1, 0.0, 0.25))))
        block(send(Build.build_synchro_command(walk(-0.25, 0.0, 0.0), hand_to(0.65, 0.1, 0.25))))
        block(send(Build.arm_stow_command()))
        robot.power_off(cut_immediately=False, timeout_sec=20)


if __name__ == "__main__":
    main()
