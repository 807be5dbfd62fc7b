"""The locate_dock skill: where the dock is by its tag, and where no camera shows it."""

import math
from dataclasses import replace

import pytest
from tag_pictures import picture_of

from executive.testing.bench import scripted_bench
from plant.robots.robot_kind import robot_kind
from skills.api import Running, Succeeded, Tag
from skills.robot import FrameTree, Intrinsics, Pose2D
from skills.small.locate_dock import LocateDock, LocateDockInputs
from skills.testing.robot import Start

LENS = Intrinsics(320, 240, 165.0, 165.0, 160.0, 120.0)
HERE, DOCK = Pose2D(-0.7, 0.0, 0.0), Pose2D(0.0, 0.0, 0.0)
TAG = Tag(520, 0.146, "dock", (0.8, 0.05, 0.5), math.pi)


def outcome(shown, monkeypatch):
    """What the skill says with the robot before a wall that carries the tag of another pose, or none."""
    bench, robot = scripted_bench(robot_kind("spot").capabilities(), Start(pose=HERE), ())
    context, asked = bench.context(), []
    cameras = {camera.source: camera for camera in robot.capabilities().body_cameras}

    def image(source, **_):
        X_WC = context.X_WB() @ cameras[source].X_FC
        tags = [] if shown is None else [(520, 0.146, X_WC.inverse() @ shown.X_WT())]
        frames = FrameTree({"hand_camera": ("odom", context.localiser.estimate().X_WO.inverse() @ X_WC)})
        asked.append(source)
        return replace(picture_of(tags, LENS), source=source, frames=frames)

    monkeypatch.setattr(robot, "image", image)
    skill = LocateDock(context)
    skill.begin(LocateDockInputs(TAG, DOCK))
    while isinstance(step := skill.step(), Running):
        bench.clock.advance(0.1)
    skill.end()
    assert isinstance(step, Succeeded)
    assert robot.moving_parts == ()
    return step, asked


def test_the_tag_shows_that_the_dock_has_moved(monkeypatch):
    moved = replace(TAG, p_W=(0.9, -0.05, 0.5), yaw_rad=math.pi + 0.1)
    step, asked = outcome(moved, monkeypatch)
    assert {source[:5] for source in asked} == {"front"}
    expected = Pose2D.from_transform(moved.X_WT() @ TAG.X_WT().inverse() @ DOCK.transform())
    dock = step.outputs["dock"]
    assert (dock.x_m, dock.y_m) == pytest.approx((expected.x_m, expected.y_m), abs=0.02)
    assert dock.yaw_rad == pytest.approx(0.1, abs=0.03)
    assert "the dock's tag shows the dock 0.1" in step.message or "the dock 0.2" in step.message


def test_without_the_tag_the_dock_is_where_the_map_has_it(monkeypatch):
    step, _ = outcome(None, monkeypatch)
    assert step.outputs["dock"] == DOCK
    assert step.message == "no camera shows the dock's tag; the dock is where the map has it"
