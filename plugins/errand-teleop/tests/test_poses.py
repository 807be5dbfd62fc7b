"""Poses saved as mission files: names, numbers, and files that exist."""

import math
from dataclasses import replace

import pytest

from errand_teleop.poses import SavedPose, save_pose
from executive.mission.load import load_mission
from skills.inputs.errors import InputError
from skills.robot import Pose2D

POSE = SavedPose(Pose2D(5.2, 4.5, math.pi / 2), (0.1, -1.6, 1.8, 0.0, 0.4, 0.0), 0.5)


def test_a_saved_pose_is_a_mission_file(tmp_path):
    path = save_pose(tmp_path / "poses", "by_the_table", POSE, world="flat")
    navigate, pose_arm = load_mission(path).steps
    assert (navigate.skill, pose_arm.skill) == ("navigate", "pose_arm")
    assert pose_arm.values["joints"] == list(POSE.joints_rad)


def test_poses_without_a_name_are_numbered(tmp_path):
    assert [save_pose(tmp_path, None, POSE, world="flat").name for _ in range(2)] == ["pose_1.yaml", "pose_2.yaml"]


def test_a_pose_is_never_overwritten(tmp_path):
    path = save_pose(tmp_path, "look", POSE, world="flat")
    before = path.read_text()
    with pytest.raises(InputError, match="a pose of this name exists"):
        save_pose(tmp_path, "look", replace(POSE, opening=0.0), world="flat")
    assert path.read_text() == before


@pytest.mark.parametrize("name", ["../out", "a/b", ".hidden", "x" * 100, "a b"])
def test_a_name_that_is_no_file_name_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="is no name for a pose"):
        save_pose(tmp_path, name, POSE, world="flat")


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write it"):
        save_pose(tmp_path / "file", "look", POSE, world="flat")
