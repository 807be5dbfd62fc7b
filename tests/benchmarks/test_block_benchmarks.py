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
from executive.words.blocks import Choose, Group, Handler, Repeat, Set, Together, Try, Wait
from executive.words.command import parse_command
from executive.words.condition import AllOf, ButtonPressed, Not, ValueIs
from executive.words.expression import Expression
from executive.words.knowledge import Knowledge
from executive.words.steps import DEFAULT_WORLD, Mission, MissionStep, SkillCall, StepPolicy
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
FULL = ValueIs(Expression("battery > 0.1 and n < 100000"))
STEPS, NODES = 1000, 1000


def block(made, **more):
    return MissionStep(block=made, **more)


def go(text):
    return MissionStep((parse_command(text),))


def wait(seconds=1000.0):
    return block(Wait(seconds=seconds))


def mixed(number):
    """Ten steps in blocks, with policies and values."""
    drive = go("Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]")
    put = block(Set({f"v{number % 7}": Expression("n + 1")}))
    inner = block(Choose(FULL, (drive, put), (wait(),)), policy=StepPolicy(timeout_s=60.0, retries=1))
    tried = block(Try((MissionStep(skill=SkillCall("stow")), wait()), (drive,)))
    return (block(Group((inner, tried), always=(wait(),), holds=FULL)),)


def registry():
    script = Script(steps=10**9)
    return {name: scripted_skill(script, name, *ports) for name, ports in PORTS.items()}


@pytest.mark.benchmark(group="compiler")
def test_compiling_a_mission_of_a_thousand_steps(benchmark):
    steps = tuple(step for number in range(STEPS // 10) for step in mixed(number))
    mission = Mission("long", DEFAULT_WORLD, "Alice", steps, variables={"n": 0})
    assert sum(1 for _ in mission.walk()) >= STEPS
    skills = registry()
    tree = benchmark.pedantic(
        lambda: compile_mission(mission, knowledge=WORLD, registry=skills), rounds=5, warmup_rounds=1
    )
    benchmark.extra_info["nodes"] = len(tree.path_ids)


def running(number):
    """About ten nodes that all run: rounds, conditions that are watched, waits for what never comes."""
    never = Wait(AllOf((Not(FULL), ButtonPressed("go"))), every_s=0.0)
    rounds = block(Repeat((block(never),), times=3))
    return block(Group((rounds,), holds=FULL, when=(Handler(Not(FULL), (wait(),)),)))


@pytest.mark.benchmark(group="executive")
def test_a_tick_of_a_tree_of_a_thousand_nodes(benchmark):
    width = 1
    while True:
        steps = (block(Together(tuple(running(number) for number in range(max(2, width))))),)
        mission = Mission("wide", DEFAULT_WORLD, "Alice", steps, variables={"n": 0})
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
