"""What missions of many steps and nodes cost: compiling a thousand steps, and a tick of a tree of a thousand nodes.

    python -m pytest tests/benchmarks/test_block_benchmarks.py

The budgets are 0.5 s for the one, 3 ms for the other (of the tree's own time: skills do nothing).
"""

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
from tests.executive.conftest import (
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

WORLD = Knowledge.model_validate(KNOWLEDGE)
FULL = ValueIs(text="battery > 0.1 and n < 100000")
STEPS, NODES = 1000, 1000


def block(made, policy=None):
    return made.with_policy(policy)


def go(text):
    return Do.from_command(parse_command(text))


def wait(seconds=1000.0):
    return block(Wait(awaited=Awaited(seconds=seconds)))


def mixed(number):
    """Ten steps in blocks, with policies and values."""
    drive = go("Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]")
    put = block(Set(set={f"v{number % 7}": "n + 1"}))
    inner = block(
        Choose(condition=FULL, then=(drive, put), otherwise=(wait(),)), policy=Policy(timeout_s=60.0, retries=1)
    )
    tried = block(Try(steps=(CallSkill(skill="stow"), wait()), otherwise=(drive,)))
    return (block(Group(steps=(inner, tried), always=(wait(),), while_=While(holds=FULL))),)


def registry():
    script = Script(steps=10**9)
    return {name: scripted_skill(script, name, *ports) for name, ports in PORTS.items()}


@pytest.mark.benchmark(group="compiler")
def test_compiling_a_mission_of_a_thousand_steps(benchmark):
    steps = tuple(step for number in range(STEPS // 10) for step in mixed(number))
    mission = Mission(name="long", robot="Alice", steps=steps, variables={"n": 0})
    assert sum(1 for _ in mission.walk()) >= STEPS
    skills = registry()
    tree = benchmark.pedantic(
        lambda: compile_mission(mission, knowledge=WORLD, registry=skills), rounds=5, warmup_rounds=1
    )
    benchmark.extra_info["nodes"] = len(tree.path_ids)


def running(number):
    """About ten nodes that all run: rounds, conditions that are watched, waits for what never comes."""
    never = Wait(awaited=Awaited(condition=AllOf(parts=(Not(part=FULL), ButtonPressed(button="go"))), every_s=0.0))
    rounds = block(Repeat(loop=Loop(times=3), steps=(block(never),)))
    return block(
        Group(steps=(rounds,), while_=While(holds=FULL), when=(Handler(condition=Not(part=FULL), steps=(wait(),)),))
    )


@pytest.mark.benchmark(group="executive")
def test_a_tick_of_a_tree_of_a_thousand_nodes(benchmark):
    width = 1
    while True:
        steps = (block(Together(steps=tuple(running(number) for number in range(max(2, width))))),)
        mission = Mission(name="wide", robot="Alice", steps=steps, variables={"n": 0})
        tree = compile_mission(mission, knowledge=WORLD, registry=registry())
        if len(tree.path_ids) >= NODES:
            break
        width += 5
    spent, began = [], time.perf_counter()

    def ticked(progress):
        nonlocal began
        now = time.perf_counter()
        spent.append(now - began)
        began = now

    def whole():
        clock = ManualClock()
        entry = RunEntry(tree, ScriptedRobot(clock), StillLocaliser(), EmptyCostmap())
        run(
            [entry],
            clock=clock,
            worker=LockStepWorker(clock),
            settings=RunSettings(time_limit_s=20.0),
            visitors=[OnTick(ticked)],
        )

    benchmark.pedantic(whole, rounds=1)
    benchmark.extra_info["nodes"] = len(tree.path_ids)
    benchmark.extra_info["tick_ms_median"] = round(1000.0 * statistics.median(spent[10:]), 2)
