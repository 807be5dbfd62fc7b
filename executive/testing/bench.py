"""Test bench for one skill: its leaf, a robot, estimators and a clock, ticked as the runner does."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from py_trees.common import Status

from executive.run.worker import LockStepWorker
from executive.tree.board import Board, Constant
from executive.tree.context import RunContext
from executive.tree.nodes.skill_leaf import SkillLeaf
from skills.api import Cause, Costmap, Detector, Localiser, Skill, SkillContext
from skills.faults.fault_kinds import STANDARD_FAULTS, FaultKind
from skills.faults.fault_words import Fault, parse_fault
from skills.faults.faulty_robot import inject_faults
from skills.robot import Capabilities, Clock, Robot
from skills.testing.blocks import ROOM, TABLE_CAN, Block
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace, PlainColours
from skills.testing.robot import ScriptedRobot, Start

TICK_S = 0.05
HOLDER = "test"
_PREFIX = "bench"
_GOES_ON = (Status.INVALID, Status.RUNNING)
_OUTCOMES = {Status.SUCCESS: "success", Status.FAILURE: "failure"}


@dataclass(frozen=True)
class SkillRun:
    """Result of a skill on the bench.

    `outcome` is "success", "failure" or "cancelled"; `messages` are the skill's messages with their times (s).
    """

    outcome: str
    cause: Cause | None
    message: str
    time_s: float
    ticks: int
    outputs: Mapping[str, Any]
    messages: tuple[tuple[float, str], ...]


class SkillBench:
    """Robot with its lease, estimators and log, which runs one skill after another."""

    def __init__(
        self,
        robot: Robot,
        clock: Clock,
        *,
        localiser: Localiser | None = None,
        costmap: Costmap | None = None,
        detector: Detector | None = None,
        seed: int = 0,
    ) -> None:
        """Takes the robot's lease. Ideal estimators replace those that are not given."""
        self.robot, self.clock = robot, clock
        self._capabilities = robot.capabilities()
        self.sensing = False
        self.published: list[tuple[str, Mapping[str, Any]]] = []
        self._context = RunContext(
            robot=robot,
            lease=robot.acquire_lease(HOLDER),
            clock=clock,
            worker=LockStepWorker(clock),
            localiser=localiser or KnownPlace(),
            costmap=costmap or BlockCostmap(),
            publish=lambda topic, message: self.published.append((topic, message)),
            seed=seed,
            board=Board(_PREFIX),
            detector=detector or PlainColours(),
        )
        self._sense(robot)

    def context(self) -> SkillContext:
        """Returns the context with which a skill is created."""
        return self._context.for_skill(f"{_PREFIX}/skill")

    def inject(self, *words: str, kinds: Sequence[FaultKind] = STANDARD_FAULTS) -> None:
        """Injects faults in words. Raises ValueError for words that are no fault of this robot."""
        cameras = [camera.source for camera in self._capabilities.cameras]
        self.add_faults(*(parse_fault(each, kinds, cameras=cameras) for each in words))

    def add_faults(self, *faults: Fault) -> None:
        """Injects faults."""
        self.robot = inject_faults(self.robot, self.clock, faults)
        self._context = replace(self._context, robot=self.robot)

    def leaf(self, skill: type[Skill[Any]], inputs: Any, *, limit_s: float | None = None) -> SkillLeaf:
        """Returns the skill's leaf with these inputs, as in a tree; `limit_s` is its time limit."""
        fields = {name: Constant(value) for name, value in vars(inputs).items()}
        return SkillLeaf(
            path_id=f"{_PREFIX}/skill",
            name=skill.name,
            skill=skill,
            inputs=fields,
            outputs={port: f"{_PREFIX}/{port}" for port in skill.outputs},
            limit_s=limit_s or skill.default_timeout_s,
            context=self._context,
        )

    def tick(self, leaf: SkillLeaf) -> None:
        """Advances the clock by one period, updates the estimators, and ticks the leaf."""
        self.clock.advance(TICK_S)
        self._sense(self.robot)
        leaf.tick_once()

    def run(
        self, skill: type[Skill[Any]], inputs: Any, *, limit_s: float | None = None, cancel_at_s: float = math.inf
    ) -> SkillRun:
        """Runs a skill until it ends, reaches its time limit (s), or is cancelled at a time (s)."""
        leaf = self.leaf(skill, inputs, limit_s=limit_s)
        begun_s, ticks = self.clock.now(), 0
        messages: list[tuple[float, str]] = []
        while leaf.status in _GOES_ON and self.clock.now() - begun_s < cancel_at_s - TICK_S / 2:
            self.tick(leaf)
            ticks += 1
            if not messages or messages[-1][1] != leaf.message:
                messages.append((round(self.clock.now() - begun_s, 3), leaf.message))
        outcome = _OUTCOMES.get(leaf.status, "cancelled")
        if leaf.status in _GOES_ON:
            leaf.stop(Status.INVALID)
        outputs = {port: self._context.board.get(f"{_PREFIX}/{port}") for port in skill.outputs if outcome == "success"}
        time_s = round(self.clock.now() - begun_s, 3)
        return SkillRun(outcome, leaf.cause, leaf.message, time_s, ticks, outputs, tuple(messages))

    def close(self) -> None:
        """Stops the robot and returns the lease, as the runner does at the end; ignores errors of the robot."""
        with suppress(Exception):
            self.robot.stop(lease=self._context.lease)
        with suppress(Exception):
            self.robot.return_lease(self._context.lease)

    def _sense(self, robot: Robot) -> None:
        """Updates the estimators. They keep their estimates if the robot's sensors raise."""
        context, self.sensing = self._context, True
        try:
            context.localiser.update(robot)
            context.costmap.update(robot, context.localiser.estimate())
        except Exception as defect:
            context.publish("errors", {"node": "estimators", "traceback": repr(defect)})
        finally:
            self.sensing = False


def scripted_bench(
    capabilities: Capabilities,
    start: Start = Start(),  # noqa: B008 - frozen
    blocks: Sequence[Block] = (*ROOM, TABLE_CAN),
    *,
    localised: bool = True,
) -> tuple[SkillBench, ScriptedRobot]:
    """Builds a bench with a scripted robot, by default in the room with a table and a can; returns both."""
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=capabilities, blocks=blocks, start=start)
    place = KnownPlace(start.pose)
    place.localised = localised
    return SkillBench(robot, clock, localiser=place, costmap=BlockCostmap(blocks)), robot
