"""A fleet's work; prints JSON.

    python -m tests.benchmarks.fleet [--what missions,killed,ticks] [--first 3001] [--count 1] [--robots 2+2] [--jobs 1]
        [--out FOLDER]

`missions`: twelve missions in the queue, whose objects and places the seed draws, for so many Spots and Fetches.
`killed`: two Spots; Alice dies at a time that the seed draws; her mission is finished by Bob or told as failed, and
nothing is done twice: no object is lifted by both, and by the log no command is begun again after it was done.
`ticks`: the executive's own time per tick for four scripted robots against that for one, in the same run.
"""

import re
import tempfile
import time
from pathlib import Path

import numpy as np

from executive.app.fleet.fleet_mission import missions_json
from executive.app.fleet.fleet_run import run_fleet, simulated_fleet
from executive.app.prepare.from_request import prepare
from executive.app.runs.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.record.history import read_events
from executive.run.outcome import Outcome
from executive.store.missions import MissionState, MissionStore
from executive.words.command import parse_command
from executive.words.robot_config import RobotConfig
from tests.benchmarks.harness import benchmark, for_each, totals
from tests.benchmarks.tick_time import fetch, ticks_of_a_run

NAMES = ("alice", "bob", "carol", "dave", "erin", "frank")
OBJECTS = ("coke", "beer", "hammer", "wrench", "cube", "cylinder")
SURFACES = ("kitchen table", "dresser", "sideboard", "hall console", "desk", "bathroom cabinet")
ROOMS = ("hall", "kitchen", "living room", "bedroom", "bathroom", "workshop", "office")
SIZES = {"missions": (12, 5), "killed": (4, 2)}
"""Missions of a run, and how many of them carry something."""
KILLED_S, STEPS_EACH, ROUNDS = (5.0, 110.0), 40, 5
COMMAND_NODE = re.compile(r"[^/]+/[^/]+/(\d+)-[^/]+")


def cases(what: tuple[str, ...] = ("missions",), first: int = 3001, count: int = 1, robots: str = "2+2"):
    """Kinds of runs with their seeds, and how many Spots and Fetches."""
    for each in what:
        for seed in range(first, first + (1 if each == "ticks" else count)):
            yield each, seed, robots if each == "missions" else "2+0"


def sentences(seed, count, carries):
    """So many sentences, some of which carry an object to another place, in an order that the seed draws."""
    rng = np.random.default_rng([seed, count])
    things = rng.permutation(OBJECTS)[:carries]
    said = [f"Take the {thing} to the {rng.choice(SURFACES)}" for thing in things]
    said += [f"Go to the {rng.choice(ROOMS)}" for _ in range(count - carries)]
    return [str(sentence) for sentence in rng.permutation(said)]


def run_case(what, seed, robots, folder):
    """Runs sentences with a fleet; when Alice dies, it is right that all is done or told, and nothing twice."""
    if what == "ticks":
        return {"what": what, **time_ticks()}
    spots, fetches = map(int, robots.split("+"))
    kinds = ["spot"] * spots + ["fetch"] * fetches
    configs = [RobotConfig(name, kind) for name, kind in zip(NAMES, kinds, strict=False)]
    at_s = float(np.random.default_rng([seed, 9]).uniform(*KILLED_S))
    faults = {"Alice": [f"robot dies at {at_s:.1f} s"]} if what == "killed" else {}
    begun_s = time.perf_counter()
    with MissionStore(folder / "missions.sqlite") as store:
        asked = {"world": "flat", "require_wake": False, "record": False, "out": folder}
        requests = [Request(sentence=each, **asked) for each in sentences(seed, *SIZES[what])]
        queued = [store.add(prepare(request).request, queued=True) for request in requests]
        dispatch = simulated_fleet(store, queued, configs, seed=seed, faults=faults)
        run_fleet(dispatch, out=folder, seed=seed)
        rows = missions_json(store, [each.id for each in queued])
    wall_s = time.perf_counter() - begun_s
    backend, names = dispatch.backend, "|".join(dispatch.robots)
    assert isinstance(backend, SimulatedBackend)
    whole = [row for row in rows if row["part_of"] is None]
    bumps = tuple(bump.sentence for bump in backend.referee.collisions)
    return {
        "what": what,
        "seed": seed,
        "missions": len(whole),
        "done": sum(bool(row["referee"] is not None and row["referee"]["success"]) for row in whole),
        "contacts": sum(bool(re.search(rf"(?:{names}).* hit (?:{names})", bump)) for bump in bumps),
        "collisions": len(bumps),
        "robot_h": backend.clock.now() * len(dispatch.robots) / 3600.0,
        "wall_s": wall_s,
        "right": what == "killed" and is_right(rows, backend, read_events(folder / "log.mcap")),
        "rows": [{key: row[key] for key in ("id", "robot", "outcome", "reassigned", "message")} for row in rows],
        "bumps": bumps,
    }


def is_right(rows, backend, events):
    """True if all is over, no claim is denied, no object was lifted by two robots and no command begun again."""
    twice = any(len({lift.robot for lift in each.lifts}) > 1 for each in backend.referee.objects.values())
    over = all(row["outcome"] not in (MissionState.QUEUED.value, MissionState.RUNNING.value) for row in rows)
    claimed = [row for row in rows if row["outcome"] == MissionState.SUCCESS.value]
    return over and not twice and all(r["referee"]["success"] is not False for r in claimed) and not begun_again(events)


def begun_again(events):
    """Commands that a log has as begun again, by any robot, after they were done for good.

    A command is done for good when it was the last, or when the next one needs nothing in the gripper.
    """
    told = ()
    commands = {}
    missions = {}
    done = set()
    again = []
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


def time_ticks():
    """Times the cycles of scripted robots that fetch something, one and four in turn."""
    took_s = {1: [], 4: []}
    for robots in [*took_s] * ROUNDS:
        trees = [fetch(STEPS_EACH, robot=name.title()) for name in NAMES[:robots]]
        with tempfile.TemporaryDirectory() as folder:
            result, cycles = ticks_of_a_run(trees, Path(folder))
        assert result.outcome is Outcome.SUCCESS, result.worst.message
        took_s[robots] += cycles
    one_us, four_us = (1e6 * float(np.mean(each)) for each in took_s.values())
    return {"one_us": one_us, "four_us": four_us, "ratio": four_us / one_us}


def figures(results):
    if results[0].what == "ticks":
        return results[0]
    sums = totals(results, "missions", "done", "contacts", "collisions", "robot_h", "wall_s", "right")
    done_share = round(sums["done"] / sums["missions"], 3)
    return {"runs": len(results), **sums, "share": done_share, "robot_h": round(sums["robot_h"], 2)}


if __name__ == "__main__":
    benchmark(cases, run_case, for_each("what", figures))
