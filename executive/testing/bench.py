"""Test bench for one skill: leaf, robot, estimators and clock, ticked as the runner does; also the small room."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final
from xml.sax.saxutils import quoteattr

import cv2
import yaml
from py_trees.common import Status

from executive.run.worker import LockStepWorker
from executive.tree.board import Board, Constant
from executive.tree.context import RunContext
from executive.tree.nodes.skill_leaf import ERROR_TOPIC, SkillLeaf
from executive.words.knowledge import Knowledge
from skills.api import Cause, Costmap, Detector, Localiser, Skill, SkillContext
from skills.detection import with_defaults
from skills.doorway import Doorway
from skills.faults.fault_kinds import STANDARD_FAULTS, FaultKind, InjectedFault
from skills.faults.faulty_robot import Fault, inject_faults, parse_fault
from skills.inputs.yaml_source import read_yaml
from skills.robot import Capabilities, Clock, Robot
from skills.testing.blocks import ROOM, TABLE_CAN, Block, grid_of
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace, PlainColours
from skills.testing.robot import ScriptedRobot, Start

_LOG: Final = logging.getLogger(__name__)
_FLOOR = Block(-2.1, -2.6, 4.1, 2.6, -0.1, 0.0, (150, 140, 130))
_BANDS = {"scan": (0.7, 1.3), "keepout": (0.05, 1.0)}
_RESOLUTION_M = 0.025


def write_small_room(folder: Path, *, can: bool = True) -> Path:
    """Writes the small room into `folder` and returns it. The seed places its only object, a can, on the table."""
    (folder / "map").mkdir(parents=True, exist_ok=True)
    (folder / "room.sdf").write_text(_sdf([_FLOOR, *ROOM]), encoding="utf-8")
    model = {"add_model": {"name": "room", "file": (folder / "room.sdf").resolve().as_uri()}}
    weld = {"add_weld": {"parent": "world", "child": "room::room"}}
    _write_yaml(folder / "world.dmd.yaml", {"directives": [model, weld]})
    _write_yaml(folder / "knowledge.yaml", _facts()["knowledge"])
    _write_yaml(folder / "objects.yaml", _facts()["objects"] | ({} if can else {"objects": []}))
    for name, band_m in _BANDS.items():
        _write_map(folder / "map", name, band_m)
    return folder


def room_knowledge() -> Knowledge:
    """Returns the knowledge of the small room."""
    return Knowledge.model_validate(_facts()["knowledge"])


def _write_yaml(path: Path, data: Mapping[str, Any]) -> None:
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")


@cache
def _facts() -> dict[str, Any]:
    """Reads knowledge and objects of the small room."""
    facts: dict[str, Any] = read_yaml(Path(__file__).with_name("small_room.yaml")).data
    return facts


def _write_map(folder: Path, name: str, band_m: tuple[float, float]) -> None:
    grid = grid_of(ROOM, band_m, _RESOLUTION_M)
    grey = grid.grey(free=254, unknown=205, occupied=0)
    cv2.imwrite(str(folder / f"{name}.pgm"), grey[::-1])
    facts = {
        "image": f"{name}.pgm",
        "mode": "trinary",
        "resolution": _RESOLUTION_M,
        "origin": [round(grid.origin_m[0], 6), round(grid.origin_m[1], 6), 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        "height_band_m": list(band_m),
    }
    _write_yaml(folder / f"{name}.yaml", facts)


def _sdf(blocks: list[Block]) -> str:
    """Returns an SDF file with one fixed model that consists of all blocks."""
    shapes = "\n".join(_shapes(number, block) for number, block in enumerate(blocks))
    model = f'<model name="room"><link name="room">\n{shapes}\n</link></model>'
    return f'<?xml version="1.0"?>\n<sdf version="1.9">{model}</sdf>\n'


def _shapes(number: int, block: Block) -> str:
    x, y, z = (0.5 * (block.x0 + block.x1), 0.5 * (block.y0 + block.y1), 0.5 * (block.z0 + block.z1))
    size = f"{block.x1 - block.x0:.6g} {block.y1 - block.y0:.6g} {block.z1 - block.z0:.6g}"
    pose = f"<pose>{x:.6g} {y:.6g} {z:.6g} 0 0 0</pose>"
    box = f"<geometry><box><size>{size}</size></box></geometry>"
    colour = " ".join(f"{channel / 255:.3f}" for channel in block.colour)
    material = f"<material><diffuse>{colour} 1</diffuse></material>"
    name = quoteattr(f"block_{number}")
    return f"<visual name={name}>{pose}{box}{material}</visual><collision name={name}>{pose}{box}</collision>"


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
    """Robot with lease, estimators and log, which runs one skill after another."""

    def __init__(
        self,
        robot: Robot,
        clock: Clock,
        *,
        localiser: Localiser | None = None,
        costmap: Costmap | None = None,
        detector: Detector | None = None,
        doors: tuple[Doorway, ...] = (),
        seed: int = 0,
    ) -> None:
        """Acquires the robot's lease. Ideal estimators replace those that are not given."""
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
            publish=self._publish,
            seed=seed,
            board=Board(_PREFIX),
            detector=with_defaults(detector or PlainColours()),
            doors=doors,
        )
        self._sense(robot)

    def context(self) -> SkillContext:
        """Returns the context with which a skill is created."""
        return self._context.for_skill(f"{_PREFIX}/skill")

    def use_detector(self, detector: Detector) -> None:
        """Replaces the detector for the skills that run from now on."""
        self._context = replace(self._context, detector=with_defaults(detector))

    def inject(self, *words: str, kinds: Sequence[FaultKind] = STANDARD_FAULTS) -> None:
        """Injects faults that words describe. Raises ValueError for words that describe no fault of this robot."""
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

    def _publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """Keeps a message; logs the traceback of a skill that raises, except for an injected fault."""
        self.published.append((topic, message))
        if topic == ERROR_TOPIC and InjectedFault.__name__ not in message["traceback"]:
            _LOG.error("%s", message["traceback"])

    def _sense(self, robot: Robot) -> None:
        """Updates the estimators, which keep their estimates if the robot's sensors raise an error."""
        context, self.sensing = self._context, True
        try:
            context.localiser.update(robot)
            context.costmap.update(robot, context.localiser.estimate())
        except Exception as defect:
            self.published.append((ERROR_TOPIC, {"node": "estimators", "traceback": repr(defect)}))
        finally:
            self.sensing = False


def scripted_bench(
    capabilities: Capabilities,
    start: Start = Start(),  # noqa: B008 - frozen
    blocks: Sequence[Block] = (*ROOM, TABLE_CAN),
    *,
    localised: bool = True,
    doors: tuple[Doorway, ...] = (),
) -> tuple[SkillBench, ScriptedRobot]:
    """Builds a bench with a scripted robot, by default in the room with a table and a can; returns both."""
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=capabilities, blocks=blocks, start=start)
    place = KnownPlace(start.pose)
    place.localised = localised
    return SkillBench(robot, clock, localiser=place, costmap=BlockCostmap(blocks), doors=doors), robot
