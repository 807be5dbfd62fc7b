"""Whole missions in the plant in which something goes wrong: they recover, or they fail and say so."""

import numpy as np
import pytest
from py_trees.common import Status
from pydrake.math import RigidTransform, RollPitchYaw

from executive.app.prepare.worlds import open_world
from executive.run.outcome import Outcome
from plant.diagram import LooseModel
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.description import HAND_LINK
from skills.faults.faulty_robot import inject_faults
from skills.robot_wrapper import RobotWrapper
from tests.missions.flat_mission import FETCH, FlatMission, honest

BEER = tuple(text.replace("drink", "beer") for text in FETCH)
BOX = """<sdf version="1.9"><model name="box"><link name="box"><inertial><mass>20</mass></inertial>{parts}</link>
</model></sdf>"""
SHAPE = "<pose>0 0 0.4 0 0 0</pose><geometry><box><size>{size}</size></box></geometry>"

pytestmark = pytest.mark.mission


def box_at(folder, x_m, y_m, size_m):
    """A box that stands somewhere and that no map knows."""
    size = " ".join(map(str, size_m))
    path = folder / "box.sdf"
    parts = "".join(f'<{kind} name="{kind}">{SHAPE.format(size=size)}</{kind}>' for kind in ("collision", "visual"))
    path.write_text(BOX.format(parts=parts), encoding="utf-8")
    return LooseModel("box", path, RigidTransform([x_m, y_m, 0.0]), fixed=True)


@pytest.mark.nightly
def test_a_blocked_doorway_is_gone_around(tmp_path):
    box = box_at(tmp_path, 9.0, 5.4, (0.7, 0.3, 0.8))
    result, verdict = FlatMission(FETCH, extra_models=(box,)).run()
    honest(result, verdict)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.collisions == 0


class WeakGripper(RobotWrapper):
    """A robot whose gripper closes too weakly at first."""

    def __init__(self, robot, weak_times, force_n):
        super().__init__(robot)
        self._left, self._force_n = weak_times, force_n

    def set_gripper(self, opening, force_n, *, until_s, lease):
        if opening == 0.0 and force_n > 30.0 and self._left > 0:
            self._left -= 1
            force_n = self._force_n
        return self._robot.set_gripper(opening, force_n, until_s=until_s, lease=lease)


@pytest.mark.nightly
def test_a_thing_that_slips_is_taken_again():
    mission = FlatMission(FETCH)
    result, verdict = mission.run(WeakGripper(mission.entry.robot, weak_times=1, force_n=1.0))
    honest(result, verdict)
    assert mission.ended("1-kitchen/grasp") == ["FAILURE", "SUCCESS"]
    assert result.outcome is Outcome.SUCCESS, result.message


class LosesHalfway(RobotWrapper):
    """A robot whose gripper loses what it holds, once it has brought it for 3 s; `lost_s` is when that was by truth."""

    BRINGS_S, OUT_M = 3.0, 0.03

    def __init__(self, mission, thing):
        engine = mission.simulation.engine
        super().__init__(mission.entry.robot)
        self._clock, self._context = engine, engine.context
        self._hand = engine.world.plant.GetBodyByName(HAND_LINK, engine.world.robots["Alice"].instance)
        self._thing = engine.world.plant.GetBodyByName(thing)
        self._begun_s = self._apart_m = self.lost_s = None

    def observe(self, progress):
        """Look how far the mission is, and where the object is."""
        hand, thing = (body.EvalPoseInWorld(self._context).translation() for body in (self._hand, self._thing))
        apart_m = float(np.linalg.norm(thing - hand))
        if self._apart_m is not None and self.lost_s is None and apart_m > self._apart_m + self.OUT_M:
            self.lost_s = progress.now_s
        if progress.states["Alice"]["alice/m/2-start/navigate"].status is not Status.RUNNING:
            return
        self._begun_s = progress.now_s if self._begun_s is None else self._begun_s
        if self._apart_m is None and progress.now_s > self._begun_s + self.BRINGS_S:
            self._apart_m, self._robot = apart_m, inject_faults(self._robot, self._clock, ["gripper loses it"])


@pytest.mark.nightly
def test_an_object_that_falls_on_the_way_is_picked_up_and_brought():
    mission = FlatMission(BEER)
    robot = LosesHalfway(mission, "beer")
    result, verdict = mission.run(robot, observer=robot.observe)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success, verdict.why
    assert verdict.drops >= 1
    noticed_s = next(t["t"] for t in mission.transitions if "lost on the way" in t["message"])
    assert noticed_s - robot.lost_s <= 0.3
    told = [t["message"] for t in mission.transitions]
    assert "the beer has left the gripper on the way to the start; it is looked for" in told


@pytest.mark.nightly
def test_a_low_battery_is_charged_in_between_and_the_mission_goes_on():
    flat = open_world("flat")
    nearly_empty = PlacedRobot("Alice", "spot", flat.start, flat.dock, charge=0.153)
    mission = FlatMission(("Take [Nothing] to [workshop] and do [find] to [hammer]",), robots=[nearly_empty])
    charges = []
    battery = mission.entry.robot.battery
    result, verdict = mission.run(observer=lambda progress: charges.append(battery().charge))
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success, verdict.why
    assert mission.ended("watch/battery")[-1] == "SUCCESS" and min(charges) > 0.1
    assert max(charges) > 0.79


def test_a_lost_place_is_found_again_and_the_mission_goes_on():
    mission = FlatMission(("Take [Nothing] to [living room] and do [Nothing] to [Nothing]",))
    localiser = mission.entry.localiser
    moved = []

    def mislead(progress):
        if progress.now_s > 1.2 and not moved:
            moved.append(True)
            estimate = localiser.estimate()
            wrong = RigidTransform(RollPitchYaw(0.0, 0.0, 2.0), [-4.0, -3.0, 0.0]) @ estimate.X_WO
            localiser.accept(type(estimate)(estimate.stamp_s, wrong, estimate.covariance, True))

    result, verdict = mission.run(observer=mislead)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success, verdict.why
    assert mission.ended("watch/lost")[-1] == "SUCCESS"
    place, goal = mission.simulation.true_pose("Alice"), mission.knowledge.places["living room"].pose
    assert (place.x_m, place.y_m) == pytest.approx((goal.x, goal.y), abs=0.1)
