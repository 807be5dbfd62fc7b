"""Exceptions, hangs and garbage in every verb: the run ends with a cause, the robot stands, the log can be read."""

import dataclasses
import threading
from typing import ClassVar

import numpy as np
import pytest
from mcap.reader import make_reader

from executive.record.event_log import EventLog
from executive.run.guarded_robot import CHECKS, GarbageError, GuardedRobot
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.watchdog import Watchdog
from executive.run.worker import LockStepWorker, ThreadWorker
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeSpec
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Running, Skill, Succeeded
from skills.faults.fault_kinds import Effect
from skills.faults.faulty_robot import Fault, inject_faults
from skills.manipulation.posture import StowInputs
from skills.robot import ArmTrajectory, DoorHandle, Gripper
from skills.robot_wrapper import VERBS
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot
from tests.visitors import OnMessage

CAPABILITIES = spot_capabilities()
SENSES = ("odometry", "imu", "scan", "image", "joints", "gripper", "battery")
USED = tuple(verb for verb in VERBS if verb != "take_lease")
SEEN = ("capabilities", "odometry", "own_localisation", "imu", "scan", "joints", "gripper", "battery", "faults")
MAYBE_NONE = {"own_localisation", "imu", "scan", "lease_holder"}
ANSWERING = set(USED) - {"return_lease", "carry"}
HANG_LIMITS = {"verb_limit_s": 0.2, "image_limit_s": 0.2}
OVER = threading.Event()
"""Ends the hangs."""


@pytest.fixture(scope="module", autouse=True)
def warm():
    """What is compiled at first use is no hang."""
    robot = ScriptedRobot(VirtualClock(), capabilities=CAPABILITIES)
    robot.scan()
    robot.image("hand")


class UseAll(Skill):
    """Uses every verb while base, body, arm and gripper move."""

    name = "use_all"
    Inputs: ClassVar[type] = StowInputs

    def begin(self, inputs):
        self.ticks, self.commands, self.picture, self.seen = 0, [], None, None

    def step(self):
        self.ticks += 1
        self.look()
        if self.ticks == 1:
            self.move()
        self.drive()
        for command in self.commands:
            self.context.robot.command_status(command)
        return Running("at work") if self.ticks < 8 or self.seen is None else Succeeded("done")

    def look(self):
        robot = self.context.robot
        for verb in SEEN:
            getattr(robot, verb)()
        if self.picture is None:
            self.picture = self.context.worker.sense(
                lambda: robot.image("hand"), lambda image: image, latency_s=0.0, name="picture"
            )
        if self.picture.done():
            self.seen = self.picture.result()

    def move(self):
        robot, lease, until_s = self.context.robot, self.context.lease, self.context.clock.now() + 0.6
        start = np.array(CAPABILITIES.arm.stowed_rad)
        trajectory = ArmTrajectory(np.array([0.1, 2.0]), np.stack([start, start + 0.2]))
        robot.sit(until_s=until_s, lease=lease)
        robot.carry(True, lease=lease)
        self.commands = [
            robot.stand(0.5, 0.0, until_s=until_s, lease=lease),
            robot.move_arm(trajectory, until_s=until_s, lease=lease),
            robot.set_gripper(1.0, 10.0, until_s=until_s, lease=lease),
            robot.point_head(0.1, 0.1, until_s=until_s, lease=lease),
            robot.dock(520, until_s=until_s, lease=lease),
            robot.undock(until_s=until_s, lease=lease),
            robot.open_door(DoorHandle((1.0, 0.0, 0.5), True, True), until_s=until_s, lease=lease),
        ]

    def drive(self):
        until_s = self.context.clock.now() + 0.3
        self.commands.append(self.context.robot.drive(0.5, 0.0, 0.2, until_s=until_s, lease=self.context.lease))
        if self.ticks == 4:
            self.context.robot.stop(lease=self.context.lease, only=self.commands[-1])

    def end(self):
        for command in self.commands:
            self.context.robot.stop(lease=self.context.lease, only=command)


def spoiled(**numbers):
    """Replace fields of a reading."""
    return lambda call: dataclasses.replace(call.proceed(), **numbers)


def not_finite(call):
    reading = call.proceed()
    changes = {
        "odometry": {"velocity": (np.nan, 0.0, 0.0)},
        "imu": {"angular_velocity_B": (np.nan, 0.0, 0.0)},
        "joints": {"position_rad": {"arm_sh0": np.inf}},
        "gripper": {"opening": np.nan},
        "battery": {"charge": np.nan},
    }
    return dataclasses.replace(reading, **changes[call.verb])


def raising(call):
    raise OSError("cable out")


def hanging(call):
    OVER.wait(20.0)
    return call.proceed()


KINDS = {
    "raises": (raising, USED),
    "hangs": (hanging, USED),
    "gives None": (lambda call: (call.proceed(), None)[1], ANSWERING - MAYBE_NONE),
    "gives text": (lambda call: (call.proceed(), "41")[1], ANSWERING),
    "gives NaN": (lambda call: (call.proceed(), float("nan"))[1], ANSWERING),
    "gives a truth value": (lambda call: (call.proceed(), True)[1], ANSWERING),
    "gives numbers that are not finite": (not_finite, ("odometry", "imu", "joints", "gripper", "battery")),
    "gives a negative stamp": (spoiled(stamp_s=-1.0), SENSES),
    "gives no stamp": (spoiled(stamp_s=None), SENSES),
    "gives a stamp of NaN": (spoiled(stamp_s=float("nan")), SENSES),
}
CASES = [(verb, kind) for kind, (_, verbs) in KINDS.items() for verb in sorted(verbs)]


def spoilt_run(tmp_path, verb, kind, *, worker=LockStepWorker, limit_s=30.0):
    """Run UseAll on a robot with one bad verb; the result, the robot, and the log read back."""
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=CAPABILITIES)
    faults = [Fault(f"{verb} {kind}", Effect(frozenset({verb}), KINDS[kind][0]))] if kind else []
    plan = NodeSpec("skill", "alice/test", "use all", {"skill": UseAll, "limit_s": limit_s})
    entry = RunEntry(
        CompiledTree("Alice", "test", (), plan), inject_faults(robot, clock, faults), KnownPlace(), BlockCostmap()
    )
    log = EventLog(tmp_path / "log.mcap", clock)
    try:
        settings = RunSettings(**(HANG_LIMITS if kind == "hangs" else {}))
        result = run([entry], clock=clock, worker=worker(clock), visitors=[log], settings=settings)
    finally:
        log.close()
    clock.advance(0.2)
    return result, robot, logged(log.path)


def logged(path):
    with path.open("rb") as stream:
        return [channel.topic for _, channel, _ in make_reader(stream).iter_messages()]


def test_without_a_fault_all_is_well(tmp_path):
    result, robot, topics = spoilt_run(tmp_path, "drive", None)
    assert (result.outcome, robot.moving_parts, robot.lease_holder()) == (Outcome.SUCCESS, (), None)
    assert set(USED) <= {*robot.calls, "capabilities", "faults", "acquire_lease", "lease_holder"}
    assert "errors" not in topics


@pytest.mark.parametrize(("verb", "kind"), CASES)
def test_a_bad_verb_ends_the_run_with_a_cause_and_the_robot_stands(tmp_path, verb, kind):
    result, robot, topics = spoilt_run(tmp_path, verb, kind)
    if verb == "return_lease":  # all was done by then; what remains is told in the log
        assert (result.outcome, "errors" in topics) == (Outcome.SUCCESS, True)
    else:
        assert (result.outcome, result.worst.cause) == (Outcome.ERROR, Cause.ERROR)
        assert verb in result.worst.message or "cable out" in result.worst.message
    assert robot.moving_parts == ()
    assert topics[-1] == "wall"
    assert "outcome" in topics or verb == "acquire_lease"


@pytest.mark.parametrize("verb", [verb for verb in USED if verb != "image"])
def test_a_hang_ends_a_run_that_is_not_in_the_main_thread(tmp_path, verb):
    ended = []
    thread = threading.Thread(target=lambda: ended.append(spoilt_run(tmp_path, verb, "hangs")))
    thread.start()
    thread.join(timeout=10.0)
    result, robot, topics = ended[0]
    OVER.set()  # what hung comes back, and finds that its lease no longer counts
    for hung in (each for each in threading.enumerate() if each.name == f"errand-{verb}"):
        hung.join(timeout=10.0)
    OVER.clear()
    assert result.outcome is (Outcome.SUCCESS if verb == "return_lease" else Outcome.ERROR)
    assert "outcome" in topics or verb == "acquire_lease"
    assert robot.moving_parts == () or verb == "return_lease"


def test_a_picture_that_hangs_in_the_workers_thread_does_not_stop_the_run(tmp_path, monkeypatch):
    over = threading.Event()
    monkeypatch.setitem(KINDS, "blocks", (lambda call: (over.wait(20.0), call.proceed())[1], ("image",)))
    threads = {"worker": lambda clock: ThreadWorker(), "limit_s": 2.0}
    result, robot, topics = spoilt_run(tmp_path, "image", "blocks", **threads)
    over.set()
    assert (result.outcome, result.worst.cause, robot.moving_parts) == (Outcome.FAILURE, Cause.TIMEOUT, ())
    assert "outcome" in topics


def test_a_skill_in_an_endless_loop_is_broken_off(compiled, run_tree, make, script, robot):
    def forever(skill):
        while True:
            skill.context.robot.gripper()

    script.ends["approach"] = forever
    result = run_tree(compiled(*make.FETCH), settings={"tick_limit_s": 0.2})
    assert (result.outcome, result.worst.message) == (Outcome.ERROR, "a tick of Alice took longer than 0.2 s")
    assert (robot.driving, robot.holder, script.ended) == (False, None, script.begun)


@pytest.mark.parametrize("written", [0, 3, 12])
def test_a_log_that_breaks_ends_the_run_and_the_robot_stands(compiled, run_tree, make, script, robot, written):
    left = iter(range(written))

    def publish(topic, message):
        if next(left, None) is None:
            raise OSError("no space left on device")

    result = run_tree(compiled(*make.FETCH), log=OnMessage(publish))
    assert (result.outcome, result.worst.cause) == (Outcome.ERROR, Cause.ERROR)
    assert "no space left" in result.worst.message
    assert (robot.driving, robot.holder, script.ended) == (False, None, script.begun)


def test_a_clock_that_breaks_ends_the_run_and_the_robot_stands(compiled, run_tree, make, script, robot, clock):
    whole = clock.advance

    def advance(dt_s):
        if clock.now() > 0.3:
            raise OSError("the clock stands still")
        whole(dt_s)

    clock.advance = advance
    result = run_tree(compiled(*make.FETCH))
    assert (result.outcome, robot.driving, robot.holder) == (Outcome.ERROR, False, None)


def test_garbage_is_named(clock):
    class Odd:
        name = "Odd"

        def battery(self):
            return "full"

    with pytest.raises(GarbageError, match=r"'battery' with garbage: 'full' is no Battery"):
        GuardedRobot(Odd(), Watchdog()).battery()


def test_garbage_in_many_values_is_shortened_to_whole_ones(clock):
    robot = inject_faults(ScriptedRobot(clock, capabilities=spot_capabilities()), clock, ["joints returns garbage"])
    with pytest.raises(GarbageError, match=r"position_rad is not finite: \{('\w+': nan, ){4}\.\.\.\}$"):
        GuardedRobot(robot, Watchdog()).joints()


def test_numpy_truth_and_numbers_are_no_garbage():
    assert CHECKS["gripper"](Gripper(1.0, np.float64(0.2), np.float32(3.0), np.bool_(True))) is None
