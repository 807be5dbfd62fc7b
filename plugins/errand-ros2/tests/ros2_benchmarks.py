"""Figures of the ROS 2 plug-in: `python plugins/errand-ros2/tests/ros2_benchmarks.py NAME [COUNT [FIRST]]`.

bridge: a run in the flat with one subscription to scan, tf and a picture for COUNT seconds: rates, pace, latency, CPU.
cancel: COUNT goals of navigate_to_pose, each cancelled under way: time until the base stands.
kill: a process that sends cmd_vel is killed COUNT times: time until the base of the served robot stands.
faults: what a served robot and a run that drives it do when the client is killed, the link is cut or the robot stands
    still for 4 s, the robot is killed, and a second one comes into the domain; over Zenoh (COUNT 0) or rclpy (1).
stopped: what a subscriber hears that is stopped (SIGSTOP) for 4, 8 and 15 s while 10 events a second are published;
    over Zenoh (COUNT 0) or rclpy (1).
With the Python of `make ros`, two processes and a client with rclpy alone:
rclpy: COUNT goals of navigate_to_pose of a run, each cancelled under way, and as many that are reached.
bytes: COUNT random bytes to each input of a run and of a served robot: what moves, and what is said.
base: COUNT missions with --robot ros2://alice on the base of rclpy_base.py, judged by where it stands at the end.
fetch: fetch_drink on a served robot with the seeds 1 to COUNT, or from FIRST on; the referee of the plant, which is in
    the robot's process, judges the goal conditions, which the run's process sends over a pipe.
"""

import atexit
import json
import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from contextlib import closing, suppress
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from errand_ros2.bridge import Bridge
from errand_ros2.server import RobotServer
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import Attachment, ros_types
from executive import Request
from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.one_run import run_request
from executive.app.runs.simulated import compile_first, simulate
from executive.run.control import Control
from skills.robot import Pose2D
from tests.benchmarks.served_missions import MISSIONS, run_real

HEARD = {"/alice/scan": "sensor_msgs/msg/LaserScan", "/tf": "tf2_msgs/msg/TFMessage"}
HEARD |= {"/alice/frontleft/image": "sensor_msgs/msg/Image", "/clock": "rosgraph_msgs/msg/Clock"}
ODOM, TWIST = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"
GOALS = ((6.0, 4.5, math.pi), (3.0, 4.5, 0.0))


def free_place():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return Place(port=server.getsockname()[1])


class TimedBridge(Bridge):
    """A bridge that measures its own CPU time, in the run's thread."""

    cpu_s, run = 0.0, staticmethod(lambda work: work())

    def tick(self, progress):
        begun_s = time.thread_time()
        super().tick(progress)
        self.cpu_s += time.thread_time() - begun_s


def in_flat(client, pace=TimedBridge):
    """Runs a mission that waits in the flat, while `client(place, bridge)` runs in a thread; then cancels it."""
    with tempfile.TemporaryDirectory() as folder:
        mission = Path(folder) / "wait.yaml"
        mission.write_text("name: wait\nsteps:\n  - wait: {seconds: 3000}\n")
        prepared = prepare(Request(file=mission, world="flat", out=Path(folder) / "out", seed=1, record=False))
        place, control = free_place(), Control(pace=None)
        bridge = pace(prepared, control, place)

        def talk():
            try:
                client(place, bridge)
            finally:
                control.cancel("measured")

        threading.Thread(target=talk).start()
        bridge.run(lambda: run_request(prepared, visitors=[bridge], control=control))


def listen(port, limit_s):
    """Listens for a while, in a process of its own; prints counts, the way of the clock, and latencies as JSON."""
    delays, clock, counts = [], [], dict.fromkeys(HEARD, 0)
    with open_session(Place(port=port)) as session:
        node, kept = session.node("listener"), []

        def hear(topic, kind, sample):
            counts[topic] += 1
            delays.append(time.time_ns() - Attachment.decoded(sample.attachment.to_bytes()).stamp_ns)
            message = kind.decode(sample.payload.to_bytes())
            if topic == "/clock":
                clock.append((time.monotonic(), message.clock.sec + 1e-9 * message.clock.nanosec))

        for topic, name in HEARD.items():
            kind = ros_types().message(name)
            kept.append(
                session.inner.declare_subscriber(node.key.data_key(topic, kind.key), partial(hear, topic, kind))
            )
        time.sleep(limit_s)
    (wall0, sim0), (wall1, sim1) = clock[0], clock[-1]
    latency_ms = np.percentile(np.array(delays) * 1e-6, [50, 99, 100]).round(2).tolist()
    rates = {topic: round(count / limit_s, 2) for topic, count in counts.items()}
    sys.stdout.write(json.dumps({"pace": round((sim1 - sim0) / (wall1 - wall0), 4), "ms": latency_ms, "hz": rates}))


def bridge(limit_s):
    def client(place, bridge):
        while bridge._begun is None:
            time.sleep(0.1)
        time.sleep(3.0)
        before_s, begun_s = bridge.cpu_s, time.monotonic()
        told = subprocess.run([sys.executable, __file__, "listen", str(place.port), str(limit_s)], capture_output=True)
        took_s = time.monotonic() - begun_s
        share = (bridge.cpu_s - before_s) / took_s
        sys.stdout.write(f"{told.stdout.decode()} bridge's CPU {100 * share:.1f} % of a core, {took_s:.0f} s\n")

    in_flat(client)


class Watch:
    """The speed of the base as another program sees it."""

    def __init__(self, session):
        self.node, self.seen = session.node("watch"), []
        self.node.subscribe("/alice/odom", ODOM, self._hear)

    def _hear(self, message):
        twist = message.twist.twist
        stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        speed = math.hypot(twist.linear.x, twist.linear.y)
        self.seen.append((time.monotonic(), stamp_s, speed, abs(twist.angular.z)))

    def wait_for(self, speed, limit_s=30.0):
        until_s = time.monotonic() + limit_s
        while not (self.seen and self.seen[-1][2] > speed):
            if time.monotonic() > until_s:
                raise TimeoutError(f"the base did not reach {speed} m/s within {limit_s:.0f} s")
            time.sleep(0.005)

    def still_after(self, wall_s, stamp_s):
        """Times (wall, robot's clock) from an instant until the last reading in which the base moved.

        Odometry tells the speed of a base that stands with a deviation of 0.02 m/s: 0.1 m/s is beyond its noise.
        """
        moving = [each for each in self.seen if each[0] > wall_s and (each[2] > 0.1 or each[3] > 0.1)]
        return (moving[-1][0] - wall_s, moving[-1][1] - stamp_s) if moving else (0.0, 0.0)


def tell(rows, limit_s):
    for name, column in zip(("wall", "robot's clock"), zip(*rows, strict=True), strict=True):
        within = sum(each <= limit_s + 1e-6 for each in column)
        middle, most = np.median(column), max(column)
        sys.stdout.write(
            f"{name}: median {middle:.3f} s, most {most:.3f} s, {within} of {len(column)} <= {limit_s} s\n"
        )


def cancel(count):
    types, kind = ros_types(), "nav2_msgs/action/NavigateToPose"

    def client(place, bridge):
        with open_session(place) as session:
            watch, base, rows, reached = Watch(session), "/alice/navigate_to_pose/_action", [], 0
            names = {"send_goal": f"{kind}_SendGoal", "get_result": f"{kind}_GetResult"}
            names |= {"cancel_goal": "action_msgs/srv/CancelGoal"}
            send, result, stop = (watch.node.client(f"{base}/{name}", each) for name, each in names.items())
            watch.wait_for(-1.0, 120.0)
            for number in range(2 * count):
                x, y, yaw = GOALS[number // 2 % 2]
                goal = types.make(f"{kind}_Goal")
                goal.pose.header.frame_id, at = "map", goal.pose.pose
                at.position.x, at.position.y = x, y
                at.orientation.w, at.orientation.z = math.cos(yaw / 2), math.sin(yaw / 2)
                identity = {"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)}
                assert send.call({"goal_id": identity, "goal": goal}, limit_s=20.0).accepted
                if number % 2 == 0:
                    watch.wait_for(0.25)
                    time.sleep(0.5)
                    now = time.monotonic(), watch.seen[-1][1]
                    stop.call({"goal_info": {"goal_id": identity}}, limit_s=5.0)
                    time.sleep(1.0)
                    rows.append(watch.still_after(*now))
                else:
                    ended = result.call({"goal_id": identity}, limit_s=120.0)
                    reached += ended is not None and ended.status == 4
            sys.stdout.write(f"{reached} of {count} goals reached\n")
            tell(rows, 0.2)

    in_flat(client)


SENDER = """
import sys, time
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import ros_types

with open_session(Place(port=int(sys.argv[1]))) as session:
    kind = "geometry_msgs/msg/Twist"
    publisher, twist = session.node("sender").publisher("/alice/cmd_vel", kind), ros_types().make(kind)
    twist.linear.x, twist.angular.z = 0.4 * int(sys.argv[2]), 0.5
    while True:
        publisher.put(twist)
        time.sleep(0.02)
"""
"""Program that sends velocities until it is killed."""


def kill(count):
    world, place, ended, rows = open_world("flat"), free_place(), threading.Event(), []
    simulation = simulate(world, {"Alice": only_robot("Alice", world, seed=1)}, seed=1, record=False)

    def client():
        with open_session(place) as session:
            watch = Watch(session)
            for number in range(count):
                words = [sys.executable, "-c", SENDER, str(place.port), str((-1) ** number)]
                sender = subprocess.Popen(words)
                watch.wait_for(0.3)
                time.sleep(0.3)
                now = time.monotonic(), watch.seen[-1][1]
                sender.send_signal(signal.SIGKILL)
                sender.wait()
                time.sleep(1.2)
                rows.append(watch.still_after(*now))
        ended.set()

    with open_session(place) as session:
        server = RobotServer(session, simulation.robots["Alice"], simulation.clock)
        threading.Thread(target=client).start()
        server.run(ended)
    tell(rows, 0.6)


DOMAIN, START = 90, ("9.3", "4.05", "1.57")


class RclpyWatch(Watch):
    """The speed of the base as a program with rclpy alone sees it."""

    def __init__(self, client):
        self.seen = []
        client.hear("/alice/odom", ODOM, handle=self._hear)


def by_rclpy(count):
    from rclpy_client import client_of, errand, interface, stamped

    kind, rows, reached = "nav2_msgs/action/NavigateToPose", [], 0
    words = ("run", "--say", "wait for an hour", "--world", "flat", "--start", *START, "--no-record", "--quiet")
    with (
        tempfile.TemporaryDirectory() as out,
        errand(*words, "--out", out, "--ros2", f"rclpy:{DOMAIN}", ready="ROS 2: "),
        client_of(DOMAIN) as client,
    ):
        watch, navigate = RclpyWatch(client), client.action("/alice/navigate_to_pose", kind)
        watch.wait_for(-1.0, 120.0)
        for number in range(2 * count):
            goal = interface(kind).Goal()
            goal.pose = stamped(*GOALS[number // 2 % 2][:2])
            sent = client.send(navigate, goal)
            assert sent.accepted
            if number % 2 == 0:
                watch.wait_for(0.25)
                time.sleep(0.5)
                now = time.monotonic(), watch.seen[-1][1]
                client.result_of(sent.cancel_goal_async())
                time.sleep(1.0)
                rows.append(watch.still_after(*now))
            else:
                reached += client.result_of(sent.get_result_async(), 120.0).status == 4
    sys.stdout.write(f"{reached} of {count} goals reached\n")
    tell(rows, 0.2)


INPUTS = {
    **{"goal_pose": "geometry_msgs/msg/PoseStamped", "initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped"},
    **{"cmd_vel": TWIST, "body_pose": "geometry_msgs/msg/Pose", "gripper/carry": "std_msgs/msg/Bool"},
    "say": "std_msgs/msg/String",
}


def random_bytes(count):
    from rclpy_client import client_of, errand, interface
    from ros_client import soon

    words = ("--world", "flat", "--start", *START)
    run = ("run", "--say", "wait for an hour", *words, "--no-record", "--quiet", "--ros2", f"rclpy:{DOMAIN}")
    chance = np.random.default_rng(1)
    for command in (run, ("serve-ros2", f"rclpy:{DOMAIN}", *words)):
        with errand(*command, ready="ROS 2: ") as said, client_of(DOMAIN) as client:
            seen, sent = client.hear("/alice/odom", ODOM), 0
            assert soon(lambda seen=seen: len(seen) > 40, 120.0)
            begun = seen[-1].pose.pose.position
            for topic, kind in INPUTS.items():
                out, left = client.node.create_publisher(interface(kind), f"/alice/{topic}", 10), count
                time.sleep(0.5)
                while left > 0 and out.get_subscription_count():
                    data = b"\0\1\0\0" + chance.bytes(int(chance.integers(0, 600)))
                    left -= len(data)
                    if kind != TWIST or len(data) <= 48:  # DDS fills up more to a velocity's 52 bytes
                        with suppress(RuntimeError):  # longer than the type's messages are
                            out.publish(data)
                            sent += 1
                    time.sleep(0.0005)
            time.sleep(1.0)
            ended = seen[-1].pose.pose.position
            moved_m = math.dist((begun.x, begun.y), (ended.x, ended.y))
            fastest = max(each.twist.twist.linear.x for each in seen)
            wrong = [line for line in said if "Traceback" in line]
            sys.stdout.write(f"{command[0]}: {sent} messages, {moved_m:.3f} m, at most {fastest:.2f} m/s, ")
            sys.stdout.write(f"{len(wrong)} tracebacks, {len(said)} lines; the last: {said[-1]}")


BASE = """
kind: fetch
base: {command: cmd_vel, stamped: true, speed: 0.5, turn_rate: 1.0}
odometry: {topic: odom, raised: 0.377}
joints: null
lidar: {scan: scan}
"""
"""Description of the base of rclpy_base.py, which has no arm."""


def base(count):
    world = open_world("flat")
    grid, rooms = world.folder / "map" / "low_scan.yaml", ["kitchen", "office", "bedroom", "hall", "workshop"]
    for number in range(count):
        room, domain = rooms[number % len(rooms)], DOMAIN + 1 + number
        with tempfile.TemporaryDirectory() as folder:
            (file := Path(folder) / "base.yaml").write_text(BASE)
            words = [sys.executable, Path(__file__).with_name("rclpy_base.py"), grid, *START]
            environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
            driven = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True)
            run = ["run", "--say", f"go to the {room}", "--world", "flat", "--no-record", "--quiet", "--out", folder]
            robot = ["--robots", f"alice=fetch@{','.join(START)}", "--seed", str(number + 1)]
            address = f"ros2://alice?file={file}&network=rclpy:{domain}"
            words = [sys.executable, "-m", "executive.cli", *run, *robot, "--robot", address]
            ended = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
            driven.send_signal(signal.SIGINT)
            x, y, _ = map(float, driven.communicate()[0].split()[-3:])
        off_m = math.dist((x, y), world.standing[room])
        sys.stdout.write(f"{room}: exit code {ended.returncode}, {off_m:.2f} m from where a robot stands there\n")


def serve_plant(seed, domain, pipe):
    """Serves a robot in the flat, in a process of its own; answers through a pipe what is asked of the plant."""
    world, ended = open_world("flat"), threading.Event()
    placed = only_robot("Alice", world, seed=seed, start=Pose2D(*map(float, START)))
    compile_first()
    simulation = simulate(world, {"Alice": placed}, seed=seed, record=False)
    known = {"judge": simulation.referee.judge, "touch": simulation.referee.expect_touch}
    known |= {"picture": simulation.record_picture}
    with open_session(Place(domain, by_rclpy=True)) as session:
        server = RobotServer(session, simulation.robots["Alice"], simulation.clock)

        def answer():
            with suppress(EOFError):
                while True:
                    what, *given = pipe.recv()
                    pipe.send(server.work.submit(known[what], *given).result())
            ended.set()

        threading.Thread(target=answer, daemon=True).start()
        pipe.send("ready")
        server.run(ended)


class Asked:
    """The plant of another process: what the witness of a run tells it, and its referee."""

    def __init__(self, pipe):
        self._pipe, self._lock, self.referee = pipe, threading.Lock(), self
        self.judge, self.expect_touch, self.record_picture = (
            partial(self.ask, what) for what in ("judge", "touch", "picture")
        )

    def ask(self, *what):
        with self._lock:
            self._pipe.send(what)
            return self._pipe.recv()


def fetch(count, first=1):
    domain, context = DOMAIN + 20, get_context("spawn")
    for seed in range(first, count + 1):
        ours, theirs = context.Pipe()
        served = context.Process(target=serve_plant, args=(seed, domain, theirs))
        served.start()
        theirs.close()
        with tempfile.TemporaryDirectory() as folder, closing(ours):
            ours.recv()
            asked = {"file": MISSIONS / "fetch_drink.yaml", "world": "flat", "start": Pose2D(*map(float, START))}
            prepared = prepare(Request(**asked, seed=seed, out=Path(folder) / "out", record=False))
            begun_s, plant = time.monotonic(), Asked(ours)
            report = run_real(prepared, f"ros2://alice?network=rclpy:{domain}", plant)
        served.join(20.0)
        seen, spent_s = report.seen, time.monotonic() - begun_s
        sys.stdout.write(f"seed {seed}: {report.outcome} ({report.message}), judged {seen.success}, ")
        sys.stdout.write(f"{seen.collisions} collisions, ")
        sys.stdout.write(f"{seen.drops} drops, {report.sim_time_s:.0f} s in {spent_s:.0f} s; {seen.why}\n")
        sys.stdout.flush()


def place_over(by_rclpy, number):
    """A place over a wire, and how a command line names it."""
    place = Place(DOMAIN + number, by_rclpy=True) if by_rclpy else free_place()
    return place, f"rclpy:{place.domain}" if by_rclpy else f"zenoh:@127.0.0.1:{place.port}"


def told(line):
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


class Errand:
    """A command of Errand in a process of its own, whose lines a file keeps."""

    def __init__(self, folder, *words):
        self.said = Path(tempfile.mkstemp(dir=folder)[1])
        command = [sys.executable, "-m", "executive.cli", *words]
        self.process = subprocess.Popen(command, stdout=self.said.open("w"), stderr=subprocess.STDOUT)
        atexit.register(self.process.kill)

    def says(self, words, limit_s=120.0):
        from ros_client import soon

        soon(lambda: words in self.said.read_text() or self.process.poll() is not None, limit_s)
        assert words in self.said.read_text(), self.said.read_text()

    def ended(self, limit_s=300.0):
        """The exit code, and what was said at the end."""
        code, lines = self.process.wait(limit_s), self.said.read_text().strip().splitlines()
        return f"exit code {code}, {sum('Traceback' in line for line in lines)} tracebacks: {lines[-1][:150]}"


def faults(by_rclpy):
    from slow_link import SlowLink

    (place, network), where = place_over(by_rclpy, 40), ("--world", "flat", "--start", *START)
    with tempfile.TemporaryDirectory() as folder, open_session(place) as session:
        watch, link = Watch(session), None if by_rclpy else SlowLink(place.port, most_s=0.0)

        def drive(room, over=network):
            options = ("--no-record", "--quiet", "--out", tempfile.mkdtemp(dir=folder))
            run = Errand(
                folder, "run", "--say", f"go to the {room}", *where, *options, "--robot", f"ros2://alice?network={over}"
            )
            watch.wait_for(0.3, 400.0)
            return run

        robot = Errand(folder, "serve-ros2", network, *where)
        robot.says("ROS 2: /alice")
        told(f"a second simulator: {Errand(folder, 'serve-ros2', network, *where).ended()}")
        say = ("run", "--say", "wait for an hour", *where, "--no-record", "--quiet", "--ros2", network, "--out")
        told(f"a run beside it: {Errand(folder, *say, folder).ended()}")
        run = drive("bedroom")
        now = time.monotonic(), watch.seen[-1][1]
        run.process.kill()
        time.sleep(2.0)
        wall_s, robot_s = watch.still_after(*now)
        told(f"client killed: the base stands after {robot_s:.2f} s of the robot's clock, {wall_s:.2f} s of the wall's")
        run = drive("kitchen")
        robot.process.send_signal(signal.SIGSTOP)
        time.sleep(4.0)
        robot.process.send_signal(signal.SIGCONT)
        told(f"robot silent for 4 s: {run.ended()}")
        if link is not None:
            run = drive("bedroom", f"zenoh:@127.0.0.1:{link.port}")
            now = time.monotonic(), watch.seen[-1][1]
            with link.stall():
                time.sleep(4.0)
                wall_s, robot_s = watch.still_after(*now)
            told(f"link cut for 4 s: the base stands after {robot_s:.2f} s of the robot's clock; {run.ended()}")
        run, begun_s = drive("kitchen" if link is not None else "bedroom"), time.monotonic()
        robot.process.kill()
        told(f"robot killed: {run.ended()}; {time.monotonic() - begun_s:.0f} s")
    (place, network) = place_over(by_rclpy, 41)
    with tempfile.TemporaryDirectory() as folder:
        say = ("run", "--say", "wait for an hour", *where, "--no-record", "--quiet", "--ros2", network, "--out")
        first = Errand(folder, *say, tempfile.mkdtemp(dir=folder))
        first.says("ROS 2: ")
        rows = [Errand(folder, *say, tempfile.mkdtemp(dir=folder)).ended() for _ in range(2)]
        first.process.send_signal(signal.SIGINT)
        told(f"two runs in one domain, the second and third: {rows}; the first: {first.ended()}")


LISTENER = """
import sys
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session

with open_session(Place.parse(sys.argv[1])) as session:
    hear = lambda event: print(event.data, flush=True)
    session.node("listener").subscribe("/event", "std_msgs/msg/String", hear)
    sys.stdin.read()
"""
"""Program that prints events until its input ends."""


def stopped(by_rclpy):
    from ros_client import soon

    for still_s in (4.0, 8.0, 15.0):
        (place, network), heard, at_s = place_over(by_rclpy, 45), {}, []
        with open_session(place) as session:
            events = session.node("sender").publisher("/event", "std_msgs/msg/String")

            def send(seconds, events=events, at_s=at_s):
                for _ in range(round(10 * seconds)):
                    events.put({"data": str(len(at_s))})
                    at_s.append(time.monotonic())
                    time.sleep(0.1)

            words, pipe = [sys.executable, "-c", LISTENER, network], subprocess.PIPE
            with subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True) as listener:

                def read(listener=listener, heard=heard):
                    for line in listener.stdout:
                        heard[int(line)] = time.monotonic()

                threading.Thread(target=read, daemon=True).start()
                assert soon(lambda events=events: events.is_heard)
                send(3.0)
                before = len(at_s)
                listener.send_signal(signal.SIGSTOP)
                send(still_s)
                listener.send_signal(signal.SIGCONT)
                goes_on, again_s = len(at_s), time.monotonic()
                send(12.0)
                time.sleep(1.0)
                listener.stdin.close()
        lost = {*range(len(at_s))} - heard.keys()
        first_s = min((each for each in heard.values() if each > again_s), default=math.inf) - again_s
        parts = {"before": (0, before), "meanwhile": (before, goes_on), "after": (goes_on, len(at_s))}
        counts = [f"{len(lost & {*range(*span)})} of {span[1] - span[0]} {when}" for when, span in parts.items()]
        told(f"stopped for {still_s:.0f} s: lost {', '.join(counts)}; the first comes {first_s:.2f} s after it goes on")


if __name__ == "__main__":
    what, *numbers = sys.argv[1:]
    measures = {"bridge": bridge, "cancel": cancel, "kill": kill, "listen": listen}
    measures |= {"faults": faults, "stopped": stopped}
    measures |= {"rclpy": by_rclpy, "bytes": random_bytes, "base": base, "fetch": fetch}
    measures[what](*map(int, numbers or [60]))
