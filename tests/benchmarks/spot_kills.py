"""Kills clients of Spot's API, or cuts their connections, at random moments, and watches what the robot does then.

    python -m tests.benchmarks.spot_kills [--trials 50] [--seed 1] [--scripted]

Each client logs in, takes the lease, switches the motors on, stands, drives and moves the arm, in real time: every
second one is a program of the SDK with a keepalive policy (motors off after 2 s), the other one the adapter of
`errand run --robot`. Of three clients one is killed with SIGKILL, one has its connection reset, and one silenced; of
five one before it drives. The robot is a Spot in the plant (`--scripted`: one that moves exactly as commanded). Right
is: from 0.3 s after the end of the last drive the base moves less than 2 cm, as the body settles over the feet; the
lease free within 6 s; the motors off by policy. Prints JSON.
"""

import math
import multiprocessing
import tempfile
import threading
import time
from contextlib import redirect_stdout, suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests.benchmarks.harness import command, tell, totals

PRELOADED = ["bosdyn.client.keepalive", "bosdyn.client.util", "errand_spot.adapter.robot", "skills.testing.robot"]
USER, PASSWORD = "user", "right"
STILL_S, FREE_S, OFF_AFTER_S, WAIT_S = 0.3, 6.0, 2.0, 10.0
DRIVE_S, STILL_M, DRIVES_M = 0.6, 0.02, 0.005
ENDINGS = ("killed", "reset", "silenced")
ARM_RAD = ((0.0, -0.9, 1.8, 0.0, -0.9, 0.0), (0.0, -1.6, 2.3, 0.0, -0.7, 0.0))


def velocity(number):
    sign = 1.0 if number % 4 < 2 else -1.0
    return 0.4 * sign, 0.0, 0.3 * sign


def sdk_client(port, certificate, number, end_s):
    """Drives and moves the arm with the SDK; `end_s` gets the end of each drive (robot's time) first."""
    import bosdyn.client
    from bosdyn.client.keepalive import KeepaliveClient, Policy
    from bosdyn.client.lease import LeaseKeepAlive
    from bosdyn.client.robot_command import RobotCommandBuilder, RobotCommandClient, blocking_stand

    sdk = bosdyn.client.create_standard_sdk("kills", [KeepaliveClient], cert_resource_glob=certificate)
    robot = sdk.create_robot("127.0.0.1")
    robot.update_secure_channel_port(port)
    robot.authenticate(USER, PASSWORD)
    robot.time_sync.wait_for_sync()
    LeaseKeepAlive(robot.ensure_client("lease"), must_acquire=True)
    robot.power_on(update_frequency=20.0)
    commands = robot.ensure_client(RobotCommandClient.default_service_name)
    blocking_stand(commands, update_frequency=20.0)
    policy = Policy()
    policy.add_controlled_motors_off_action(OFF_AFTER_S)
    keepalive = robot.ensure_client(KeepaliveClient.default_service_name)
    policy_id = keepalive.modify_policy(to_add=policy).added_policy.policy_id
    end_s.value = 1.0  # the policy counts from now on
    for step in range(1000):
        keepalive.check_in(policy_id)
        if step % 10 == 0:
            arm = RobotCommandBuilder.arm_joint_command(*ARM_RAD[step // 10 % 2])
            commands.robot_command(arm)
        until_s = time.time() + DRIVE_S
        end_s.value = until_s + robot.time_sync.get_robot_clock_skew().ToNanoseconds() * 1e-9
        commands.robot_command(RobotCommandBuilder.synchro_velocity_command(*velocity(number)), end_time_secs=until_s)
        time.sleep(0.1)


def adapter_client(port, certificate, number, end_s):
    """Drives and moves the arm with the adapter; `end_s` gets the end of each drive (robot's time) first."""
    from errand_spot.adapter.connection import Address, Connection, WallClock
    from errand_spot.adapter.robot import ApiRobot
    from plant.robots.spot.kind import spot_capabilities
    from skills.robot import ArmTrajectory, CommandState

    connection = Connection(Address("127.0.0.1", port, Path(certificate)), USER, PASSWORD)
    connection.synchronise()
    clock = WallClock(connection)
    robot = ApiRobot("Alice", connection, clock, spot_capabilities())
    clock.after.append(robot.poll)
    lease = robot.acquire_lease("kills")
    connection.power(True)
    while not robot.powered:
        clock.advance(0.05)
    standing = robot.stand(0.52, 0.0, until_s=clock.now() + 10.0, lease=lease)
    while robot.command_status(standing).state is CommandState.RUNNING:
        clock.advance(0.05)
    for step in range(1000):
        if step % 20 == 0:
            now = [robot.joints().position_rad[name] for name in spot_capabilities().arm.joint_names]
            path = ArmTrajectory(np.array([0.0, 2.0]), np.array([now, ARM_RAD[step // 20 % 2]]))
            robot.move_arm(path, until_s=clock.now() + 4.0, lease=lease)
        end_s.value = clock.robot_time_s() + DRIVE_S
        robot.drive(*velocity(number), until_s=clock.now() + DRIVE_S, lease=lease)
        clock.advance(0.05)


def quiet(client, *arguments):
    """Runs a client, whose errors after its connection is cut nobody reads."""
    with Path("/dev/null").open("w") as nowhere, redirect_stdout(nowhere), suppress(Exception):
        client(*arguments)


class Trials:
    def __init__(self, server, certificate, seed):
        self._server, self._certificate = server, str(certificate)
        self._rng, self._context = np.random.default_rng(seed), multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(PRELOADED)

    def run(self, number):
        """Runs a trial; `off` says whether the motors went off by policy, None without one."""
        from proxy import Proxy

        client, ending = (sdk_client, adapter_client)[number % 2], ENDINGS[number % 3]
        computer, proxy, end_s = self._server.computer, Proxy(self._server.port), self._context.Value("d", 0.0)
        process = self._context.Process(target=quiet, args=(client, proxy.port, self._certificate, number, end_s))
        process.start()
        early = number % 5 == 4
        if not early:
            _waited(lambda: end_s.value > 1.0, 2.0 * WAIT_S)
        time.sleep(float(self._rng.uniform(0.0, 2.0 if early else 3.0)))
        at_s = computer.now_s()
        {"killed": process.kill, "reset": proxy.cut, "silenced": proxy.silence}[ending]()
        last_s = end_s.value
        driving = self._motion_m(0.05) > DRIVES_M
        time.sleep(max(0.0, last_s + STILL_S - computer.now_s()))
        still_m = self._motion_m(0.3)
        free = _waited(lambda: all(claim.stale for claim in list(computer.leases._claims.values())))
        free_s = round(computer.now_s() - at_s, 2) if free else None
        policy = client is sdk_client and last_s >= 1.0
        off = _waited(lambda: computer.motors.value == "off") if policy else None
        moved_m = max(still_m, self._motion_m(0.3))
        process.kill()
        process.join()
        proxy.cut()
        self._recover()
        kind = client.__name__.removesuffix("_client")
        made = {"number": number, "client": kind, "ending": ending, "driving": driving}
        right = {"still": moved_m < STILL_M, "free": free_s is not None and free_s < FREE_S, "off": off}
        return SimpleNamespace(**made, **right, moved_m=round(moved_m, 4), free_s=free_s)

    def _motion_m(self, during_s):
        """Motion of the base in a while (m, and rad as m)."""
        before = self._server.computer.snapshot.odometry.pose
        time.sleep(during_s)
        after = self._server.computer.snapshot.odometry.pose
        far_m = math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
        return max(far_m, abs(math.remainder(after.yaw_rad - before.yaw_rad, math.tau)))

    def _recover(self):
        computer = self._server.computer
        computer.leases.make_stale(["body"])
        for watch in computer.watchers:
            with suppress(AttributeError):
                watch.__self__._live.clear()


def _waited(true, most_s=WAIT_S):
    until_s = time.monotonic() + most_s
    while not true() and time.monotonic() < until_s:
        time.sleep(0.02)
    return true()


def server_of(scripted, credentials):
    from errand_spot.server.server import Options, SpotServer
    from plant.robots.spot.kind import spot_capabilities
    from skills.manipulation.arm.kinematics import arm_model

    if scripted:
        from skills.testing.clock import VirtualClock
        from skills.testing.robot import ScriptedRobot

        clock = VirtualClock()
        robot = ScriptedRobot(clock, capabilities=spot_capabilities())
    else:
        from executive.app.prepare.placed_robots import only_robot
        from executive.app.prepare.worlds import open_world
        from executive.app.runs.simulated import compile_first, simulate

        world = open_world("flat")
        compile_first()
        simulation = simulate(world, {"Alice": only_robot("Alice", world, seed=1)}, seed=1, record=False)
        robot, clock = simulation.robots["Alice"], simulation.clock
        robot.image("hand")  # as `errand serve` does: the first picture takes long
    return SpotServer(robot, clock, arm_model(robot.capabilities()), credentials, Options({USER: PASSWORD}))


def summary(trials):
    policy = [each for each in trials if each.off is not None]
    return {
        "trials": len(trials),
        **totals(trials, "driving", "still", "free"),
        "longest_free_s": max((each.free_s for each in trials if each.free_s is not None), default=None),
        "with_policy": len(policy),
        "off_by_policy": sum(bool(each.off) for each in policy),
        "wrong": [each for each in trials if not each.still or each.off is False or not each.free],
    }


def measure(trials: int = 50, seed: int = 1, scripted: bool = False):
    from errand_spot.server.identity import credentials

    with tempfile.TemporaryDirectory() as folder:
        held = credentials(Path(folder))
        server, stopping, done = server_of(scripted, held), threading.Event(), []
        against = Trials(server, held.certificate, seed)

        def run():
            try:
                for number in range(trials):
                    done.append(against.run(number))
                    tell(done[-1])
            finally:
                stopping.set()

        running = threading.Thread(target=run)
        with server.running():
            running.start()
            server.computer.run(stopping)
            running.join()
    return summary(done)


if __name__ == "__main__":
    command(measure)
