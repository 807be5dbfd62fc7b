"""The executive's own time in a tick: a base, and what each node adds that does nothing.

    python -m tests.benchmarks.tick_time [--more 0 2 5 10 20] [--ticks 300] [--rounds 3]

Ticks a compiled fetch, whose leaves are scripted and say something new in each tick, with log and journal on; `--more`
fetches stand behind it and wait. Prints JSON: the median CPU time of a tick by the tree's size, and the line through
it. A machine that does other work gives higher numbers: compare two versions in turn.
"""

import argparse
import itertools
import json
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.run.control import Control
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
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

TICK_S = 0.05
_FIRST = 5  # ticks in which much begins


def fetch(steps_each, more=0):
    """The tree of a fetch, whose leaves drive for some ticks and say something new in each; `more` follow."""
    script = Script(steps=steps_each, says=lambda name, left: f"{name}, {left} to go")
    registry = {name: scripted_skill(script, name, *ports) for name, ports in PORTS.items()}
    steps = tuple(Do.from_command(parse_command(text)) for text in FETCH * (1 + more))
    knowledge = Knowledge.model_validate(KNOWLEDGE)
    return compile_mission(Mission(name="fetch", robot="Alice", steps=steps), knowledge=knowledge, registry=registry)


def ticks_of_a_run(tree, folder, most=None):
    """Run the mission with its log and journal, for so many ticks at most.

    Returns the result, and the CPU time of each cycle (s): the tree's tick and all around it.
    """
    clock, ends, control = ManualClock(), [], Control(pace=None)
    log = EventLog(folder / "log.mcap", clock)
    request = Request(name="fetch", world_name="flat", robot="Alice", out=folder, commands=FETCH)

    def observe(progress):
        ends.append(time.thread_time())
        if len(ends) == most:
            control.cancel("enough")

    with MissionStore(folder / "missions.sqlite") as store, LockStepWorker(clock) as worker:
        journal = store.journal(store.add(request, queued=False).id)
        result = run(
            [RunEntry(tree, ScriptedRobot(clock), StillLocaliser(), EmptyCostmap())],
            clock=clock,
            worker=worker,
            visitors=[log, journal, OnTick(observe)],
            settings=RunSettings(tick_period_s=TICK_S),
            control=control,
        )
    log.close()
    return result, [after - before for before, after in itertools.pairwise(ends)]


def median_tick_s(tree, ticks, rounds):
    """The median tick of the quietest round."""
    medians = []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            medians.append(statistics.median(ticks_of_a_run(tree, Path(folder), ticks)[1][_FIRST:]))
    return min(medians)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--more", type=int, nargs="+", default=[0, 2, 5, 10, 20])
    parser.add_argument("--ticks", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    trees = [fetch(options.ticks + 1, more) for more in options.more]
    nodes = [len(tree.path_ids) for tree in trees]
    took_us = [1e6 * median_tick_s(tree, options.ticks, options.rounds) for tree in trees]
    slope_us, base_us = np.polyfit(nodes, took_us, 1)
    by_size = {count: round(us, 1) for count, us in zip(nodes, took_us, strict=True)}
    print(json.dumps({"tick_us": by_size, "base_us": round(base_us, 1), "idle_node_us": round(slope_us, 4)}))


if __name__ == "__main__":
    main()
