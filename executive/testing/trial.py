"""Runs skill tests, and compares their results with what they expect."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from executive.testing.bench import SkillBench, SkillRun, scripted_bench
from executive.testing.skill_test import BlockSetup, RobotSetup, SkillTest, SkillTestFile, WorldSetup
from skills.api import Skill
from skills.faults.kinds import STANDARD_FAULTS, FaultKind
from skills.robot import Capabilities, Pose2D
from skills.testing.blocks import ROOM, TABLE_CAN, Block
from skills.testing.robot import ScriptedRobot, Start

BenchMaker = Callable[[RobotSetup, WorldSetup], SkillBench]
BenchMakers = Mapping[str, BenchMaker]
"""Factories of benches by kind of robot."""

_LAST_MESSAGES = 12


@dataclass(frozen=True)
class Trial:
    """Result of one test; `differences` is empty when it met its expectation."""

    test: SkillTest
    run: SkillRun
    differences: tuple[str, ...]

    def report(self) -> str:
        """Differences, end, faults, and the last messages, as text."""
        run = self.run
        lines = [*self.differences, ""]
        lines.append(f"it ended with {_end(run.outcome, run.cause)} after {run.time_s:g} s: {run.message}")
        lines += [f"fault: {words}" for words in self.test.faults]
        lines += ["messages:"]
        lines += [f"  {at_s:7.2f} s  {message}" for at_s, message in run.messages[-_LAST_MESSAGES:]]
        return "\n".join(lines)


def scripted_maker(capabilities: Capabilities) -> BenchMaker:
    """A factory of benches with a scripted robot of these capabilities."""

    return lambda setup, world: bench_of_setup(capabilities, setup, world)[0]


def bench_of_setup(
    capabilities: Capabilities, setup: RobotSetup, world: WorldSetup
) -> tuple[SkillBench, ScriptedRobot]:
    """A bench with the scripted robot and the world that a file describes, and that robot."""
    pose = Pose2D(setup.pose.x, setup.pose.y, setup.pose.yaw)
    start = Start(pose, setup.arm, setup.in_gripper, setup.holding, setup.charge, setup.docked, setup.pulled_at_s)
    return scripted_bench(capabilities, start, blocks_of(world), localised=not setup.lost)


def blocks_of(world: WorldSetup) -> tuple[Block, ...]:
    """The blocks of a world."""
    return (*(ROOM if world.room else ()), *((TABLE_CAN,) if world.can else ()), *map(_block, world.blocks))


def _block(setup: BlockSetup) -> Block:
    (x, y, z), (dx, dy, dz) = setup.at, setup.size
    return Block(x - dx / 2, y - dy / 2, x + dx / 2, y + dy / 2, z, z + dz, setup.colour, setup.loose)


def carry_out(
    file: SkillTestFile,
    index: int,
    skill: type[Skill[Any]],
    makers: BenchMakers,
    kinds: Sequence[FaultKind] = STANDARD_FAULTS,
) -> Trial:
    """Runs one test of a file. Raises InputError if its ports do not fit."""
    test = file.tests[index]
    setup = test.robot or file.robot
    bench = makers[setup.kind](setup, test.world or file.world)
    bench.inject(*test.faults, kinds=kinds)
    inputs = file.inputs(index, skill)
    run = bench.run(skill, inputs, cancel_at_s=math.inf if test.cancel_at_s is None else test.cancel_at_s)
    bench.close()
    return Trial(test, run, tuple(_differences(test, run)))


def _differences(test: SkillTest, run: SkillRun) -> list[str]:
    expect, found = test.expect, []
    if (expect.outcome, expect.cause or run.cause) != (run.outcome, run.cause):
        wanted = _end(expect.outcome, expect.cause)
        found.append(f"expected {wanted}, got {_end(run.outcome, run.cause)}")
    if expect.message is not None and re.search(expect.message, run.message) is None:
        found.append(f"expected a message like /{expect.message}/, got: {run.message}")
    if expect.within_s is not None and run.time_s > expect.within_s:
        found.append(f"expected an end within {expect.within_s:g} s, got {run.time_s:g} s")
    return found


def _end(outcome: str, cause: Any) -> str:
    return outcome if cause is None else f"{outcome} {cause.value}"
