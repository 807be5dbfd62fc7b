"""A rover from a URDF on a bare floor: it drives, moves its arm and its fingers, and senses."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from plant.diagram import DiagramConfig, build_diagram
from plant.engine import Engine
from plant.robots import robot_kind as kinds
from plant.robots.robot_kind import PlacedRobot
from skills.robot import ArmTrajectory, CommandState, Pose2D
from tests.plant.boxes import fixed_box
from tests.plant.kept_engine import KeptEngine


@pytest.fixture(scope="module")
def kept_rover(rover_package, tmp_path_factory):
    floor = fixed_box(tmp_path_factory.mktemp("floor"), "floor", "20 20 0.2", "0 0 -0.1")
    entry = EntryPoint("rover", f"{rover_package.name}:KIND", kinds.GROUP)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(rover_package.parent)
        patch.setattr(kinds, "robot_kinds", lambda: {"rover": entry})
        kinds.robot_kind.cache_clear()
        robot = PlacedRobot("Bob", "rover", Pose2D(0.5, 0.2, 0.0))
        yield KeptEngine(Engine(build_diagram(DiagramConfig(models=[floor], robots=[robot], render=False))))
    kinds.robot_kind.cache_clear()


@pytest.fixture
def engine(kept_rover):
    return kept_rover.again()


@pytest.fixture
def rover(engine):
    return engine.robots["Bob"]


@pytest.fixture
def lease(rover):
    return rover.acquire_lease("test")


def state(rover, command):
    return rover.command_status(command).state


def test_it_stands_with_its_arm_stowed(engine, rover):
    engine.advance(1.0)
    can = rover.capabilities()
    angles = [rover.joints().position_rad[name] for name in can.arm.joint_names]
    assert np.allclose(angles, can.arm.stowed_rad, atol=0.02)
    height_m = engine.world.plant.EvalBodyPoseInWorld(engine.context, engine.world.robots["Bob"].body).translation()[2]
    assert height_m == pytest.approx(can.standing_height_m, abs=0.01)


def test_it_drives_ahead_and_turns_and_not_aside(engine, rover, lease):
    before = rover.odometry().pose
    rover.drive(0.4, 0.0, 0.5, until_s=2.0, lease=lease)
    engine.advance(2.5)
    after = rover.odometry().pose
    assert after.x_m - before.x_m > 0.4 and after.yaw_rad - before.yaw_rad > 0.5
    refused = rover.command_status(rover.drive(0.0, 0.2, 0.0, until_s=4.0, lease=lease))
    assert refused.state is CommandState.REFUSED and "sideways" in refused.reason


def test_its_arm_follows_a_trajectory(engine, rover, lease):
    can = rover.capabilities()
    start = np.array(can.arm.stowed_rad)
    goal = start + np.where(start > 0.0, -0.3, 0.3)
    command = rover.move_arm(ArmTrajectory(np.array([0.0, 1.5]), np.array([start, goal])), until_s=4.0, lease=lease)
    engine.advance(3.0)
    assert state(rover, command) is CommandState.DONE
    assert np.allclose([rover.joints().position_rad[name] for name in can.arm.joint_names], goal, atol=0.02)


def test_its_fingers_open_and_close(engine, rover, lease):
    for opening in (0.08, 0.0):
        command = rover.set_gripper(opening, 30.0, until_s=engine.now() + 3.0, lease=lease)
        engine.advance(2.0)
        assert state(rover, command) is CommandState.DONE
        assert rover.gripper().opening == pytest.approx(opening, abs=0.004)


def test_its_lidar_has_one_ring(engine, rover):
    engine.advance(0.2)
    assert rover.scan().ranges_m.shape == (1, 720)


def test_it_stands_at_one_height(engine, rover, lease):
    height_m = rover.capabilities().standing_height_m
    command = rover.stand(height_m, 0.0, until_s=1.0, lease=lease)
    engine.advance(0.1)
    assert state(rover, command) is CommandState.DONE
    assert state(rover, rover.stand(height_m + 0.1, 0.0, until_s=1.0, lease=lease)) is CommandState.REFUSED


def test_its_state_is_saved_and_restored(engine, rover, lease):
    rover.set_gripper(0.06, 30.0, until_s=3.0, lease=lease)
    engine.advance(1.0)
    saved = rover.state()
    rover.restore(saved)
    assert rover.state() == saved
