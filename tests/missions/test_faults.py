"""Faults by name in the plant: no kind of fault is a defect of the run, and no claim becomes false by one."""

import math
import os
import signal
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from executive import run_mission
from executive.run.outcome import Outcome
from plant.robots.sensor_suite import Camera
from skills.faults.fault_kinds import STANDARD_FAULTS
from skills.faults.faulty_robot import parse_fault
from skills.robot import Pose2D
from tests.missions.flat_mission import FETCH, FlatMission, honest
from tests.tables import table

pytestmark = pytest.mark.mission

MISSIONS = {
    "navigate": (FETCH[0].replace("grasp", "Nothing").replace("drink", "Nothing"),),
    "detect": (FETCH[0].replace("grasp", "find"),),
    "grasp": FETCH[:1],
    "hand_over": FETCH,
}
"""For each skill a mission that ends with it."""

SENSED = {"odometry", "scan", "joints", "battery"}
CALLED = {
    "navigate": SENSED | {"image", "drive", "lease_holder"},
    "detect": SENSED | {"image", "move_arm", "set_gripper"},
    "grasp": SENSED | {"image", "move_arm", "set_gripper", "gripper", "stand", "lease_holder"},
    "hand_over": SENSED | {"image", "move_arm", "set_gripper", "gripper"},
}
"""Verbs that are called while a skill works: by itself, and by the estimators. Nobody asks for `faults` then."""
RAISING = ("drive raises at 2 s", "joints returns garbage", "robot dies at 20 s")
"""Kinds of faults that are defects of the robot's driver: ERROR is the right outcome."""


@dataclass
class FaultInSkill:
    """A fault that begins with the first call of its verbs while a skill works, and counts its effects."""

    mission: FlatMission
    words: str
    skill: str
    lasts_s: float
    effects: int = 0
    begun_s: float = field(default=math.inf)

    def fault(self):
        parsed = parse_fault(self.words)
        return replace(parsed, effect=replace(parsed.effect, act=self.acts(parsed.effect)))

    def acts(self, effect):
        def act(call):
            now_s = self.mission.clock.now()
            if math.isinf(self.begun_s) and self.skill in self.mission.running() and call.verb in effect.verbs:
                self.begun_s = now_s
            on = self.begun_s <= now_s < self.begun_s + self.lasts_s
            self.effects += on and call.verb in effect.verbs
            return effect.act(call) if on or call.verb in effect.always else call.proceed()

        return act


def test_a_fetch_survives_short_faults_of_ten_kinds():
    mission = FlatMission(FETCH[:1], start=Pose2D(9.0, 5.9, 1.57))
    faults = [FaultInSkill(mission, *each) for each in table(__file__, "short_faults")[1]]
    result, verdict = mission.run(faults=[each.fault() for each in faults])
    assert [each.words for each in faults if not each.effects] == []
    assert result.outcome is Outcome.SUCCESS, result.message
    honest(result, verdict)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("words", "skill"),
    [(kind.example, skill) for kind in STANDARD_FAULTS for skill in MISSIONS
     if parse_fault(kind.example).effect.verbs & CALLED[skill]],
)  # fmt: skip
def test_no_fault_of_a_skill_is_a_defect_of_the_run_or_makes_a_claim_false(words, skill):
    mission = FlatMission(MISSIONS[skill])
    timeless = words.partition(" at ")[0].partition(" from ")[0].replace("camera.hand: dropout 5 s", "camera: dropout")
    fault = FaultInSkill(mission, timeless, skill, 30.0)
    result, verdict = mission.run(faults=[fault.fault()])
    assert fault.effects
    assert (result.outcome is Outcome.ERROR) == (words in RAISING), result.message
    honest(result, verdict)


def children():
    """Process ids of this process's children."""
    return {int(each) for each in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()}


def test_a_run_whose_rendering_process_dies_ends_with_an_error_that_says_so(tmp_path, monkeypatch):
    take, taken, before = Camera.take, [], children()

    def third_kills(self, *asked, **options):
        taken.append(self.spec.name)
        if len(taken) == 3:
            (process,) = children() - before
            os.kill(process, signal.SIGKILL)
        return take(self, *asked, **options)

    monkeypatch.setattr(Camera, "take", third_kills)
    report = run_mission("go to the kitchen", seed=1, out=tmp_path, record=False)
    assert (report.achieved, report.outcome) == (False, Outcome.ERROR.value)
    assert "the process that renders the cameras' pictures has ended" in report.message
