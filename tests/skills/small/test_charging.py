"""Skills at the dock: a charge ends at the level or where it does not rise; the dock is found by its tag."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from tag_pictures import picture_of

from executive.testing.bench import scripted_bench
from plant.robots.robot_kind import robot_kind
from skills.api import Cause, Failed, Running, Succeeded, Tag
from skills.robot import Battery, FrameTree, Intrinsics, Pose2D
from skills.small.charging import Charge, ChargeInputs, LocateDock, LocateDockInputs
from skills.stack import default_stack
from skills.testing.robot import Start

LENS = Intrinsics(320, 240, 165.0, 165.0, 160.0, 120.0)
HERE, DOCK = Pose2D(-0.7, 0.0, 0.0), Pose2D(0.0, 0.0, 0.0)
TAG = Tag(520, 0.146, "dock", (0.8, 0.05, 0.5), math.pi)


class Dock:
    """Clock and battery in one; the charge rises by so much a second."""

    def __init__(self, charge, rate):
        self.now_s, self.charge, self.rate = 0.0, charge, rate

    def now(self):
        return self.now_s

    def battery(self):
        return Battery(self.now_s, self.charge)

    def advance(self, dt_s):
        self.now_s += dt_s
        self.charge += self.rate * dt_s


def outcome(dock, level):
    skill, progress = Charge(SimpleNamespace(robot=dock, clock=dock, stack=default_stack())), []
    skill.begin(ChargeInputs(level))
    while isinstance(step := skill.step(), Running):
        progress.append(step.progress)
        dock.advance(0.5)
        assert dock.now_s < 1000.0
    skill.end()
    return step, progress


def test_it_waits_until_the_level_is_reached():
    dock = Dock(0.2, 0.01)
    step, progress = outcome(dock, 0.5)
    assert isinstance(step, Succeeded)
    assert dock.now_s == pytest.approx(30.0, abs=1.0)
    assert progress == sorted(progress)


def test_a_full_battery_needs_no_waiting():
    dock = Dock(0.9, 0.0)
    assert isinstance(outcome(dock, 0.8)[0], Succeeded)
    assert dock.now_s == 0.0


@pytest.mark.parametrize("rate", [0.0, -0.0002])
def test_charging_gives_up_when_the_charge_does_not_rise(rate):
    dock = Dock(0.2, rate)
    step, _ = outcome(dock, 0.8)
    assert step.cause is Cause.POSTCONDITION
    assert "does not charge here" in step.message
    assert dock.now_s < 32.0


def test_a_level_beyond_full_is_refused():
    assert outcome(Dock(0.2, 0.1), 80.0)[0] == Failed(Cause.PRECONDITION, "a charge is from 0 to 1, not 80")


def where_the_dock_is(shown, monkeypatch):
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
    step, asked = where_the_dock_is(moved, monkeypatch)
    assert {source[:5] for source in asked} == {"front"}
    expected = Pose2D.from_transform(moved.X_WT() @ TAG.X_WT().inverse() @ DOCK.transform())
    dock = step.outputs["dock"]
    assert (dock.x_m, dock.y_m) == pytest.approx((expected.x_m, expected.y_m), abs=0.02)
    assert dock.yaw_rad == pytest.approx(0.1, abs=0.03)
    assert "the dock's tag shows the dock 0.1" in step.message or "the dock 0.2" in step.message


def test_without_the_tag_the_dock_is_where_the_map_has_it(monkeypatch):
    step, _ = where_the_dock_is(None, monkeypatch)
    assert step.outputs["dock"] == DOCK
    assert step.message == "no camera shows the dock's tag; the dock is where the map has it"
