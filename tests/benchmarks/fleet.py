"""A fleet's work; prints JSON.

    python -m tests.benchmarks.fleet [--what missions,killed,ticks] [--first 3001] [--count 1] [--robots 2+2]
        [--out FOLDER]

`missions`: twelve missions in the queue, whose objects and places the seed draws, for so many Spots and Fetches.
`killed`: two Spots; Alice dies at a time that the seed draws; her mission is finished by Bob or told as failed, and
nothing is done twice: no object is lifted by both, and by the log no command is begun again after it was done.
`ticks`: the executive's own time per tick for four scripted robots against that for one, in the same run.
"""

from __future__ import annotations

import argparse
import itertools
import json
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from executive.app.dispatch import Dispatch
from executive.app.fleet import missions_json
from executive.app.fleet_run import run_fleet, simulated_fleet
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.record.history import Event, read_events
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionState, MissionStore
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.robot_config import RobotConfig
from tests.executive.conftest import (
    FETCH,
    KNOWLEDGE,
    PORTS,
    EmptyCostmap,
    ManualClock,
    Script,
    ScriptedRobot,
    StillLocaliser,
    scripted_skill,
)
from tests.visitors import OnTick

WORLD = "flat"
NAMES = ("alice", "bob", "carol", "dave", "erin", "frank")
MISSIONS, CARRIES = 12, 5
OBJECTS = ("coke", "beer", "hammer", "wrench", "cube", "cylinder")
SURFACES = ("kitchen table", "dresser", "sideboard", "hall console", "desk", "bathroom cabinet")
ROOMS = ("hall", "kitchen", "living room", "bedroom", "bathroom", "workshop", "office")
KILLED_MISSIONS, KILLED_CARRIES, KILLED_S = 4, 2, (5.0, 110.0)
STEPS_EACH, ROUNDS = 40, 5
COMMAND_NODE = re.compile(r"[^/]+/[^/]+/(\d+)-[^/]+")


@dataclass(frozen=True)
class Result:
    """What came of one run. `robot_h` are hours on the robots' clock, of all robots together."""

    what: str
    seed: int
    missions: int
    done: int
    contacts: int
    collisions: int
    robot_h: float
    wall_s: float
    right: bool | None = None
    rows: tuple[Mapping[str, Any], ...] = ()
    bumps: tuple[str, ...] = ()


def sentences(seed: int, count: int, carries: int) -> list[str]:
    """So many sentences, some of which carry an object to another place, in an order that the seed draws."""
    rng = np.random.default_rng([seed, count])
    things = rng.permutation(OBJECTS)[:carries]
    said = [f"Take the {thing} to the {rng.choice(SURFACES)}" for thing in things]
    said += [f"Go to the {rng.choice(ROOMS)}" for _ in range(count - carries)]
    return [str(sentence) for sentence in rng.permutation(said)]


def fleet_run(
    seed: int, robots: Mapping[str, str], said: Sequence[str], out: Path, faults: Mapping[str, Sequence[str]]
) -> tuple[Dispatch, list[dict[str, Any]], float]:
    """Run sentences with a fleet: the dispatch afterwards, the missions as they were told, and the wall time (s)."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    begun_s = time.perf_counter()
    configs = [RobotConfig(name, kind) for name, kind in robots.items()]
    with MissionStore(out / "missions.sqlite") as store:
        requests = [Request(sentence=each, world=WORLD, require_wake=False, record=False, out=out) for each in said]
        queued = [store.add(prepare(request, ask=None).request, queued=True) for request in requests]
        dispatch = simulated_fleet(store, queued, configs, seed=seed, faults=faults)
        run_fleet(dispatch, out=out, seed=seed)
        return dispatch, missions_json(store, [each.id for each in queued]), time.perf_counter() - begun_s


def result_of(what: str, seed: int, dispatch: Dispatch, rows: Sequence[dict[str, Any]], wall_s: float) -> Result:
    """The figures of a run."""
    backend = dispatch.backend
    assert isinstance(backend, SimulatedBackend)
    whole = [row for row in rows if row["part_of"] is None]
    done = [row for row in whole if row["referee"] is not None and row["referee"]["success"]]
    names = "|".join(dispatch.robots)
    hits = [bump for bump in backend.referee.collisions if re.search(rf"(?:{names}).* hit (?:{names})", bump.sentence)]
    robot_h = backend.clock.now() * len(dispatch.robots) / 3600.0
    bumps = tuple(bump.sentence for bump in backend.referee.collisions)
    told_of = tuple({key: row[key] for key in ("id", "robot", "outcome", "reassigned", "message")} for row in rows)
    return Result(what, seed, len(whole), len(done), len(hits), len(bumps), robot_h, wall_s, rows=told_of, bumps=bumps)


def run_missions(seed: int, out: Path, kinds: Sequence[str]) -> Result:
    """Twelve missions in the queue."""
    robots = dict(zip(NAMES, kinds, strict=False))
    dispatch, rows, wall_s = fleet_run(seed, robots, sentences(seed, MISSIONS, CARRIES), out, {})
    return result_of("missions", seed, dispatch, rows, wall_s)


def run_killed(seed: int, out: Path, kinds: Sequence[str]) -> Result:
    """Alice dies; `right` tells whether all is done or told, and nothing twice."""
    at_s = float(np.random.default_rng([seed, 9]).uniform(*KILLED_S))
    said = sentences(seed, KILLED_MISSIONS, KILLED_CARRIES)
    faults = {"Alice": [f"robot dies at {at_s:.1f} s"]}
    dispatch, rows, wall_s = fleet_run(seed, {"alice": "spot", "bob": "spot"}, said, out, faults)
    backend = dispatch.backend
    assert isinstance(backend, SimulatedBackend)
    lifted_by = {name: {lift.robot for lift in each.lifts} for name, each in backend.referee.objects.items()}
    twice = [name for name, by in lifted_by.items() if len(by) > 1]
    open_still = {MissionState.QUEUED.value, MissionState.RUNNING.value}
    over = all(row["outcome"] not in open_still for row in rows)
    twice += begun_again(read_events(out / "log.mcap"))
    claimed = [row for row in rows if row["outcome"] == MissionState.SUCCESS.value]
    true = all(row["referee"]["success"] is not False for row in claimed)
    result = result_of("killed", seed, dispatch, rows, wall_s)
    return Result(**{**vars(result), "right": over and true and not twice})


def begun_again(events: Iterable[Event]) -> list[str]:
    """The commands that a log has as begun again, by any robot, after they were done for good.

    A command is done for good when it was the last, or when the next one needs nothing in the gripper.
    """
    told: Sequence[str] = ()
    commands: dict[str, Sequence[str]] = {}
    missions: dict[str, int] = {}
    done: set[tuple[int, str]] = set()
    again: list[str] = []
    for event in events:
        data = event.data
        if event.topic == "run":
            told = data["commands"]
        elif event.topic == "tree":
            commands[data["robot"]] = told
        elif event.topic == "missions":
            missions = {each["robot"]: each["id"] for each in data["missions"] if each["outcome"] == "running"}
        elif event.topic == "transitions" and data["robot"] in missions:
            node, own = COMMAND_NODE.fullmatch(data["node"]), commands[data["robot"]]
            number = 0 if node is None else int(node[1])
            if not 0 < number <= len(own):
                continue
            command = (missions[data["robot"]], own[number - 1])
            if data["to"] == "SUCCESS" and (number == len(own) or parse_command(own[number]).item is None):
                done.add(command)
            elif data["to"] == "RUNNING" and command in done:
                again.append(f"mission {command[0]}: {command[1]}")
    return again


def run_ticks(seed: int, out: Path, kinds: Sequence[str]) -> dict[str, object]:
    """The mean CPU time of a cycle for one robot and for four, in turn, and their ratio."""
    took_s: dict[int, list[float]] = {1: [], 4: []}
    for _, robots in itertools.product(range(ROUNDS), took_s):
        took_s[robots] += _cycles_s(robots)
    one_s, four_s = (float(np.mean(took_s[robots])) for robots in (1, 4))
    return {"what": "ticks", "one_us": 1e6 * one_s, "four_us": 1e6 * four_s, "ratio": four_s / one_s}


def _cycles_s(robots: int) -> list[float]:
    """The CPU time of each cycle (s) of a run in which scripted robots fetch something, with log and journals."""
    clock, ends = ManualClock(), []
    with tempfile.TemporaryDirectory() as folder, MissionStore(Path(folder) / "missions.sqlite") as store:
        log = EventLog(Path(folder) / "log.mcap", clock)
        entries, visitors = [], [log]
        for name in map(str.title, NAMES[:robots]):
            request = Request(name="fetch drink", world_name=WORLD, robot=name, out=Path(folder), commands=FETCH)
            visitors.append(store.journal(store.add(request, queued=False).id, name))
            robot = ScriptedRobot(clock, name)
            entries.append(RunEntry(_fetch(name), robot, StillLocaliser(), EmptyCostmap()))
        with LockStepWorker(clock) as worker:
            settings = RunSettings(tick_period_s=0.05)

            def observe(_: object) -> None:
                ends.append(time.thread_time())

            visitors.append(OnTick(observe))
            result = run(entries, clock=clock, worker=worker, visitors=visitors, settings=settings)
        log.close()
    assert result.outcome is Outcome.SUCCESS, result.worst.message
    return [after - before for before, after in itertools.pairwise(ends)]


def _fetch(name: str) -> Any:
    script = Script(steps=STEPS_EACH, says=lambda skill, left: f"{skill}, {left} to go")
    registry = {skill: scripted_skill(script, skill, *ports) for skill, ports in PORTS.items()}
    steps = tuple(Do.from_command(parse_command(text)) for text in FETCH)
    knowledge = Knowledge.model_validate(KNOWLEDGE)
    return compile_mission(Mission(name="fetch", robot=name, steps=steps), knowledge=knowledge, registry=registry)


def summary(results: Sequence[Result]) -> dict[str, object]:
    """The figures of some runs."""
    missions, done = sum(each.missions for each in results), sum(each.done for each in results)
    return {
        "runs": len(results),
        "missions": missions,
        "done": done,
        "share": round(done / missions, 3),
        "contacts": sum(each.contacts for each in results),
        "collisions": sum(each.collisions for each in results),
        "robot_h": round(sum(each.robot_h for each in results), 2),
        "wall_s": round(sum(each.wall_s for each in results)),
        "right": sum(bool(each.right) for each in results),
    }


RUNS: Mapping[str, Callable[[int, Path, Sequence[str]], Result]] = {"missions": run_missions, "killed": run_killed}


def main() -> int:
    """Run the cases that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--what", default="missions")
    parser.add_argument("--first", type=int, default=3001)
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--robots", default="2+2", help="how many Spots and Fetches")
    parser.add_argument("--out", type=Path, default=Path("out/fleet"))
    args = parser.parse_args()
    spots, fetches = map(int, args.robots.split("+"))
    kinds = ["spot"] * spots + ["fetch"] * fetches
    for what in args.what.split(","):
        if what == "ticks":
            print(json.dumps(run_ticks(args.first, args.out, kinds)), flush=True)
            continue
        results = []
        for seed in range(args.first, args.first + args.count):
            results.append(RUNS[what](seed, args.out / f"{what}-{seed}", kinds))
            print(json.dumps(asdict(results[-1])), file=sys.stderr, flush=True)
        print(json.dumps({what: summary(results)}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
