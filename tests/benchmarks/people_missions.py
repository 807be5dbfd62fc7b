"""Missions to meet, tell, ask and greet people who stand at random places of the flat; prints JSON.

    python -m tests.benchmarks.people_missions [--first 9760] [--count 30] [--json]

Robin, Maya and Sam stand in their usual rooms, in other rooms, or are absent, by the seed. The robot knows nobody by
face and asks "Are you Robin?"; the nearest person within 3 m answers. Missions take turns: meet, tell,
ask, greet. A claim is right when the referee confirms a success, and a denial when the person is absent. A claim that
the referee does not confirm is a false one.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from executive.app.mission_run import run_request
from executive.app.placed_robots import only_robot
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.words.mission import Route
from executive.words.outlines import inside
from plant.worlds.seeding import add_answers
from plant.worlds.world import load_world
from skills.estimate.grid_map import load_grid_map

USUAL = {"Robin": "living room", "Maya": "kitchen", "Sam": "office"}
KINDS = ("meet", "tell", "ask", "greet")
GREETED = ("living room", "kitchen", "office", "hall")
CLEAR_M, APART_M, NEVER_S = 0.45, 1.3, 86400.0
ABSENT, ELSEWHERE = 0.15, 0.25


@dataclass(frozen=True)
class Case:
    """A mission of one kind about a person, or people in a room, with the places of all people."""

    kind: str
    seed: int
    whom: str
    people: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Outcome:
    """How a mission ended."""

    kind: str
    seed: int
    whom: str
    present: bool
    claims: bool
    confirmed: bool | None
    time_s: float
    people_hit: int
    message: str
    why: str

    @property
    def right(self) -> bool:
        """Whether it was fulfilled, or rightly denied."""
        return bool(self.confirmed) if self.claims else not self.present


def make_world(folder: Path) -> None:
    """The flat, whose knowledge has three people, and nobody in it."""
    shutil.copytree(load_world("flat").folder, folder)
    knowledge = yaml.safe_load((folder / "knowledge.yaml").read_text())
    knowledge["people"] = {name: {"at": room} for name, room in USUAL.items()}
    (folder / "knowledge.yaml").write_text(yaml.safe_dump(knowledge))


def case(folder: Path, seed: int) -> Case:
    """The case of a seed."""
    rng, world = np.random.default_rng(seed), load_world(str(folder))
    kind = KINDS[seed % len(KINDS)]
    grid = load_grid_map(folder / "truth" / "keepout.yaml")
    rows, columns = np.nonzero(grid.distance > CLEAR_M)
    points = np.column_stack([columns + 0.5, rows + 0.5]) * grid.resolution_m + np.array(grid.origin_m)
    people: dict[str, tuple[float, float]] = {}
    whom = str(rng.choice(list(USUAL))) if kind != "greet" else str(rng.choice(GREETED))
    for name, usual in USUAL.items():
        drawn = rng.random()
        if drawn < ABSENT:
            continue
        room = usual if drawn > ABSENT + ELSEWHERE else str(rng.choice(list(world.rooms)))
        if kind == "greet" and rng.random() < 0.6:
            room = whom
        taken = [(world.start.x_m, world.start.y_m), *people.values()]
        there = [p for p in points[rng.permutation(len(points))] if inside(world.rooms[room], p)]
        spot = next((p for p in there if all(math.dist(p, other) > APART_M for other in taken)), None)
        if spot is not None:
            people[name] = (float(spot[0]), float(spot[1]))
    return Case(kind, seed, whom, people)


def steps_of(drawn: Case) -> str:
    """The mission's steps."""
    to = f"- {{to: {drawn.whom}}}\n"
    if drawn.kind == "greet":
        return f"- {{to: {drawn.whom}, do: greet, object: some person}}\n"
    if drawn.kind == "tell":
        return to + "- {speak: Dinner is ready.}\n"
    return to + "- {ask: Do you want a drink?, choices: {yes: null, no: null}}\n" if drawn.kind == "ask" else to


def run_case(folder: Path, drawn: Case) -> Outcome:
    """Run it."""
    out = Path(tempfile.mkdtemp(dir=folder.parent))
    mission = out / "mission.yaml"
    mission.write_text(f"name: {drawn.kind}\nsteps:\n{steps_of(drawn)}")
    prepared = prepare(Request(file=mission, world=str(folder), out=out, record=False, seed=drawn.seed), ask=None)
    routes = {name: Route(waypoints=(at, at), start=NEVER_S) for name, at in drawn.people.items()}
    world = prepared.world.without_people().with_routes(routes)
    world = add_answers(world, {name: {"drink": "yes"} for name in routes})
    name = prepared.mission.robot_name
    robots = {name: only_robot(name, world, seed=drawn.seed)}
    backend = SimulatedBackend(world, robots, seed=drawn.seed, record=False)
    report = run_request(replace(prepared, world=world), backend).report
    room, seen = world.rooms.get(drawn.whom), report.seen
    present = drawn.whom in drawn.people if room is None else any(inside(room, at) for at in drawn.people.values())
    return Outcome(
        drawn.kind,
        drawn.seed,
        drawn.whom,
        present,
        report.outcome == "success",
        seen.success,
        report.sim_time_s,
        seen.people_hit,
        report.message,
        seen.why,
    )


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=9760)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--only", help="seeds, in place of --first and --count")
    parser.add_argument("--json", action="store_true", help="all on one line")
    options = parser.parse_args()
    seeds = (
        list(map(int, options.only.split(","))) if options.only else range(options.first, options.first + options.count)
    )
    outcomes = []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made) / "flat"
        make_world(folder)
        for seed in seeds:
            drawn = case(folder, seed)
            outcomes.append(run_case(folder, drawn))
            print(f"{asdict(outcomes[-1])} {drawn.people}", file=sys.stderr, flush=True)
    found = {
        "missions": len(outcomes),
        "right": sum(one.right for one in outcomes),
        "fulfilled": sum(one.claims and bool(one.confirmed) for one in outcomes),
        "false_claims": [one.seed for one in outcomes if one.claims and not one.confirmed],
        "wrong_denials": [one.seed for one in outcomes if not one.claims and one.present],
        "people_hit": sum(one.people_hit for one in outcomes),
        "time_s_median": round(float(np.median([one.time_s for one in outcomes])), 1),
    }
    print(json.dumps(found, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
