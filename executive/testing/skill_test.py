"""Skill tests in YAML: skill, ports, robot, world, faults, and the expected end.

A file `*.skilltest.yaml` holds the tests of one skill. Keys above `tests` apply to each test that does not override
them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, field_validator, model_validator

from executive.mission.load import load_stack
from executive.testing.bench import SkillBench, SkillRun, room_knowledge, scripted_bench
from executive.tree.port_values import (
    PortValueError,
    assign_ports,
    describe_type,
    field_types,
    port_value,
    required_fields,
)
from executive.tree.registry import missing_skill
from skills.api import Cause, Skill
from skills.doorway import Doorway
from skills.faults.fault_kinds import STANDARD_FAULTS, FaultKind
from skills.faults.faulty_robot import parse_fault
from skills.inputs.errors import with_article
from skills.inputs.schema import Strict, validate
from skills.inputs.yaml_source import YamlSource, read_yaml
from skills.quantities import Angle, Coordinate, Delay, Duration, Height, Length, Quantity, Share, Turn
from skills.robot import Capabilities, Pose2D
from skills.stack import StackError, door_opener
from skills.testing.blocks import ROOM, TABLE_CAN, Block
from skills.testing.robot import ScriptedRobot, Start

SUFFIX = ".skilltest.yaml"
_Place = tuple[Coordinate, Coordinate, Height]
_Size = tuple[Length, Length, Length]
_Shade = Annotated[int, Quantity(ge=0, le=255)]


class PoseSetup(Strict):
    """Planar pose in the world frame."""

    x: Coordinate = Field(default=0.0, description="metres")
    y: Coordinate = Field(default=0.0, description="metres")
    yaw: Angle = Field(default=0.0, description="radians, counter-clockwise from x")


class RobotSetup(Strict):
    """Robot and its state at the beginning."""

    kind: Literal["scripted", "plant"] = Field(
        default="scripted",
        description="scripted: exact and fast; plant: the simulated Spot in the small room, with physics",
    )
    pose: PoseSetup = Field(default=PoseSetup(), description="start pose (scripted only)")
    before: tuple[Coordinate, Coordinate] | None = Field(
        default=None, description="point (x, y) that it faces from its arm's best standing distance (scripted only)"
    )
    arm: tuple[Angle, ...] | None = Field(
        default=None, description="arm angles, rad; by default stowed (scripted only)"
    )
    holding: bool = Field(default=False, description="whether it begins with a can in its gripper (scripted only)")
    in_gripper: Turn | None = Field(
        default=None, description="opening (rad) at which a closing gripper holds an object (scripted only)"
    )
    pulled_at_s: Delay | None = Field(
        default=None, description="time from which a person pulls at the held object (scripted only)"
    )
    docked: bool = Field(default=False, description="whether it stands on a dock and charges (scripted only)")
    charge: Share = Field(default=0.9, description="battery, 0 to 1 (scripted only)")
    lost: bool = Field(default=False, description="whether it is not localised (scripted only)")
    stack: Path | None = Field(default=None, description="stack file beside this one, whose detector it uses")


class BlockSetup(Strict):
    """Upright block in the scripted robot's world."""

    at: _Place = Field(description="middle of its base: x, y, z in metres")
    size: _Size = Field(description="extent along x, y and z in metres, each above 0")
    colour: tuple[_Shade, _Shade, _Shade] = Field(default=(200, 195, 185), description="red, green, blue from 0 to 255")
    loose: bool = Field(default=False, description="whether the robot can take it")


class DoorSetup(Strict):
    """Door that the scripted robot knows; blocks make it closed."""

    at: tuple[Coordinate, Coordinate] = Field(description="its middle (x, y) in metres")
    width: Length = Field(description="clear width in metres")
    through: Angle = Field(default=0.0, description="direction through it, radians")
    opens: dict[str, Any] | None = Field(default=None, description="the plug-in that opens it, and its options")

    @field_validator("opens")
    @classmethod
    def _is_a_plug_in(cls, opens: dict[str, Any] | None) -> dict[str, Any] | None:
        try:
            return opens if opens is None or door_opener(opens) else None
        except StackError as error:
            raise ValueError(str(error)) from error

    @property
    def doorway(self) -> Doorway:
        """Doorway as the skills' own data type."""
        opener = None if self.opens is None else door_opener(self.opens)
        return Doorway(self.at, self.width, self.through, opener=opener)


class WorldSetup(Strict):
    """World in which a test takes place."""

    room: bool = Field(default=True, description="a room of 6 m by 5 m, with a table before the origin")
    can: bool = Field(default=True, description="a red can near the edge of the table")
    blocks: tuple[BlockSetup, ...] = Field(default=(), description="further blocks (scripted only)")
    doors: tuple[DoorSetup, ...] = Field(default=(), description="doors that the robot knows (scripted only)")


class Expectation(Strict):
    """Expected result of the skill."""

    outcome: Literal["success", "failure", "cancelled"] = Field(description="outcome")
    cause: Cause | None = Field(default=None, description="the cause of a failure")
    message: str | None = Field(default=None, description="a regular expression that the last message contains")
    within_s: Duration | None = Field(default=None, description="time limit on the robot's clock, seconds")

    @field_validator("message")
    @classmethod
    def _is_a_pattern(cls, message: str | None) -> str | None:
        try:
            re.compile(message or "")
        except re.error as error:
            raise ValueError(f"is no regular expression ({error})") from error
        return message

    @model_validator(mode="after")
    def _cause_fits(self) -> Expectation:
        if self.outcome == "success" and self.cause is not None:
            raise ValueError("a success has no cause")
        return self


class SkillTest(Strict):
    """Test for a skill."""

    name: Annotated[str, Field(min_length=1, description="name of the test")]
    with_: dict[str, Any] = Field(
        default_factory=dict, alias="with", description="input ports, in place of those of the file"
    )
    robot: RobotSetup | None = Field(default=None, description="in place of the file's")
    world: WorldSetup | None = Field(default=None, description="in place of the file's")
    faults: tuple[str, ...] = Field(default=(), description='faults in words, as in "camera freezes at 3 s"')
    cancel_at_s: Delay | None = Field(default=None, description="time at which the skill is cancelled, s")
    expect: Expectation = Field(description="expected end")


class SkillTestFile(Strict):
    """File with tests for one skill."""

    skill: Annotated[str, Field(min_length=1, description="registered name of the skill")]
    with_: dict[str, Any] = Field(default_factory=dict, alias="with", description="input ports of all tests")
    robot: RobotSetup = Field(default=RobotSetup(), description="the robot of all tests")
    world: WorldSetup = Field(default=WorldSetup(), description="the world of all tests")
    suite: bool = Field(
        default=False,
        description="whether to run the skill suite on each test that expects success and has no faults",
    )
    tests: Annotated[tuple[SkillTest, ...], Field(min_length=1, description="the tests")]
    _source: YamlSource = PrivateAttr()

    @model_validator(mode="after")
    def _names_differ(self) -> SkillTestFile:
        names = [test.name for test in self.tests]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two tests are named {twice!r}")
        return self

    def line(self, index: int) -> int:
        """Line of a test in the file, counted from 1."""
        return self._source.line(("tests", index))

    def inputs(self, index: int, skill: type[Skill[Any]]) -> Any:
        """Returns a test's inputs for the skill, grounded in the room. Raises InputError with file and line."""
        hints, knowledge = field_types(skill.Inputs), room_knowledge()
        values = {**self.with_, **self.tests[index].with_}
        try:
            found = assign_ports(values, skill.Inputs)
            missing = [name for name in required_fields(skill.Inputs) if name not in found]
            if missing:
                hint = f"give it {with_article(describe_type(hints[missing[0]]))}"
                raise PortValueError((), f"input port '{missing[0]}' has no value", hint)
            given = {port: port_value(value, hints[port], knowledge, at) for port, (at, value) in found.items()}
        except PortValueError as error:
            own = not self.with_ or (bool(error.path) and error.path[0] in self.tests[index].with_)
            where = ("tests", index, "with") if own else ("with",)
            port = ".".join(map(str, error.path))
            what = f"{port}: {error.message}" if port else error.message
            raise self._source.error((*where, *error.path), what, error.hint) from error
        return skill.Inputs(**given)


def load_skill_tests(
    path: Path | str, skills: Mapping[str, type[Skill[Any]]], kinds: Sequence[FaultKind] = STANDARD_FAULTS
) -> SkillTestFile:
    """Reads a file of skill tests and checks it against the registered skills.

    Raises InputError with file, line and hint for broken YAML, unknown keys, skills, ports or faults, or wrong values.
    """
    source = read_yaml(path)
    file = validate(SkillTestFile, source)
    file._source = source
    if file.skill not in skills:
        raise source.error(("skill",), *missing_skill(file.skill, skills))
    for index, test in enumerate(file.tests):
        file.inputs(index, skills[file.skill])
        for number, words in enumerate(test.faults):
            try:
                parse_fault(words, kinds)
            except ValueError as error:
                what, _, hint = str(error).partition("; ")
                raise source.error(("tests", index, "faults", number), what, hint) from error
    return file


BenchMaker = Callable[[RobotSetup, WorldSetup], SkillBench]
BenchMakers = Mapping[str, BenchMaker]
"""Factories of benches by kind of robot."""

_LAST_MESSAGES = 12


@dataclass(frozen=True)
class Trial:
    """Result of one test; `differences` is empty if it met its expectation."""

    test: SkillTest
    run: SkillRun
    differences: tuple[str, ...]

    def report(self) -> str:
        """Formats differences, result, faults and the last messages as text."""
        run = self.run
        lines = [*self.differences, ""]
        lines.append(f"it ended with {_end(run.outcome, run.cause)} after {run.time_s:g} s: {run.message}")
        lines += [f"fault: {words}" for words in self.test.faults]
        lines += ["messages:"]
        lines += [f"  {at_s:7.2f} s  {message}" for at_s, message in run.messages[-_LAST_MESSAGES:]]
        return "\n".join(lines)


def scripted_maker(capabilities: Capabilities) -> BenchMaker:
    """Returns a factory of benches with a scripted robot that has these capabilities."""

    return lambda setup, world: bench_of_setup(capabilities, setup, world)[0]


def bench_of_setup(
    capabilities: Capabilities, setup: RobotSetup, world: WorldSetup
) -> tuple[SkillBench, ScriptedRobot]:
    """Builds a bench with the scripted robot and the world that a file describes; returns both."""
    pose = Pose2D(setup.pose.x, setup.pose.y, setup.pose.yaw)
    if setup.before is not None and capabilities.arm is not None:
        pose = Pose2D(setup.before[0] - capabilities.arm.standing_m[0], setup.before[1], 0.0)
    start = Start(pose, setup.arm, setup.in_gripper, setup.holding, setup.charge, setup.docked, setup.pulled_at_s)
    doors = tuple(door.doorway for door in world.doors)
    return scripted_bench(capabilities, start, blocks_of(world), localised=not setup.lost, doors=doors)


def blocks_of(world: WorldSetup) -> tuple[Block, ...]:
    """Returns the blocks that a world contains."""
    blocks = [*(ROOM if world.room else ()), *((TABLE_CAN,) if world.can else ())]
    for each in world.blocks:
        (x, y, z), (dx, dy, dz) = each.at, each.size
        box = (x - dx / 2, y - dy / 2, x + dx / 2, y + dy / 2)
        blocks.append(Block(*box, z, z + dz, each.colour, each.loose))
    return tuple(blocks)


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
    if setup.stack is not None:
        bench.use_detector(load_stack(file._source.path.parent / setup.stack).detector.build())
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
