"""The executive's own time in a tick: a base, and what each node adds that does nothing.

    python -m tests.benchmarks.tick_time [--more 0,2,5,10,20] [--ticks 300] [--rounds 3]

Ticks a compiled fetch, whose leaves are scripted and say something new in each tick, with log and journal on; `--more`
fetches stand behind it and wait. Prints JSON: the median CPU time of a tick by the tree's size, and the line through
it. A machine that does other work gives higher numbers: compare two versions in turn.
"""

import itertools
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
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from tests.benchmarks.harness import command
from tests.executive import conftest as scripted
from tests.visitors import OnTick

TICK_S = 0.05
FIRST = 5
"""Ticks in which much begins."""


def fetch(steps_each, more=0, robot="Alice"):
    """Tree of a fetch, whose leaves drive for some ticks and say something new in each; `more` follow."""
    script = scripted.Script(steps=steps_each, says=lambda name, left: f"{name}, {left} to go")
    registry = {name: scripted.scripted_skill(script, name, *ports) for name, ports in scripted.PORTS.items()}
    steps = steps_of_commands([parse_command(text) for text in scripted.FETCH * (1 + more)])
    mission = Mission(name="fetch", robot=robot, steps=steps)
    return compile_mission(mission, knowledge=Knowledge.model_validate(scripted.KNOWLEDGE), registry=registry)


def ticks_of_a_run(trees, folder, most=None):
    """Runs a mission for each robot with log and journals, for so many ticks at most.

    Returns the result, and the CPU time of each cycle (s): the trees' ticks and all around them.
    """
    clock, ends, control = scripted.VirtualClock(), [], Control(pace=None)
    log, entries, journals = EventLog(folder / "log.mcap", clock), [], []

    def observe(_):
        ends.append(time.thread_time())
        if len(ends) == most:
            control.cancel("enough")

    with MissionStore(folder / "missions.sqlite") as store, LockStepWorker(clock) as worker:
        for tree in trees:
            name = tree.robot_name
            request = Request(name="fetch", world_name="flat", robot=name, out=folder, commands=scripted.FETCH)
            journals.append(store.journal(store.add(request, queued=False).id, name))
            entries.append(
                RunEntry(tree, scripted.StandingRobot(clock, name), scripted.StillLocaliser(), scripted.EmptyCostmap())
            )
        visitors, settings = [log, *journals, OnTick(observe)], RunSettings(tick_period_s=TICK_S)
        result = run(entries, clock=clock, worker=worker, visitors=visitors, settings=settings, control=control)
    log.close()
    return result, [after - before for before, after in itertools.pairwise(ends)]


def measure(more: tuple[int, ...] = (0, 2, 5, 10, 20), ticks: int = 300, rounds: int = 3):
    """Times the median tick of the quietest round by the tree's size."""
    took_us = {}
    for tree in [fetch(ticks + 1, each) for each in more]:
        medians = []
        for _ in range(rounds):
            with tempfile.TemporaryDirectory() as folder:
                medians.append(statistics.median(ticks_of_a_run([tree], Path(folder), ticks)[1][FIRST:]))
        took_us[len(tree.path_ids)] = round(1e6 * min(medians), 1)
    slope_us, base_us = np.polyfit(list(took_us), list(took_us.values()), 1)
    return {"tick_us": took_us, "base_us": round(base_us, 1), "idle_node_us": round(slope_us, 4)}


if __name__ == "__main__":
    command(measure)
