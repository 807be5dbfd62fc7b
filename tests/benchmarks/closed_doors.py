"""Rooms behind closed doors: whether the failure names the doors, and how soon; prints JSON.

    python -m tests.benchmarks.closed_doors [--first 9840] [--count 20] [--detours 0] [--out FOLDER]

Each case is drawn from its number: a world, a room of it, and when each of its doors closes: before the drive, or
after up to ten seconds. The robot is to go to the room. `named`: the failure names all closed doors that it saw, at
least one, and no open door. `given_up_s`: the robot's time from when it had seen the last of them closed to its
failure. With `--detours`, that many more cases have one door of the room left open, and the robot arrives.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from executive.app.mission_run import run_request
from executive.app.placed_robots import only_robot
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.record.history import read_history
from executive.record.schemas import DOORS
from executive.words.knowledge import Knowledge, load_knowledge
from plant.worlds.world import load_world
from skills.estimate.grid_map import load_grid_map

WORLDS = ("flat", "shop", "lab")
MOST_DOORS = 2
LATEST_S, LIMIT_S = 10.0, 300.0
WITHIN_S = 15.0
BODY_M, JAMB_M = 0.2, 0.1


@dataclass(frozen=True)
class Case:
    """A room to go to, and the time at which each of its doors closes, by its rooms (s); None: it stays open."""

    number: int
    world: str
    room: str
    closes_s: tuple[tuple[tuple[str, str], float | None], ...]


@dataclass(frozen=True)
class Result:
    """End of a case."""

    case: Case
    arrived: bool
    named: bool
    given_up_s: float | None
    message: str
    time_s: float
    collisions: int


def case(number: int, *, detour: bool = False) -> Case:
    """A case by its number; with `detour` the first door of a room with two stays open."""
    rng = np.random.default_rng([number, 51, detour])
    while True:
        world = str(rng.choice(WORLDS))
        knowledge = load_knowledge(load_world(world).folder / "knowledge.yaml")
        room = str(rng.choice(list(knowledge.places)))
        doors = [door.between for door in knowledge.doors if room in door.between]
        if not (2 if detour else 1) <= len(doors) <= MOST_DOORS or not _is_cut_off(world, knowledge, room):
            continue
        times = [0.1 if rng.random() < 0.5 else round(float(rng.uniform(1.0, LATEST_S)), 1) for _ in doors]
        order = rng.permutation(len(doors))
        closes = [(doors[n], None if detour and k == 0 else times[n]) for k, n in enumerate(order)]
        return Case(number, world, room, tuple(closes))


def _is_cut_off(world: str, knowledge: Knowledge, room: str) -> bool:
    """Returns whether the doors of a room are its only ways in, from the robot's start, on the map."""
    grid = load_grid_map(load_world(world).keepout_map_path).with_unknown_blocked()
    free = grid.distance > BODY_M
    for door in knowledge.doors:
        if room in door.between:
            cells = np.argwhere(free)
            near = np.hypot(*(grid.centres(cells) - door.at).T) < 0.5 * door.width + JAMB_M
            free[tuple(cells[near].T)] = False
    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=8)[1]
    places = (knowledge.start, knowledge.places[room].pose)
    cells = np.argwhere(free)
    nearest = [cells[np.argmin(np.hypot(*(grid.centres(cells) - [at.x, at.y]).T))] for at in places]
    here, there = (int(labels[tuple(cell)]) for cell in nearest)
    return here != there


def run_case(drawn: Case, out: Path) -> Result:
    """Runs it."""
    events = "".join(f"  - {{door: {list(d)}, closes: {at_s}}}\n" for d, at_s in drawn.closes_s if at_s is not None)
    scenario = out.with_suffix(".yaml")
    scenario.write_text(f"events:\n{events}".replace("'", '"'))
    request = Request(
        sentence=f"go to the {drawn.room}",
        world=drawn.world,
        out=out,
        record=False,
        seed=drawn.number,
        scenario_files=(scenario,),
        time_limit_s=LIMIT_S,
    )
    prepared = prepare(request, ask=None)
    name = prepared.mission.robot_name
    robots = {name: only_robot(name, prepared.world, seed=drawn.number)}
    backend = SimulatedBackend(prepared.world, robots, seed=drawn.number, record=False)
    report = run_request(prepared, backend).report
    closed = {frozenset(door) for door, at_s in drawn.closes_s if at_s is not None}
    seen_s: dict[frozenset[str], float] = {}
    for event in read_history(out / "log.mcap").events:
        for door in event.data["doors"] if event.topic == DOORS else ():
            if door["state"] == "closed" and frozenset(door["between"]) in closed:
                seen_s.setdefault(frozenset(door["between"]), event.stamp_s)
    every = [door.between for door in load_knowledge(prepared.world.folder / "knowledge.yaml").doors]
    named = {frozenset(door) for door in every if f"between the {door[0]} and the {door[1]}" in report.message}
    given_up_s = round(report.sim_time_s - max(seen_s.values()), 1) if seen_s else None
    right = bool(named) and named == set(seen_s)
    arrived = report.outcome == "success"
    hits = report.seen.collisions if report.seen else 0
    return Result(drawn, arrived, right, given_up_s, report.message, report.sim_time_s, hits)


def main() -> None:
    """Runs and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=9840)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--detours", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = options.out or Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        numbers = range(options.first, options.first + options.count)
        drawn = [*map(case, numbers), *(case(options.first + n, detour=True) for n in range(options.detours))]
        results = []
        for n, one in enumerate(drawn):
            results.append(run_case(one, folder / f"{n:02}-{one.number}"))
            print(json.dumps(asdict(results[-1])), file=sys.stderr, flush=True)
    closed, detours = results[: options.count], results[options.count :]
    late = [each.case.number for each in closed if each.given_up_s is None or each.given_up_s > WITHIN_S]
    print(
        json.dumps(
            {
                "closed": len(closed),
                "named": sum(each.named for each in closed),
                "given_up_s": sorted(each.given_up_s for each in closed if each.given_up_s is not None),
                "given_up_late": late,
                "not_named": [each.case.number for each in closed if not each.named],
                "detours": len(detours),
                "arrived": sum(each.arrived for each in detours),
                "collisions": sum(each.collisions for each in results),
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
