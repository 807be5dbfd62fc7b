"""Two robots in each other's way; prints JSON.

    python -m tests.benchmarks.traffic [--what door,missions] [--first 0] [--count 5] [--out FOLDER]

`door`: Alice goes through a door of the flat that one fits through while Bob comes the other way, from living room to
kitchen or hall to bedroom; their starts are drawn from the case's number. `missions`: each has a mission of its own.
Reported are how many runs ended with both fulfilled by the referee, contacts between the two, all collisions, and
deadlocks: runs that stood still for 60 s, or ran out of time.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from executive.cli.mission_run import run_request
from executive.cli.several import prepare_several
from executive.cli.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.mission.robots import RobotSetup
from executive.run.runner import Progress
from skills.robot import Pose2D

STILL_S, MOVED_M = 60.0, 0.1
TIME_LIMIT_S = 240.0
SENTENCES = {
    "door": (
        ("flat", "Alice, go to the kitchen, and Bob, go to the living room"),
        ("flat", "Alice, go to the bedroom, and Bob, go to the hall"),
    ),
    "missions": (
        ("flat", "Alice, go to the bedroom, and Bob, go to the kitchen"),
        ("flat", "Alice, bring me a beer, and Bob, go to the bedroom"),
    ),
}
DOOR_STARTS = (
    {"alice": Pose2D(9.0, 4.0, math.pi / 2.0), "bob": Pose2D(9.0, 6.8, -math.pi / 2.0)},
    {"alice": Pose2D(3.3, 4.5, -math.pi / 2.0), "bob": Pose2D(3.0, 2.7, math.pi / 2.0)},
)
JITTER = ((0.4, 0.3, 0.4), (0.3, 0.05, 0.4))


@dataclass
class Standing:
    """An observer of how long no robot has moved (s)."""

    longest_s: float = 0.0
    _last: dict[str, Pose2D] = field(default_factory=dict)
    _moved_s: float = 0.0

    def __call__(self, progress: Progress) -> None:
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
    both_done: bool
    contacts: int
    collisions: int
    deadlock: bool
    sim_time_s: float
    messages: tuple[str, ...]


def run_case(what: str, number: int, out: Path) -> Result:
    """Run one case."""
    cases = SENTENCES[what]
    world, sentence = cases[number % len(cases)]
    request = Request(
        sentence=sentence,
        world=world,
        seed=number,
        out=out / f"{what}-{number}",
        record=False,
        time_limit_s=TIME_LIMIT_S,
        robots={name: RobotSetup("spot", start=_start(what, name, number)) for name in ("alice", "bob")},
    )
    request.out.mkdir(parents=True, exist_ok=True)
    prepared = prepare_several(request, ask=None)
    backend = SimulatedBackend(prepared.world, prepared.robots, seed=number, record=False)
    standing = Standing()
    report = run_request(prepared, backend, observer=standing).report
    robots = report.robots.values()
    seen = [each.referee for each in robots if each.referee is not None]
    events = [sentence for each in seen for sentence in each.events]
    hits = set(re.findall(r"(?:Alice|Bob)[^.]* hit (?:Alice|Bob)[^.]*at [\d.]+ s", "\n".join(map(str, events))))
    return Result(
        what,
        number,
        all(each.achieved for each in robots),
        len(hits),
        max(each.collisions for each in seen),
        standing.longest_s >= STILL_S or report.sim_time_s >= TIME_LIMIT_S,
        report.sim_time_s,
        tuple(each.message for each in robots),
    )


def _start(what: str, name: str, number: int) -> Pose2D | None:
    """Where a robot begins: for the door drawn about its side of it, else where the world has it."""
    if what != "door":
        return None
    rng = np.random.default_rng([number, len(name)])
    side = number % len(DOOR_STARTS)
    start = DOOR_STARTS[side][name]
    off = rng.uniform(-1.0, 1.0, 3) * JITTER[side]
    return Pose2D(start.x_m + off[0], start.y_m + off[1], start.yaw_rad + off[2])


def summary(results: Sequence[Result]) -> dict[str, object]:
    """The figures of some runs."""
    return {
        "runs": len(results),
        "both_done": sum(each.both_done for each in results),
        "contacts": sum(each.contacts for each in results),
        "collisions": sum(each.collisions for each in results),
        "deadlocks": sum(each.deadlock for each in results),
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
