"""What the store knows of a mission: what was asked for, and how far it came before it was broken off."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from py_trees.common import Status

from executive.mission.request import Request, Start
from executive.mission.scenario import NO_SCENARIO, Scenario
from executive.words.robots import RobotSetup
from executive.words.variation import NO_VARIATION, Variation
from skills.api import Cause
from skills.robot import Pose2D


@dataclass(frozen=True)
class StepRecord:
    """What a node last said: its status, when that began, and for a skill under way its checkpoint."""

    status: Status
    cause: Cause | None
    message: str
    clock_s: float
    checkpoint: Mapping[str, Any]

    @property
    def ended(self) -> bool:
        """True when the node came to an end."""
        return self.status in (Status.SUCCESS, Status.FAILURE)


@dataclass(frozen=True)
class Replacement:
    """What one of several robots does in place of its part, by a correction: name, commands, and its tree's print."""

    name: str
    commands: tuple[str, ...]
    fingerprint: str


@dataclass(frozen=True)
class Memory:
    """All that is known of a robot's broken off mission: its nodes by path id, its blackboard, the last pose."""

    steps: Mapping[str, StepRecord]
    board: Mapping[str, Any]
    pose: Pose2D | None


_WORLD: Final = -1
"""The world decides whether the robot's name must be said; the column takes no NULL."""
_AS_THEY_ARE: Final = (
    *("name", "world_name", "robot", "seed", "fingerprint", "sentence", "text", "world"),
    *("time_of_day", "time_limit_s"),
)


def row_of(request: Request) -> dict[str, Any]:
    """A request that was understood as columns; its answers stand in its sentence."""
    own = {name: getattr(request, name) for name in _AS_THEY_ARE}
    paths = {name: None if (path := getattr(request, name)) is None else str(path) for name in ("file", "stack", "map")}
    flags = {"require_wake": _WORLD if request.require_wake is None else request.require_wake, "record": request.record}
    start = None if request.start is None else str(request.start)
    scenario = request.scenario.to_text() if request.scenario else None
    variation = request.variation.to_text() if request.variation else None
    told = {"given": json.dumps(dict(request.given)), "start": start, "scenario": scenario, "variation": variation}
    told["robots"] = robots_text(request.robots)
    return {**own, **flags, **paths, **told, "commands": json.dumps(request.commands), "out": str(request.out)}


def robots_text(robots: Mapping[str, RobotSetup]) -> str | None:
    """The robots of a run as a text; None for none."""
    values = {
        name: {
            "kind": robot.kind,
            "start": None if robot.start is None else pose_text(robot.start),
            "dock": robot.dock,
            "stack": None if robot.stack is None else str(robot.stack),
        }
        for name, robot in robots.items()
    }
    return json.dumps(values) if values else None


def robots_of_text(text: str | None) -> Mapping[str, RobotSetup]:
    """The robots that `robots_text` wrote."""
    return {
        name: RobotSetup(
            robot["kind"],
            pose_of_text(robot["start"]),
            robot["dock"],
            None if robot["stack"] is None else Path(robot["stack"]),
        )
        for name, robot in ({} if text is None else json.loads(text)).items()
    }


def pose_text(pose: Pose2D) -> str:
    """A pose as a text."""
    return json.dumps((pose.x_m, pose.y_m, pose.yaw_rad))


def pose_of_text(text: str | None) -> Pose2D | None:
    """The pose that `pose_text` wrote; None where there is none."""
    return None if text is None else Pose2D(*json.loads(text))


def request_of(row: Mapping[str, Any]) -> Request:
    """The request that `row_of` wrote."""
    return Request(
        **{name: row[name] for name in _AS_THEY_ARE},
        commands=tuple(json.loads(row["commands"])),
        file=None if row["file"] is None else Path(row["file"]),
        stack=None if row["stack"] is None else Path(row["stack"]),
        map=None if row["map"] is None else Path(row["map"]),
        given=json.loads(row["given"]),
        start=None if row["start"] is None else Start.of(row["start"]),
        robots=robots_of_text(row["robots"]),
        scenario=NO_SCENARIO if row["scenario"] is None else Scenario.of_text(row["scenario"]),
        variation=NO_VARIATION if row["variation"] is None else Variation.of_text(row["variation"]),
        out=Path(row["out"]),
        require_wake=None if row["require_wake"] == _WORLD else bool(row["require_wake"]),
        record=bool(row["record"]),
    )
