"""Two robots in each other's way; prints JSON.

    python -m tests.benchmarks.traffic [--what door,missions] [--first 0] [--count 5] [--out FOLDER]

`door`: the two meet at a door or passage that one fits through, each on its way to the place where the other begins;
world, door, kinds of robots, starts and delays are drawn from the case's number, and nobody else is about. `missions`:
each has a mission of its own. Reported are how many runs ended with both fulfilled (`resolved`: by the tree, and not
denied by the referee), contacts between the two and all collisions by the referee, and deadlocks: runs that stood
still for 60 s, or ran out of time.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from executive.app.mission_run import run_request
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.run.visitor import Progress, RunVisitor
from executive.words.robot_config import RobotConfig
from skills.robot import Pose2D
from tests.benchmarks.traffic_cases import meeting, missions

STILL_S, MOVED_M = 60.0, 0.1
TIME_LIMIT_S = 400.0


@dataclass
class Standing(RunVisitor):
    """Sees how long no robot has moved (s)."""

    longest_s: float = 0.0
    _last: dict[str, Pose2D] = field(default_factory=dict)
    _moved_s: float = 0.0

    def tick(self, progress: Progress) -> None:
        """Take in a tick."""
        for name, status in progress.robots.items():
            pose, last = status.pose, self._last.get(name)
            if pose is None:
                continue
            if last is None or math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m) > MOVED_M:
                self._last[name], self._moved_s = pose, progress.now_s
        self.longest_s = max(self.longest_s, progress.now_s - self._moved_s)


@dataclass(frozen=True)
class Result:
    """What came of one run."""

    what: str
    number: int
    world: str
    kinds: tuple[str, ...]
    sentence: str
    resolved: bool
    contacts: int
    collisions: int
    deadlock: bool
    stood_s: float
    sim_time_s: float
    messages: tuple[str, ...]


def case(what: str, number: int) -> tuple[str, str, tuple[RobotConfig, ...]]:
    """A world, what is said, and the robots. Raises KeyError: there is no such kind of case."""
    met = {"door": meeting, "missions": missions}[what](number)
    return met if isinstance(met, tuple) else (met.world, met.sentence, met.robots)


def run_case(what: str, number: int, out: Path) -> Result:
    """Run one case."""
    world, sentence, robots = case(what, number)
    request = Request(
        sentence=sentence,
        world=world,
        seed=number,
        out=out / f"{what}-{number}",
        record=False,
        time_limit_s=TIME_LIMIT_S,
        robots=robots,
    )
    request.out.mkdir(parents=True, exist_ok=True)
    prepared = prepare(request, ask=None)
    here = prepared.world if what == "missions" else prepared.world.without_people()
    backend = SimulatedBackend(here, prepared.robots, seed=number, record=False)
    standing = Standing()
    report = run_request(prepared, backend, visitors=[standing]).report
    seen = [each.referee for each in report.robots.values() if each.referee is not None]
    return Result(
        what,
        number,
        world,
        tuple(robot.kind for robot in robots),
        sentence,
        resolved=all(each.achieved for each in report.robots.values()),
        contacts=max(each.robots_hit for each in seen),
        collisions=max(each.collisions for each in seen),
        deadlock=standing.longest_s >= STILL_S or report.sim_time_s >= TIME_LIMIT_S,
        stood_s=round(standing.longest_s, 1),
        sim_time_s=report.sim_time_s,
        messages=tuple(each.message for each in report.robots.values()),
    )


def summary(results: Sequence[Result]) -> dict[str, object]:
    """The figures of some runs."""
    return {
        "runs": len(results),
        "resolved": sum(each.resolved for each in results),
        "contacts": sum(each.contacts for each in results),
        "collisions": sum(each.collisions for each in results),
        "deadlocks": sum(each.deadlock for each in results),
        "longest_s": max(each.sim_time_s for each in results),
    }


def main() -> int:
    """Run the cases that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--what", default="door")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("out/traffic"))
    args = parser.parse_args()
    for what in args.what.split(","):
        results = []
        for number in range(args.first, args.first + args.count):
            results.append(run_case(what, number, args.out))
            print(json.dumps(asdict(results[-1])), file=sys.stderr, flush=True)
        print(json.dumps({what: summary(results)}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
