"""What missions of many steps and nodes cost: compiling a thousand steps, and a tick of a tree of a thousand nodes.

    python -m pytest tests/benchmarks/test_block_benchmarks.py

The budgets are 0.5 s for the one, 3 ms for the other (of the tree's own time: skills do nothing).
"""

import itertools
import statistics
import time

import pytest

from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import AllOf, ButtonPressed, Not, ValueIs
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Awaited, CallSkill, Do, Set, Wait
from executive.words.mission import Mission
from executive.words.policy import Policy
from executive.words.steps import Choose, Group, Handler, Loop, Repeat, Together, Try, While
from tests.executive import conftest as scripted
from tests.visitors import OnTick

WORLD = Knowledge.model_validate(scripted.KNOWLEDGE)
FULL = ValueIs(text="battery > 0.1 and n < 100000")
STEPS, NODES = 1000, 1000


def registry():
    """Scripted skills that go on for ever."""
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
    ends, clock = [], scripted.ManualClock()
    entry = RunEntry(tree, scripted.ScriptedRobot(clock), scripted.StillLocaliser(), scripted.EmptyCostmap())
    visitors, settings = [OnTick(lambda _: ends.append(time.perf_counter()))], RunSettings(time_limit_s=20.0)
    once = {"clock": clock, "worker": LockStepWorker(clock), "settings": settings, "visitors": visitors}
    benchmark.pedantic(run, args=([entry],), kwargs=once, rounds=1)
    spent_s = [after - before for before, after in itertools.pairwise(ends)]
    benchmark.extra_info["nodes"] = len(tree.path_ids)
    benchmark.extra_info["tick_ms_median"] = round(1000.0 * statistics.median(spent_s[10:]), 2)
