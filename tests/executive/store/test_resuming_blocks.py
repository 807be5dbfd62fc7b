"""Blocks of which a mission is broken off in any tick and taken up by another process: they go on where they were."""

import dataclasses
from typing import ClassVar

import pytest

from executive.mission.request import Request
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings, RunVisitor
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.store.resuming import resumed_tree
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import Look, Not, ValueIs
from executive.words.leaf_steps import Awaited, CallSkill, Check, Set, Wait
from executive.words.mission import Mission
from executive.words.policy import OnFailure, Policy
from executive.words.steps import Ask, Choose, Group, Loop, Repeat, Together, Try, While
from skills.api import Cause, Failed, Running, Skill, Succeeded

REQUEST = Request("blocks", seed=3, name="m", world_name="flat", robot="Alice", fingerprint="print")


class KilledError(BaseException):
    """The process is gone."""

    stops_run = True


@dataclasses.dataclass(frozen=True)
class Nothing:
    pass


@pytest.fixture
def done():
    """What was done to the world, by name: the second step of each piece of work does it."""
    return []


@pytest.fixture
def works(done):
    """Skills a, b, c: a step, the work, and one more. After a restart one looks whether its work is done."""

    def work(skill_name, fails=False):
        class Work(Skill):
            name = skill_name
            Inputs = Nothing
            changes_world = True
            checkpoint: ClassVar[dict] = {}

            def begin(self, inputs):
                self.count, self.checkpoint = 0, {"before": done.count(skill_name)}

            def resume(self, inputs):
                before = self.checkpoint.get("before", done.count(skill_name))
                self.count, self.checkpoint = 2 if done.count(skill_name) > before else 0, {"before": before}

            def step(self):
                self.count += 1
                if fails and self.count == 2:
                    return Failed(Cause.EXECUTION, "no")
                if self.count == 2:
                    done.append(skill_name)
                return Succeeded(f"{skill_name} done") if self.count >= 3 else Running(f"{skill_name} goes on")

        return Work

    return {**{name: work(name) for name in "abcd"}, "fails": work("fails", fails=True)}


def block(made, policy=None):
    return made.with_policy(policy)


def do(*names):
    return tuple(CallSkill(skill=name) for name in names)


def put(text):
    return block(Set(set={"n": text}))


def value(text):
    return ValueIs(text=text)


WAIT = block(Wait(awaited=Awaited(seconds=0.2)))
BEER = Look.from_command(parse_command("Take [Nothing] to [shelf] and do [find] to [beer]"))
RETRIES = Policy(retries=1)

# Each construct, and what is done in all, whenever the process is killed.
BLOCKS = {
    "if": (
        (
            put("1"),
            block(Choose(condition=value("n > 0"), then=(*do("a"), put("0"), *do("b")), otherwise=do("c"))),
            *do("d"),
        ),
        "abd",
    ),
    "else": ((block(Choose(condition=value("n > 0"), then=do("a"), otherwise=do("b", "c"))), *do("d")), "bcd"),
    "repeat": ((block(Repeat(loop=Loop(times=3), steps=do("a", "b"))), *do("d")), "abababd"),
    "until": ((block(Repeat(loop=Loop(until=value("n >= 3")), steps=(*do("a"), put("n + 1")))), *do("d")), "aaad"),
    "while": ((block(Repeat(loop=Loop(while_=value("n < 3")), steps=(put("n + 1"), *do("a")))), *do("d")), "aaad"),
    "every": ((block(Repeat(loop=Loop(times=3, every_s=0.5), steps=do("a"))), *do("d")), "aaad"),
    "repeat in repeat": (
        (
            block(Repeat(loop=Loop(times=2), steps=(block(Repeat(loop=Loop(times=2), steps=do("a"))), *do("b")))),
            *do("d"),
        ),
        "aabaabd",
    ),
    "if in repeat": (
        (
            block(
                Repeat(
                    loop=Loop(times=3),
                    steps=(put("n + 1"), block(Choose(condition=value("n == 2"), then=do("a"), otherwise=do("b")))),
                )
            ),
            *do("d"),
        ),
        "babd",
    ),
    "try": ((block(Try(steps=do("a"), otherwise=do("b"))), *do("d")), "ad"),
    "try else": ((block(Try(steps=do("a", "fails"), otherwise=do("b", "c"))), *do("d")), "abcd"),
    "together": ((block(Together(steps=(*do("a"), WAIT))), *do("d")), "ad"),
    "group": ((block(Group(steps=do("a", "b"))), *do("d")), "abd"),
    "always": ((block(Group(steps=do("a"), always=do("b", "c"))), *do("d")), "abcd"),
    "always after a failure": (
        (block(Try(steps=(block(Group(steps=do("a", "fails"), always=do("b"))),), otherwise=do("c"))), *do("d")),
        "abcd",
    ),
    "always in always": (
        (block(Group(steps=(block(Group(steps=do("a"), always=do("b"))),), always=do("c"))), *do("d")),
        "abcd",
    ),
    "while it holds": ((block(Group(steps=do("a", "b"), while_=While(holds=value("battery > 0.1")))), *do("d")), "abd"),
    "set": (
        (put("n + 1"), *do("a"), put("n + 1"), block(Choose(condition=value("n == 2"), then=do("b"))), *do("d")),
        "abd",
    ),
    "check": (
        (
            block(Check(condition=value("n == 0"), gives={"answer": "so"})),
            *do("a"),
            put("5"),
            block(Choose(condition=value("so"), then=do("b"))),
            *do("d"),
        ),
        "abd",
    ),
    "wait": ((*do("a"), WAIT, *do("d")), "ad"),
    "ask": (
        (block(Ask(ask="q?", choices={"x": do("a"), "y": do("b", "c")}, limit_s=0.2, default="y")), *do("d")),
        "bcd",
    ),
    "until it is seen": ((block(Repeat(loop=Loop(until=BEER), steps=do("a"))), *do("d")), "aad"),
    "while it is not seen": ((block(Repeat(loop=Loop(while_=Not(part=BEER)), steps=do("a"))), *do("d")), "aad"),
    "skipped": ((block(Group(steps=do("a", "fails", "b")), policy=Policy(on_failure=OnFailure.SKIP)), *do("d")), "ad"),
}


@pytest.fixture
def live(tmp_path, clock, robot, make, works, registry, knowledge, script, done):
    """One life of the executive: to its end, or until it is killed after some tick.

    What is looked for is there once "a" was done twice.
    """

    def detect(skill):
        there = done.count("a") >= 2
        seen = {"observation": make.COKE, "observations": (make.COKE,)}
        return Succeeded("seen", seen) if there else Failed(Cause.POSTCONDITION, "not seen")

    script.ends["detect"], script.steps = detect, 2
    skills = {**registry, **works}

    def one_life(steps, number, kill_after=None):
        mission = Mission(name="m", robot="Alice", steps=steps, variables={"n": 0, "so": False})
        tree = compile_mission(mission, knowledge=knowledge, registry=skills)
        with MissionStore(tmp_path / f"{number}.sqlite") as store:
            missions = store.missions()
            mission = missions[0] if missions else store.add(REQUEST, queued=False)
            journal = store.journal(mission.id)
            if missions:
                tree, recollection = resumed_tree(tree, store.memory(mission.id))
                journal.use_recollection(recollection)
            store.begin(mission.id)
            robot.holder = None
            entry = RunEntry(tree, robot, make.StillLocaliser(), make.EmptyCostmap())
            with LockStepWorker(clock) as worker:
                try:
                    return run(
                        [entry],
                        clock=clock,
                        worker=worker,
                        visitors=[Killing(journal, kill_after)],
                        settings=RunSettings(seed=3, tick_period_s=0.1, time_limit_s=60.0),
                        control=Control(pace=None),
                    )
                except KilledError:
                    return None

    return one_life


class Killing(RunVisitor):
    """Passes notes on, and kills after some."""

    def __init__(self, journal, kill_after):
        self.journal, self.left = journal, kill_after

    def tick(self, progress):
        self.journal.tick(progress)
        if self.left is not None:
            self.left -= 1
            if self.left <= 0:
                raise KilledError


@pytest.mark.parametrize("name", BLOCKS)
def test_a_kill_in_any_tick_neither_repeats_nor_leaves_out_anything(live, done, name):
    steps, expected = BLOCKS[name]
    whole = live(steps, "whole")
    assert (whole.outcome, "".join(done)) == (Outcome.SUCCESS, expected)
    wrong = []
    for tick in range(1, whole.ticks):
        done.clear()
        assert live(steps, tick, kill_after=tick) is None
        result = live(steps, tick)
        if (result.outcome, "".join(done)) != (Outcome.SUCCESS, expected):
            wrong.append((tick, result.outcome.value, "".join(done), result.worst.message[:120]))
    assert not wrong, wrong


@pytest.mark.parametrize("name", ["if", "until", "while", "repeat in repeat", "try else", "always after a failure"])
def test_one_kill_after_the_other_leads_to_the_end_all_the_same(live, done, name):
    steps, expected = BLOCKS[name]
    lives = 1
    while live(steps, "store", kill_after=7) is None and lives < 50:
        lives += 1
    assert ("".join(done), 1 < lives < 50) == (expected, True)


def test_after_a_kill_in_any_tick_each_look_is_one_finding(live, done):
    steps, _ = BLOCKS["while it is not seen"]
    whole, wrong = live(steps, "whole"), []
    for tick in range(1, whole.ticks):
        done.clear()
        live(steps, tick, kill_after=tick)
        findings = live(steps, tick).worst.findings
        if "".join("Y" if one.answer else "N" for one in findings) != "NNY":
            wrong.append((tick, [(one.answer, one.t_s) for one in findings]))
    assert not wrong, wrong


def test_after_a_kill_in_any_tick_a_check_of_several_objects_is_one_finding(live, done):
    steps = (block(Check(condition=value("n == 0"))), *do("a"))
    whole = live(steps, "whole")
    counts = {}
    for tick in range(1, whole.ticks):
        done.clear()
        live(steps, tick, kill_after=tick)
        counts[tick] = len(live(steps, tick).worst.findings)
    assert set(counts.values()) == {1}, counts
