"""An adapter's robot over a link that loses, repeats, delays and reorders messages."""

import heapq
import threading
from contextlib import closing
from itertools import count

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port
from ros_lock_step import LockStep, scripted

from errand_ros2.readings import LIFE_S, stamp_of
from errand_ros2.server import PERIOD_S
from errand_ros2.wire.node import Place
from errand_ros2.wire.types import USUAL
from errand_ros2.wire.zenoh_node import ZenohNode
from skills.robot import ArmTrajectory, CommandState

LOST, TWICE, LATEST_S = 0.2, 0.1, 0.15
STANDS_S = 0.6
"""Time within which the base stands after its sender has fallen silent, as the manual promises."""


class LossyLink:
    """A link for what subscriptions hear; of stored messages (`/tf_static`), and of services, nothing is lost."""

    def __init__(self, seed, subscribe):
        self._chance, self._lock, self._numbers = np.random.default_rng(seed), threading.Lock(), count()
        self._subscribe, self._waiting, self.now = subscribe, [], lambda: 0.0
        self.arrived_s, self.fates = {}, [0, 0, 0]
        """Stamps of what came in last, by topic; numbers of messages lost, passed on, and passed on twice."""
        self.is_open, self.after = True, lambda: None

    def subscribe(self, node, topic, kind, handle, qos=USUAL, **late):
        if qos.transient_local:
            return self._subscribe(node, topic, kind, handle, qos, **late)

        def hear(message):
            with self._lock:
                fate = self._chance.uniform()
                times = 0 if fate < LOST else 2 if fate < LOST + TWICE else 1
                self.fates[times] += 1
                for _ in range(times):
                    at_s = self.now() + self._chance.uniform(0.0, LATEST_S)
                    heapq.heappush(self._waiting, (at_s, next(self._numbers), handle, message))
                if hasattr(message, "header"):
                    self.arrived_s[topic] = stamp_of(message.header)

        return self._subscribe(node, topic, kind, hear, qos, **late)

    def deliver(self):
        """Hands over what is due, if the link is open."""
        while True:
            with self._lock:
                if not self.is_open or not self._waiting or self._waiting[0][0] > self.now():
                    return
                *_, handle, message = heapq.heappop(self._waiting)
            handle(message)
            self.after()


class LossyStep(LockStep):
    """Lock-step of a robot and its server by a lossy link."""

    def __init__(self, link):
        self.link, link.now = link, self.now
        super().__init__(scripted, Place(port=free_port()))

    def advance(self, dt_s):
        for _ in range(max(1, round(dt_s / PERIOD_S))):
            self.link.deliver()
            super().advance(PERIOD_S)
            self.link.deliver()

    def _has_arrived(self):
        sent, came = self.server.topics.stamps_s, self.link.arrived_s
        pairs = {"odom": "odom", "joint_states": "odom", "imu": "odom", "points": "scan"}
        ended = sum(each.ended for each in self.robot.actions.values())
        return self.server.parts.ended <= ended and all(
            came.get(topic, -1.0) >= sent[by] - 1e-6 for topic, by in pairs.items() if by in sent
        )

    def drive(self, vx, seconds=0.3):
        return self.robot.drive(vx, 0.0, 0.0, until_s=self.now() + seconds, lease=self.lease)

    def drive_for(self, vx, seconds):
        """Drives with a new command at each step; returns the last."""
        until_s = self.now() + seconds
        while self.now() < until_s:
            command = self.drive(vx)
            self.advance(PERIOD_S)
        return command

    def still(self):
        return not np.any(np.abs(self.served.velocity) > 0.01)


@pytest.fixture(scope="module", params=[1, 2, 3])
def step_of_seed(request):
    link = LossyLink(request.param, ZenohNode.subscribe)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ZenohNode, "subscribe", lambda node, *given, **more: link.subscribe(node, *given, **more))
        step = LossyStep(link)
    with closing(step):
        yield step


@pytest.fixture
def lossy(step_of_seed):
    """A lock-step by a lossy link, over which nothing is on its way; the seed chooses what is lost."""
    step_of_seed.link.is_open, step_of_seed.link.after = True, lambda: None
    step_of_seed.advance(2 * LATEST_S)
    step_of_seed.begin_anew()
    return step_of_seed


def test_a_drive_and_an_arm_motion_end_over_a_lossy_link(lossy):
    begun_m, there = lossy.served.pose.x_m, lossy.served.q_rad + np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert lossy.ends(lossy.drive_for(0.5, 2.0)).state is CommandState.DONE
    assert 0.85 < lossy.served.pose.x_m - begun_m < 1.2
    lossy.advance(1.0)
    assert lossy.robot.odometry().X_OB.translation()[0] == pytest.approx(lossy.served.pose.x_m - begun_m, abs=1e-3)
    command = lossy.robot.move_arm(ArmTrajectory(np.array([1.0]), there[None, :]), until_s=99.0, lease=lossy.lease)
    assert lossy.ends(command).state is CommandState.DONE
    assert lossy.served.q_rad == pytest.approx(there, abs=0.02)
    assert min(lossy.link.fates) > 20


def test_no_reading_goes_back_in_time_over_a_lossy_link(lossy):
    seen = {name: [] for name in ("odometry", "joints", "scan", "imu")}

    def watch():
        for name, stamps_s in seen.items():
            stamps_s.append(getattr(lossy.robot, name)().stamp_s)

    assert lossy.until(lossy.robot.imu)
    lossy.link.after = watch
    lossy.drive_for(0.3, 4.0)
    later_s = {name: np.diff(stamps_s) for name, stamps_s in seen.items()}
    assert {name: min(each) for name, each in later_s.items() if min(each) < -1e-6} == {}
    assert all(np.count_nonzero(each) > 1 for each in later_s.values())


def test_nothing_moves_on_after_a_stop_over_a_lossy_link(lossy):
    there = lossy.served.q_rad + np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0])
    lossy.robot.move_arm(ArmTrajectory(np.array([4.0]), there[None, :]), until_s=99.0, lease=lossy.lease)
    lossy.drive_for(0.6, 0.6)
    assert {*lossy.served.moving_parts} == {"drive", "move_arm"}
    lossy.robot.stop(lease=lossy.lease)
    lossy.advance(STANDS_S)
    assert lossy.served.moving_parts == ()
    for _ in range(20):
        lossy.advance(PERIOD_S)
        assert lossy.served.moving_parts == ()


def test_a_base_stands_while_the_link_is_cut_and_its_command_does_not_outlive_it(lossy):
    command = lossy.drive_for(0.6, 0.6)
    lossy.link.is_open = False
    cut_s = lossy.now()
    assert lossy.until(lossy.still, STANDS_S)
    assert lossy.now() - cut_s <= LIFE_S + 0.4 + 1e-6
    lossy.advance(1.0)
    assert lossy.still()
    assert lossy.robot.command_status(command).state is not CommandState.RUNNING


def test_velocities_that_a_cut_link_delivers_late_drive_for_their_life_at_most(lossy):
    lossy.drive_for(0.6, 0.6)
    lossy.link.is_open = False
    assert lossy.until(lossy.still, STANDS_S)
    stood_at_m = lossy.served.pose.x_m
    lossy.advance(1.0)
    lossy.link.is_open = True
    lossy.advance(LIFE_S + 0.4)
    for _ in range(20):
        assert lossy.still()
        lossy.advance(PERIOD_S)
    assert lossy.served.pose.x_m - stood_at_m < 0.6 * (LIFE_S + LATEST_S)
