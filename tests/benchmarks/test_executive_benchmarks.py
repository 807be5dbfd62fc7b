"""What a tick costs the executive itself: a compiled fetch with scripted leaves, log and journal on.

Compared with the bare library's tick of a tree of the same shape, and with the share of a run that the executive may
take at eight times real time.
"""

import itertools
import time

import py_trees
import pytest

from executive.mission.command import parse_command
from executive.mission.file.model import DEFAULT_WORLD, Mission, MissionStep
from executive.mission.knowledge import Knowledge
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.run.outcome import Outcome
from executive.run.runner import RunEntry, RunSettings, run
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.tree.compiler import compile_mission
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

TICK_S, FASTEST = 0.05, 8.0
STEPS_EACH = 40
SUCCESS = py_trees.common.Status.SUCCESS


def fetch():
    """The tree of a fetch, whose leaves drive for some ticks and say something new in each."""
    script = Script(steps=STEPS_EACH, says=lambda name, left: f"{name}, {left} to go")
    registry = {name: scripted_skill(script, name, *ports) for name, ports in PORTS.items()}
    steps = [MissionStep((parse_command(text),)) for text in FETCH]
    knowledge = Knowledge.model_validate(KNOWLEDGE)
    return compile_mission(
        Mission("fetch drink", DEFAULT_WORLD, "Alice", tuple(steps)), knowledge=knowledge, registry=registry
    )


def ticks_of_a_run(tree, folder):
    """Run the mission with its log and journal; the CPU time of each cycle (s), the tree's tick and all around it."""
    clock, ends = ManualClock(), []
    log = EventLog(folder / "log.mcap", clock)
    request = Request(name="fetch drink", world_name="flat", robot="Alice", out=folder, commands=FETCH)
    with MissionStore(folder / "missions.sqlite") as store, LockStepWorker(clock) as worker:
        journal = store.journal(store.add(request, queued=False).id)
        result = run(
            [RunEntry(tree, ScriptedRobot(clock), StillLocaliser(), EmptyCostmap(), journal)],
            clock=clock,
            worker=worker,
            publish=log,
            settings=RunSettings(tick_period_s=TICK_S),
            observer=lambda progress: ends.append(time.thread_time()),
        )
    log.close()
    assert result.outcome is Outcome.SUCCESS, result.worst.message
    return [after - before for before, after in itertools.pairwise(ends)]


def bare(plan):
    """A tree of the same shape out of the library's own parts."""
    children = [bare(child) for child in plan.children]
    if not children:
        return py_trees.behaviours.TickCounter(plan.name, duration=STEPS_EACH, completion_status=SUCCESS)
    if len(children) == 1:
        return py_trees.decorators.PassThrough(plan.name, child=children[0])
    return py_trees.composites.Sequence(plan.name, memory=True, children=children)


def bare_ticks(tree):
    """The CPU time of each tick of the bare tree (s)."""
    root, took = bare(tree.root), []
    while root.status != SUCCESS:
        begun = time.thread_time()
        root.tick_once()
        took.append(time.thread_time() - begun)
    return took


@pytest.mark.benchmark(group="executive")
def test_a_tick_of_a_fetch_with_log_and_journal(benchmark, tmp_path):
    tree, cycles = fetch(), []
    assert len(tree.path_ids) > 50
    folders = (tmp_path / str(number) for number in itertools.count())
    benchmark.pedantic(lambda: cycles.extend(ticks_of_a_run(tree, next(folders))), rounds=3, warmup_rounds=1)
    bare_s = sum(took := bare_ticks(tree)) / len(took)
    mean_s, ordered = sum(cycles) / len(cycles), sorted(cycles)
    benchmark.extra_info["tick_us"] = 1e6 * mean_s
    benchmark.extra_info["tick_median_us"] = 1e6 * ordered[len(ordered) // 2]
    benchmark.extra_info["tick_p99_us"] = 1e6 * ordered[int(0.99 * len(ordered))]
    benchmark.extra_info["bare_py_trees_tick_us"] = 1e6 * bare_s
    benchmark.extra_info["times_the_bare_tick"] = mean_s / bare_s
    benchmark.extra_info["share_at_8_x_real_time"] = mean_s / (TICK_S / FASTEST)
