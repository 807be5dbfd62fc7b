"""Missions by Fetch in the flat: it takes something and brings it to a person or a surface; prints JSON.

    python -m tests.benchmarks.fetch [--first 0] [--count 5] [--out FOLDER] [--things a,b] [--goals a,b]

The number of a mission is the seed of its world and draws what is brought, and where to: half the missions end with a
person. A line a mission goes to stderr as it ends. Reported are how many missions were fulfilled by the referee with
Wilson's interval of 95 %, false claims (the robot says that it is done, the referee denies it), contacts with what was
touched, and what the others failed of. The wrench is left out unless it is named: from the height of the head it is
seen too seldom.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np

from executive.app.evaluate.summary import Rate
from executive.app.mission_run import run_request
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.words.robot_config import RobotConfig

ROBOT: Final = "bob"
WORLD: Final = "flat"
TIME_LIMIT_S: Final = 420.0
PERSON: Final = "Robin"
THINGS: Final = ("beer", "coke", "cube", "cylinder", "hammer", "screwdriver")
SURFACES: Final = (
    "kitchen counter",
    "kitchen table",
    "coffee table",
    "sideboard",
    "night stand",
    "dresser",
    "bathroom cabinet",
    "workbench",
    "tool trolley",
    "desk",
    "hall console",
)


@dataclass(frozen=True)
class Result:
    """What came of one mission; `message` is what the robot said at its end, `why` what the referee saw."""

    number: int
    sentence: str
    fulfilled: bool
    false_claim: bool
    contacts: int
    drops: int
    cause: str | None
    message: str
    why: str
    events: tuple[str, ...]
    sim_time_s: float
    wall_time_s: float


def sentence_of(number: int, things: Sequence[str], goals: Sequence[str]) -> str:
    """What is asked for in a mission: a person is the goal as often as all surfaces among `goals` together."""
    rng = np.random.default_rng([number, 8])
    surfaces = [goal for goal in goals if goal != PERSON]
    thing, to_person = things[int(rng.integers(len(things)))], bool(rng.random() < 0.5)
    if PERSON in goals and (to_person or not surfaces):
        return f"bring me the {thing}"
    return f"bring the {thing} to the {surfaces[int(rng.integers(len(surfaces)))]}"


def run_mission(number: int, sentence: str, out: Path) -> Result:
    """Run one mission."""
    request = Request(
        sentence=sentence,
        world=WORLD,
        seed=number,
        out=out / str(number),
        record=False,
        time_limit_s=TIME_LIMIT_S,
        robots=(RobotConfig(ROBOT, "fetch"),),
    )
    request.out.mkdir(parents=True, exist_ok=True)
    prepared = prepare(request, ask=None)
    report = run_request(prepared, SimulatedBackend(prepared.world, prepared.robots, seed=number, record=False)).report
    (robot,) = report.robots.values()
    assert robot.referee is not None
    return Result(
        number,
        sentence,
        robot.referee.success is True,
        robot.outcome == "success" and robot.referee.success is False,
        robot.referee.collisions,
        robot.referee.drops,
        robot.cause,
        robot.message,
        robot.referee.why,
        robot.referee.events,
        report.sim_time_s,
        report.wall_time_s,
    )


def touched(events: Sequence[str]) -> list[str]:
    """What the robot touched in each of its contacts: a hand that takes what lies feels for the surface below it."""
    return [found[1] for event in events if (found := re.search(r" hit (?:the )?(.+) at [\d.]+ s", event))]


def summary(results: Sequence[Result]) -> dict[str, object]:
    """The figures of some missions."""
    fulfilled = Rate(sum(each.fulfilled for each in results), len(results))
    low, high = fulfilled.interval()
    failed = [each for each in results if not each.fulfilled]
    return {
        "missions": fulfilled.total,
        "fulfilled": fulfilled.successes,
        "interval": [round(low, 3), round(high, 3)],
        "false_claims": sum(each.false_claim for each in results),
        "contacts": sum(each.contacts for each in results),
        "touched": dict(Counter(what for each in results for what in touched(each.events)).most_common()),
        "drops": sum(each.drops for each in results),
        "causes": dict(Counter(each.cause or "false claim" for each in failed).most_common()),
        "failed": [[each.number, each.sentence, each.message, each.why] for each in failed],
    }


def main() -> int:
    """Run the missions that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("out/fetch"))
    parser.add_argument("--things", default=",".join(THINGS))
    parser.add_argument("--goals", default=",".join((PERSON, *SURFACES)))
    args = parser.parse_args()
    results = []
    for number in range(args.first, args.first + args.count):
        sentence = sentence_of(number, args.things.split(","), args.goals.split(","))
        results.append(run_mission(number, sentence, args.out))
        print(json.dumps(asdict(results[-1])), file=sys.stderr, flush=True)
    print(json.dumps(summary(results)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
