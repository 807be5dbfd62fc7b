"""What a tick costs the executive itself: a compiled fetch with scripted leaves, log and journal on.

Compared with the bare library's tick of a tree of the same shape, and with the share of a run that the executive may
take at eight times real time. `tick_time.py` says what idle nodes cost.
"""

import itertools
import time

import py_trees
import pytest

from executive.run.outcome import Outcome
from tests.benchmarks.tick_time import TICK_S, fetch, ticks_of_a_run

FASTEST = 8.0
STEPS_EACH = 40
SUCCESS = py_trees.common.Status.SUCCESS


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


def whole_run(tree, folder):
    """The CPU time of each cycle of a mission that is done (s)."""
    result, cycles = ticks_of_a_run([tree], folder)
    assert result.outcome is Outcome.SUCCESS, result.worst.message
    return cycles


@pytest.mark.benchmark(group="executive")
def test_a_tick_of_a_fetch_with_log_and_journal(benchmark, tmp_path):
    tree, cycles = fetch(STEPS_EACH), []
    assert len(tree.path_ids) > 50
    folders = (tmp_path / str(number) for number in itertools.count())
    benchmark.pedantic(lambda: cycles.extend(whole_run(tree, next(folders))), rounds=3, warmup_rounds=1)
    bare_s = sum(took := bare_ticks(tree)) / len(took)
    mean_s, ordered = sum(cycles) / len(cycles), sorted(cycles)
    benchmark.extra_info["tick_us"] = 1e6 * mean_s
    benchmark.extra_info["tick_median_us"] = 1e6 * ordered[len(ordered) // 2]
    benchmark.extra_info["tick_p99_us"] = 1e6 * ordered[int(0.99 * len(ordered))]
    benchmark.extra_info["bare_py_trees_tick_us"] = 1e6 * bare_s
    benchmark.extra_info["times_the_bare_tick"] = mean_s / bare_s
    benchmark.extra_info["share_at_8_x_real_time"] = mean_s / (TICK_S / FASTEST)
