"""Task water: the hand tilts over an object for some seconds, as one pours."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any, ClassVar

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from executive.tree.board import FromBoard
from executive.tree.node import NodeSpec
from executive.tree.nodes.command_plans import go_to_object
from executive.tree.plan import PlanBuilder
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.knowledge import Knowledge
from executive.words.task import Part
from skills.api import Cause, ObjectObservation, PlanningError, Succeeded
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.manipulation.arm.collision import ArmScene
from skills.quantities import Duration
from skills.robot import FloatArray
from skills.routine import Routine

POUR_S, TILTS_RAD = 3.0, (1.2, -1.2)
"""How long the hand pours, and how far it rolls for that, to one side or the other."""
ABOVE_M, ASIDE_RAD = (0.12, 0.18, 0.08), (0.0, 0.3, -0.3, 0.6, -0.6)
"""Heights of the tips above the object, and directions of the hand, the best first."""
OVER_M, TILTED_RAD, SAMPLE_S = 0.12, 1.0, 0.1
"""The judge's limits: distance of the tips from above the object, and tilt of the hand; time between two samples."""
TIPS_H = np.array([0.2, 0.0, 0.0])


@dataclass(frozen=True)
class PourInputs:
    """Object over which the hand tilts, and for how long (s)."""

    observation: ObjectObservation
    lasts_s: Duration = POUR_S


class Pour(ArmSkill[PourInputs]):
    """Holds the hand over an object and tilts it for some time. Does not drive."""

    name = "pour"
    Inputs = PourInputs
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "the arm reaches no pose over the object",
        Cause.EXECUTION: "the arm did not reach its pose",
    }
    default_timeout_s = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "joints": 0.5, "gripper": 0.5}

    def run(self, inputs: PourInputs) -> Routine[Succeeded]:
        """Holds the hand level over the object, tilts it, and waits."""
        name = inputs.observation.kind.name
        p_BT = self.X_WB().inverse() @ np.array(inputs.observation.position_W)
        p_BT[2] += inputs.observation.size_m[2] / 2
        for rolls_rad in ((0.0,), TILTS_RAD):
            over = partial(self._hand_over, p_BT, rolls_rad)
            yield from self.move_to(over, f"pouring on the {name}")
        yield from self.pause(inputs.lasts_s, f"pouring on the {name}")
        return Succeeded(f"poured on the {name} for {inputs.lasts_s:g} s")

    def _hand_over(
        self, p_BT: FloatArray, rolls_rad: tuple[float, ...], scene: ArmScene, q_near_rad: FloatArray
    ) -> FloatArray:
        """Free joint angles with the tips of the hand over p_BT, rolled. Raises PlanningError when there are none."""
        ahead_rad = np.arctan2(*(p_BT - self.model.p_BS)[1::-1])
        for above_m, aside_rad in product(ABOVE_M, ASIDE_RAD):
            hands = [RollPitchYaw(roll_rad, 0.0, ahead_rad + aside_rad).ToRotationMatrix() for roll_rad in rolls_rad]
            p_BE = p_BT + [0.0, 0.0, above_m]
            found = [q for R_BH in hands for q in self.model.inverse(RigidTransform(R_BH, p_BE - R_BH @ TIPS_H))]
            if free := [q for q in found if scene.free(q)]:
                return min(free, key=lambda q: self.model.off_rad(q, q_near_rad))
        raise PlanningError("the arm does not reach over the object")


class Water(TaskPage):
    """Waters an object."""

    word = "water"
    object_is, goal_is = Part.THING, Part.PLACE
    sentences = ({"template": "(water|sprinkle) [{thing:object}]", "samples": ["water the beer"]},)

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans going to the object, and pouring."""
        seen = builder.key("seen")
        pour = builder.skill("pour", {"observation": FromBoard(seen)})
        return builder.sequence("water", go_to_object(builder, seen), builder.at("tidy").stow_after(pour))

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """What `judge` judges, of the object."""
        assert command.object is not None
        name = command.object.name
        return GoalCondition(GoalKind.OWN, classes=knowledge.classes(name), wanted=name, task=self.word)

    def judge(self, condition: GoalCondition, truth: Any) -> tuple[bool, str]:
        """Adds up how long the tilted hand was over an object of the kind during the step."""
        until_s = truth.now_s if condition.ended_s is None else condition.ended_s
        times_s = np.arange(condition.from_s, until_s, SAMPLE_S)
        hand = truth.hands[condition.robot]
        poured_s = max(
            SAMPLE_S * sum(is_over(hand.pose_at(time_s), one.place_at(time_s)) for time_s in times_s)
            for one in truth.histories
            if one.class_name in condition.classes
        )
        enough = poured_s >= POUR_S - SAMPLE_S
        return enough, f"the hand poured on the {condition.wanted} for {poured_s:.1f} s."


def is_over(X_WH: RigidTransform, p_WO: FloatArray | None) -> bool:
    """Returns whether a hand is tilted, with its tips above an object."""
    if p_WO is None:
        return False
    x, y, z = X_WH @ TIPS_H - p_WO
    return bool(np.hypot(x, y) < OVER_M and z > 0.0 and X_WH.rotation().matrix()[2, 2] < np.cos(TILTED_RAD))
