"""People whom the robot follows and guides through the flat; prints JSON.

    python -m tests.benchmarks.people_trials [--what follow,crossed,guide] [--first 9740] [--count 40]

`follow`: the robot is told to follow Robin to a room. Robin walks some 30 m there through three doors or more, by the
seed, turns round in one room at most, changes the pace and is distracted once. `crossed`: two other people walk the
same route the other way. `guide`: the robot guides Robin to a room beyond the hall; Robin stops and turns back once.
The referee judges each run.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.app.mission_run import run_request
from executive.app.placed_robots import only_robot
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.record.schemas import SPEECH
from executive.run.visitor import RunVisitor
from executive.words.knowledge import Knowledge
from executive.words.mission import Distraction, Route
from plant.referee.company import lost_s
from plant.referee.object_history import TimedPath
from plant.worlds.world import World, load_world
from skills.files.schema import validate
from skills.files.yaml_source import read_yaml

LENGTH_M, LEAST_DOORS = (28.0, 34.0), 3
START_ROOM, BESIDE_M = "living room", 1.6
LIMIT_S = 300.0
Point = tuple[float, float]


@dataclass(frozen=True)
class Trial:
    """A sentence for the robot, and the people who walk."""

    sentence: str
    people: Mapping[str, Route]


@dataclass(frozen=True)
class Outcome:
    """Result of a trial; `wrong` says that the robot ended near somebody else and did not say that it lost Robin."""

    what: str
    seed: int
    success: bool
    claimed: bool
    contacts: int
    walked_into: int
    lost_s: float
    wrong: bool
    time_s: float
    why: str


def walk_through(world: World, rng: np.random.Generator) -> tuple[list[str], list[Point], float]:
    """Rooms, waypoints and length (m) of a walk of the wanted length; its last room is not passed before."""
    knowledge = validate(Knowledge, read_yaml(world.knowledge_path))
    while True:
        rooms, points, length_m, doors, turned = [START_ROOM], [world.standing[START_ROOM]], 0.0, 0, False
        while length_m < LENGTH_M[0] and len(rooms) < 12:
            here = [door for door in knowledge.doors if rooms[-1] in door.between]
            ways = [door for door in here if len(rooms) == 1 or rooms[-2] not in door.between]
            if not ways and turned:
                break
            turned, ways = turned or not ways, ways or here
            door = ways[int(rng.integers(len(ways)))]
            (room,) = set(door.between) - {rooms[-1]}
            stand = tuple(np.array(world.standing[room]) + rng.uniform(-0.3, 0.3, size=2))
            length_m += math.dist(points[-1], door.at) + math.dist(door.at, stand)
            rooms, points, doors = [*rooms, room], [*points, stand], doors + 1
        if LENGTH_M[0] <= length_m <= LENGTH_M[1] and doors >= LEAST_DOORS and rooms[-1] not in rooms[:-1]:
            return rooms, points, length_m


def trial(what: str, seed: int, world: World) -> Trial:
    """The trial of a seed."""
    rng = np.random.default_rng([seed, len(what)])
    start, beside = world.start, np.array([math.cos(world.start.yaw_rad), math.sin(world.start.yaw_rad)]) * BESIDE_M
    ahead = (float(start.x_m + beside[0]), float(start.y_m + beside[1]))
    if what == "guide":
        room = str(rng.choice([each for each in sorted(world.rooms) if each not in (START_ROOM, "hall")]))
        lapse = Distraction(after=rng.uniform(2.0, 5.0), stop=rng.uniform(2.0, 4.0), back=rng.uniform(1.5, 3.0))
        robin = Route(waypoints=(ahead,), follows="robot", speed=rng.uniform(0.7, 1.1), distractions=(lapse,))
        return Trial(f"guide Robin to the {room}", {"Robin": robin})
    rooms, points, length_m = walk_through(world, rng)
    robin = Route(
        waypoints=(ahead, *points[1:]),
        speed=rng.uniform(0.55, 0.8),
        start=86_400.0,
        pace=0.2,
        distractions=(Distraction(after=rng.uniform(5.0, length_m - 8.0), stop=rng.uniform(2.0, 5.0)),),
        apart=True,
    )
    others = {}
    for number, name in enumerate(("Kim", "Lee") if what == "crossed" else ()):
        back = [*points[-1 - number : 0 : -1], points[number]]
        others[name] = Route(waypoints=tuple(back), speed=rng.uniform(0.6, 1.0), start=rng.uniform(5, 30), apart=True)
    return Trial(f"follow Robin to the {rooms[-1]}", {"Robin": robin, **others})


class SetsOff(RunVisitor):
    """Lets Robin set off when the robot says that it follows."""

    def __init__(self, backend: SimulatedBackend) -> None:
        self._simulation = backend._settled()

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Waits for the words."""
        if topic == SPEECH and "follow you" in message["text"]:
            self._simulation.engine.walkers["Robin"].set_off()
        return message


def run_trial(what: str, seed: int, out: Path) -> Outcome:
    """Runs the trial of a seed."""
    world = load_world("flat")
    drawn = trial(what, seed, world)
    world = world.without_people().with_routes(drawn.people)
    request = Request(sentence=drawn.sentence, out=out, record=False, seed=seed, time_limit_s=LIMIT_S)
    prepared = replace(prepare(request, ask=None), world=world)
    name = prepared.mission.robot_name
    backend = SimulatedBackend(world, {name: only_robot(name, world, seed=seed)}, seed=seed, record=False)
    report = run_request(prepared, backend, visitors=[SetsOff(backend)] if what != "guide" else []).report
    referee, seen = backend.referee, report.seen
    robot, people = TimedPath(np.array(referee.points(name))), referee._person_paths
    paths = {each: TimedPath(np.array(points)) for each, points in people.items()}
    away_m = {each: math.dist(path.points[-1, :2], robot.points[-1, :2]) for each, path in paths.items()}
    return Outcome(
        what,
        seed,
        bool(seen.success),
        report.outcome == "success",
        seen.people_hit,
        seen.hit_by_people,
        round(lost_s(robot, paths["Robin"], 0.0, report.sim_time_s), 1),
        away_m["Robin"] > 3.0 and min(away_m.values()) < 3.0 and "lost" not in report.message,
        report.sim_time_s,
        f"{drawn.sentence}: {seen.why} | {report.message} | {' '.join(seen.events)}",
    )


def summary(outcomes: list[Outcome]) -> dict[str, object]:
    """The figures of one kind of trial."""
    return {
        "runs": len(outcomes),
        "arrived": sum(each.success for each in outcomes),
        "false_claims": sum(each.claimed and not each.success for each in outcomes),
        "contacts": sum(each.contacts for each in outcomes),
        "walked_into": sum(each.walked_into for each in outcomes),
        "lost_over_10_s": sum(each.lost_s > 10.0 for each in outcomes),
        "wrong_person": sum(each.wrong for each in outcomes),
        "failed": [each.seed for each in outcomes if not each.success],
    }


def main() -> None:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--what", default="follow,crossed,guide")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=40)
    options = parser.parse_args()
    found: dict[str, object] = {}
    for what in options.what.split(","):
        outcomes = []
        for seed in range(options.first, options.first + options.count):
            with tempfile.TemporaryDirectory() as folder:
                outcomes.append(run_trial(what, seed, Path(folder)))
            print(json.dumps(asdict(outcomes[-1])), file=sys.stderr, flush=True)
        found[what] = summary(outcomes)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
