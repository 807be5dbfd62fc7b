"""The plant steps towards the next tick while this one is computed; commands begin one period late."""

import signal
from concurrent.futures import Future
from contextlib import contextmanager

import numpy as np
import pytest

from executive.run.worker import WorkThread
from executive.testing.bench import write_small_room
from plant.diagram import TIME_STEP_S
from plant.engine import Pipeline
from plant.simulation import Simulation
from plant.worlds.world import load_world
from skills.robot import ArmTrajectory, CommandState, Lease, LeaseError
from tests.plant.kept_engine import KeptEngine

TICK_S = 0.05


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    return load_world(write_small_room(tmp_path_factory.mktemp("room"), can=False))


@pytest.fixture(scope="module")
def kept(world):
    return KeptEngine(Simulation(world, seed=1, visuals=False).engine)


@pytest.fixture
def engine(kept):
    return kept.again()


@pytest.fixture
def pipeline(engine):
    return Pipeline(engine)


@pytest.fixture
def robot(pipeline):
    return pipeline.robots["Alice"]


def test_a_command_begins_when_the_step_under_way_is_done(engine, pipeline, robot):
    lease = robot.acquire_lease("test")
    pipeline.advance(TICK_S)
    stood_m = _x_m(engine)
    robot.drive(1.0, 0.0, 0.0, until_s=10.0, lease=lease)
    pipeline.settle()
    assert _x_m(engine) == pytest.approx(stood_m, abs=1e-4)
    pipeline.advance(TICK_S)
    pipeline.settle()
    assert _x_m(engine) > stood_m + 1e-3


def test_a_thread_and_steps_in_turn_give_the_same_run(kept):
    thread = WorkThread("test-plant")
    runs = [_drive_about(Pipeline(kept.again(), each)) for each in (thread.do, None)]
    thread.close(10.0)
    assert runs[0] == runs[1]


def test_pictures_and_scans_show_the_world_as_of_the_last_readings(kept):
    seen = []
    for piped in (True, False):
        engine = kept.again()
        robot = engine.robots["Alice"]
        robot.drive(0.0, 0.0, 1.5, until_s=10.0, lease=robot.acquire_lease("test"))
        clock = Pipeline(engine) if piped else engine
        for _ in range(8):
            clock.advance(TICK_S)
        seen.append((robot.image("frontleft", visual=False), robot.scan()))
    (picture, scan), (other, other_scan) = seen
    assert (picture.stamp_s, scan.stamp_s) == (other.stamp_s, other_scan.stamp_s)
    assert picture.stamp_s == pytest.approx(8 * TICK_S)
    assert np.array_equal(picture.depth_m, other.depth_m)
    assert np.array_equal(scan.ranges_m, other_scan.ranges_m, equal_nan=True)


def test_lease_verbs_do_not_advance_the_time(pipeline, robot):
    pipeline.advance(TICK_S)
    lease = robot.acquire_lease("test")
    assert pipeline.now() == pytest.approx(TICK_S)
    with pytest.raises(LeaseError, match="held by 'test'"):
        robot.acquire_lease("another")
    robot.return_lease(lease)
    assert robot.lease_holder() is None
    pipeline.advance(TICK_S)
    assert pipeline.now() == pytest.approx(2 * TICK_S) == robot.odometry().stamp_s


def test_commands_before_the_return_of_the_lease_begin_first(pipeline, robot):
    lease = robot.acquire_lease("test")
    pipeline.advance(TICK_S)
    command = robot.drive(1.0, 0.0, 0.0, until_s=10.0, lease=lease)
    robot.return_lease(lease)
    pipeline.advance(TICK_S)
    status = robot.command_status(command)
    assert (status.state, status.reason) == (CommandState.STOPPED, "the lease was returned")


def test_a_refusal_is_known_at_the_next_tick(pipeline, robot):
    pipeline.advance(TICK_S)
    command = robot.drive(1.0, 0.0, 0.0, until_s=10.0, lease=Lease("Alice", "nobody", 7))
    assert robot.command_status(command).state is CommandState.RUNNING
    pipeline.advance(TICK_S)
    assert robot.command_status(command).state is CommandState.REFUSED
    with pytest.raises(KeyError):
        robot.command_status(command + 1)


def test_the_time_of_a_trajectory_counts_from_its_command(engine, pipeline, robot):
    servos, lease = engine.robots["Alice"]._arm, robot.acquire_lease("test")
    pipeline.advance(TICK_S)
    rest_rad = servos.goal_rad
    turned_rad = rest_rad + np.array([0.2, *[0.0] * (len(rest_rad) - 1)])
    trajectory = ArmTrajectory(np.array([0.0, 1.0]), np.stack([rest_rad, turned_rad]))
    robot.move_arm(trajectory, until_s=10.0, lease=lease)
    for _ in range(4):
        pipeline.advance(TICK_S)
    pipeline.settle()
    commanded_s, set_s = TICK_S, pipeline.reached_s() - 2 * TIME_STEP_S
    assert servos.goal_rad[0] - rest_rad[0] == pytest.approx(0.2 * (set_s - commanded_s))


def test_stopping_one_command_leaves_the_others(pipeline, robot):
    lease = robot.acquire_lease("test")
    drive = robot.drive(1.0, 0.0, 0.0, until_s=10.0, lease=lease)
    stand = robot.stand(0.5, 0.2, until_s=10.0, lease=lease)
    pipeline.advance(TICK_S)
    robot.stop(lease=lease, only=drive)
    pipeline.advance(TICK_S)
    states = [robot.command_status(each).state for each in (drive, stand)]
    assert states == [CommandState.STOPPED, CommandState.RUNNING]


def test_events_of_the_step_under_way_appear_at_the_next_tick(engine, pipeline):
    pipeline.advance(TICK_S)
    engine.record_event("the lamp falls over")  # the engine is a tick ahead by now
    assert list(pipeline.events) == []
    pipeline.advance(TICK_S)
    assert list(pipeline.events) == [(2 * TICK_S, "the lamp falls over")]


def test_advance_raises_the_exception_of_a_step(engine):
    def fail(now_s):
        raise ArithmeticError("nothing is finite")

    thread = WorkThread("test-plant")
    pipeline = Pipeline(engine, thread.do)
    pipeline.advance(TICK_S)
    pipeline.settle()
    engine.observe(fail)
    pipeline.advance(TICK_S)
    with pytest.raises(ArithmeticError):
        pipeline.advance(TICK_S)
    thread.close(10.0)


def test_a_tick_shorter_than_the_step_under_way_is_refused(pipeline):
    pipeline.advance(0.2)
    with pytest.raises(ValueError, match="beyond"):
        pipeline.advance(TICK_S)


def _x_m(engine):
    body = engine.world.robots["Alice"].body
    return float(engine.world.plant.EvalBodyPoseInWorld(engine.context, body).translation()[0])


def _drive_about(pipeline):
    """Readings of a short drive, during which the lease is returned and taken again."""
    robot = pipeline.robots["Alice"]
    lease, readings = robot.acquire_lease("test"), []
    for tick in range(30):
        pipeline.advance(TICK_S)
        scan = robot.scan()
        ranges = b"" if scan is None else scan.ranges_m.tobytes()
        readings.append(repr((pipeline.now(), robot.odometry(), robot.imu(), robot.joints(), hash(ranges))))
        robot.drive(0.4, 0.1, 0.5, until_s=pipeline.now() + 0.3, lease=lease)
        if tick == 12:
            robot.return_lease(lease)
            lease = robot.acquire_lease("again")
    pipeline.settle()  # a thread may still step the engine, which goes to the next test
    return readings


def test_an_alarm_while_it_waits_does_not_forget_the_step_under_way(engine):
    under_way = Future()
    pipeline = Pipeline(engine, lambda step: under_way)
    pipeline.advance(TICK_S)
    with pytest.raises(AlarmError), alarm_after(0.02):
        pipeline.settle()
    under_way.set_exception(RuntimeError("the step failed"))
    with pytest.raises(RuntimeError, match="the step failed"):
        pipeline.settle()
    pipeline.settle()


class AlarmError(Exception):
    """Raised by the alarm."""


@contextmanager
def alarm_after(time_s):
    """Raises AlarmError in the main thread after a time on the wall's clock."""

    def ring(number, frame):
        raise AlarmError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, time_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
