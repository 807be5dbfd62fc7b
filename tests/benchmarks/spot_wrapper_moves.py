"""Program that drives Spot through `spot_wrapper` (github.com/bdaiinstitute/spot_wrapper): python FILE HOSTNAME

`tests.benchmarks.sdk_motion --wrapper FOLDER` runs it against a server, and judges each motion by the plant's truth.
"""

import logging
import os
import sys
import threading
import time

from spot_wrapper.wrapper import SpotWrapper

RATES_HZ = {"robot_state": 20.0, "metrics": 1.0, "lease": 1.0, "world_objects": 1.0}


def main():
    logging.basicConfig(level=logging.INFO)
    wrapper = SpotWrapper(
        username=os.environ["BOSDYN_CLIENT_USERNAME"],
        password=os.environ["BOSDYN_CLIENT_PASSWORD"],
        hostname=sys.argv[1],
        port=0,
        robot_name="Alice",
        logger=logging.getLogger("wrapper"),
        start_estop=False,
        rates=RATES_HZ,
        continually_try_stand=False,
    )
    ended = threading.Event()

    def update():
        while not ended.wait(0.05):
            wrapper.updateTasks()

    threading.Thread(target=update, daemon=True).start()
    calls = [
        ("claim", wrapper.claim),
        ("power on", wrapper.power_on),
        ("stand", wrapper.simple_stand),
        ("walk", lambda: walk(wrapper, 0.6, 0.1, 0.4)),
        ("drive", lambda: drive(wrapper, -0.3, 2.0)),
        ("unstow", wrapper.spot_arm.arm_unstow),
        ("hand", lambda: hand(wrapper, 0.75, 0.1, 0.3)),
        ("joints", lambda: wrapper.spot_arm.arm_joint_move([0.3, -1.2, 1.9, 0.2, -0.6, 0.1])),
        ("stow", wrapper.spot_arm.arm_stow),
        ("sit", lambda: wait(wrapper.sit, lambda: wrapper.is_sitting)),
        ("stand again", lambda: wait(wrapper.simple_stand, lambda: wrapper.is_standing)),
        ("dock", lambda: wrapper.spot_docking.dock(520)),
        ("release", wrapper.release),
    ]
    failed = [name for name, call in calls if not told(name, call())]
    ended.set()
    wrapper.disconnect()
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


def told(name, answer):
    print(name, answer, flush=True)
    return answer[0]


def wait(call, true, most_s=10.0):
    """Calls, and waits until a condition holds."""
    answer, until_s = call(), time.time() + most_s
    while not true() and time.time() < until_s:
        time.sleep(0.1)
    return answer[0] and true(), answer[1]


def walk(wrapper, x, y, yaw):
    call = lambda: wrapper.trajectory_cmd(x, y, yaw, cmd_duration=15.0, frame_name="odom", precise_position=True)  # noqa: E731
    return wait(call, lambda: wrapper.at_goal, 15.0)


def drive(wrapper, speed, seconds):
    """Repeats a velocity at 10 Hz, as the ROS driver does."""
    answer, until_s = (False, ""), time.time() + seconds
    while time.time() < until_s:
        answer = wrapper.velocity_cmd(speed, 0.0, 0.0, cmd_duration=0.25)
        time.sleep(0.1)
    time.sleep(1.5)
    return answer


def hand(wrapper, x, y, z):
    return wrapper.spot_arm.hand_pose(x=x, y=y, z=z, qx=0.0, qy=0.0, qz=0.0, qw=1.0, duration=2.0, ref_frame="body")


if __name__ == "__main__":
    main()
