"""What missions of many steps and nodes cost: compiling them, and a tick of the executive itself.

    python -m pytest tests/benchmarks/test_tree_benchmarks.py

The budgets are 0.5 s for compiling a thousand steps, 3 ms for a tick of a thousand nodes (of the tree's own time, as
skills do nothing). Steps must not make each other dearer. The tick of a fetch, with scripted leaves, log and journal,
is compared with the bare library's tick of a tree of the same shape, and with the share of a run that the executive may
take at eight times real time. `tick_time.py` says what idle nodes cost.
"""

import itertools
import statistics
import time
from pathlib import Path

import py_trees
import pytest

from executive.language.parser import load_parser
from executive.mission.resolve import mission_from_file
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.command import parse_command
from executive.words.condition import AllOf, ButtonPressed, Not, ValueIs
from executive.words.knowledge import Knowledge, load_knowledge
from executive.words.leaf_steps import Awaited, CallSkill, Do, Set, Wait
from executive.words.mission import Mission
from executive.words.step import Policy
from executive.words.steps import Choose, Group, Handler, Loop, Repeat, Together, Try, While
from tests.benchmarks.tick_time import TICK_S, fetch, ticks_of_a_run
from tests.executive import conftest as scripted
from tests.visitors import OnTick

WORLD = Knowledge.model_validate(scripted.KNOWLEDGE)
FULL = ValueIs(text="battery > 0.1 and n < 100000")
STEPS, NODES = 1000, 1000
FASTEST, STEPS_EACH, SUCCESS = 8.0, 40, py_trees.common.Status.SUCCESS
EXAMPLES = (
    "  - {to: kitchen, do: grasp, object: drink, retries: 1, timeout: 300}",
    "  - {take: drink, to: coffee table, on_failure: skip}",
    "  - say: is there a hammer in the workshop",
    "  - {skill: navigate, with: {x: 5.2, y: 4.5, yaw: 0.0}}",
)
SHORT, LONG = 2, 25
FLAT = Path(__file__).parents[2] / "plant" / "worlds" / "flat" / "knowledge.yaml"


def registry():
    script = scripted.Script(steps=10**9)
    return {name: scripted.scripted_skill(script, name, *ports) for name, ports in scripted.PORTS.items()}


def mission(*steps):
    return Mission(name="long", robot="Alice", steps=steps, variables={"n": 0})


def wait():
    return Wait(awaited=Awaited(seconds=1000.0))


def mixed(number):
    """Ten steps in blocks, with policies and values."""
    drive = Do.from_command(parse_command("Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"))
    put = Set(set={f"v{number % 7}": "n + 1"})
    inner = Choose(condition=FULL, then=(drive, put), otherwise=(wait(),))
    tried = Try(steps=(CallSkill(skill="stow"), wait()), otherwise=(drive,))
    steps = (inner.with_policy(Policy(timeout_s=60.0, retries=1)), tried)
    return Group(steps=steps, always=(wait(),), while_=While(holds=FULL))


@pytest.mark.benchmark(group="compiler")
def test_compiling_a_mission_of_a_thousand_steps(benchmark):
    long = mission(*(mixed(number) for number in range(STEPS // 10)))
    assert sum(1 for _ in long.walk()) >= STEPS
    skills = {"knowledge": WORLD, "registry": registry()}
    tree = benchmark.pedantic(compile_mission, args=(long,), kwargs=skills, rounds=5, warmup_rounds=1)
    benchmark.extra_info["nodes"] = len(tree.path_ids)


def running():
    """About ten nodes that all run: rounds, conditions that are watched, waits for what never comes."""
    never = Wait(awaited=Awaited(condition=AllOf(parts=(Not(part=FULL), ButtonPressed(button="go"))), every_s=0.05))
    rounds, handler = Repeat(loop=Loop(times=3), steps=(never,)), Handler(condition=Not(part=FULL), steps=(wait(),))
    return Group(steps=(rounds,), while_=While(holds=FULL), when=(handler,))


@pytest.mark.benchmark(group="executive")
def test_a_tick_of_a_tree_of_a_thousand_nodes(benchmark):
    wide = (mission(Together(steps=tuple(running() for _ in range(width)))) for width in range(2, NODES, 5))
    trees = (compile_mission(each, knowledge=WORLD, registry=registry()) for each in wide)
    tree = next(each for each in trees if len(each.path_ids) >= NODES)
    ends, clock = [], scripted.VirtualClock()
    entry = RunEntry(tree, scripted.StandingRobot(clock), scripted.StillLocaliser(), scripted.EmptyCostmap())
    visitors, settings = [OnTick(lambda _: ends.append(time.perf_counter()))], RunSettings(time_limit_s=20.0)
    once = {"clock": clock, "worker": LockStepWorker(clock), "settings": settings, "visitors": visitors}
    benchmark.pedantic(run, args=([entry],), kwargs=once, rounds=1)
    spent_s = [after - before for before, after in itertools.pairwise(ends)]
    benchmark.extra_info["nodes"] = len(tree.path_ids)
    benchmark.extra_info["tick_ms_median"] = round(1000.0 * statistics.median(spent_s[10:]), 2)


@pytest.mark.benchmark(group="compiler")
def test_compiling_a_mission_of_a_hundred_steps(benchmark, tmp_path):
    flat, skills, parser = load_knowledge(FLAT), installed_skills(), load_parser()

    def compiled(times):
        path = tmp_path / f"{times}.yaml"
        path.write_text("name: long\nsteps:\n" + "\n".join(EXAMPLES * times) + "\n")
        mission = mission_from_file(path, parser=parser, knowledge=flat)
        return lambda: compile_mission(mission, knowledge=flat, registry=skills)

    short, long = compiled(SHORT), compiled(LONG)
    short()
    begun = time.process_time()
    for _ in range(10):
        short()
    short_s = (time.process_time() - begun) / 10
    benchmark.pedantic(long, rounds=10, warmup_rounds=1)
    benchmark.extra_info["step_of_100_times_step_of_8"] = round(
        benchmark.stats.stats.median / LONG / (short_s / SHORT), 2
    )


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
