"""The log of a mission of the scripted robot, with messages of every kind that has a type in ROS 2."""

import shutil
from contextlib import closing
from importlib.util import find_spec

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.record.announce import map_message
from executive.record.event_log import EventLog
from executive.run.runner import run
from executive.run.visitor import RunEntry
from executive.run.worker import LockStepWorker
from executive.testing.bench import room_knowledge
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.mission import Mission
from skills.grid_map import GridMap
from skills.robot import Joints, Pose2D, Scan
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot, Start

START = Pose2D(1.0, -0.5, 0.3)
collect_ignore = [] if find_spec("rclpy") and find_spec("nav2_msgs") else ["test_rclpy.py", "test_rclpy_nav2.py"]
"""What `make ros` brings the means for."""


@pytest.fixture(scope="session")
def log_of_session(tmp_path_factory):
    """Alice speaks; walls stand 2 m away on all sides but straight behind. There are a map, a picture and two paths."""
    clock, knowledge = VirtualClock(), room_knowledge()
    robot = ScriptedRobot(clock, start=Start(START))
    ranges, azimuths = np.full((2, 8), 2.0, np.float32), np.linspace(-np.pi, np.pi, 8, endpoint=False)
    ranges[:, 0] = np.nan
    where = RigidTransform([0.1, 0.0, 0.4]), RigidTransform()
    robot.scan = lambda: Scan(clock.now(), ranges, np.array([-0.3, 0.0]), azimuths, *where)
    robot.joints = lambda: Joints(clock.now(), {"elbow": 0.5}, {"elbow": 0.1}, {"elbow": 2.0})
    mission = Mission.model_validate({"name": "greet", "robot": "Alice", "steps": [{"speak": "Hello"}]})
    tree = compile_mission(mission, knowledge=knowledge, registry=installed_skills())
    occupied, unknown = np.zeros((4, 6), bool), np.zeros((4, 6), bool)
    occupied[0, 0] = unknown[3, 5] = True
    with closing(EventLog(file := tmp_path_factory.mktemp("log") / "log.mcap", clock)) as log:
        log("map", map_message(GridMap(occupied, 0.5, (-1.0, -2.0), unknown), knowledge, world="room"))
        log("detections", {"image": np.full((24, 32, 3), 200, np.uint8), "source": "hand", "detections": []})
        log("path", {"robot": "Alice", "frame": "world", "poses": [[1.0, 2.0, 0.0], [3.0, 4.0, 0.5]]})
        log("path", {"robot": "Bob", "frame": "world", "poses": [[0.0, 0.0, 0.0]]})
        entry = RunEntry(tree, robot, KnownPlace(START), BlockCostmap())
        run([entry], clock=clock, worker=LockStepWorker(clock), visitors=[log])
    return file


@pytest.fixture
def log_file(log_of_session, tmp_path):
    return shutil.copy(log_of_session, tmp_path / "log.mcap")


@pytest.fixture(scope="session")
def message_files(tmp_path_factory):
    """A folder with the message files of a distribution."""
    from ros_client import write_messages

    write_messages(folder := tmp_path_factory.mktemp("messages"))
    return folder


@pytest.fixture(scope="module")
def run_of_module(tmp_path_factory):
    from ros_run import run_of_alice

    with run_of_alice(tmp_path_factory.mktemp("run")) as ros:
        yield ros


@pytest.fixture
def ros(run_of_module):
    """A client of ROS 2 that steps a run of the scripted Alice, who stands where she began."""
    run_of_module.begin_anew()
    return run_of_module
