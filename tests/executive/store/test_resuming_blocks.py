"""Blocks of which a mission is broken off in any tick and taken up by another process: they go on where they were."""

from dataclasses import replace
from functools import cache
from typing import ClassVar

import pytest
import yaml

from executive.mission.load import load_mission
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunVisitor
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.store.resuming import resumed_tree
from executive.tree.compiler import compile_mission
from skills.api import Cause, Failed, Running, Skill, Succeeded
from skills.manipulation.posture import StowInputs
from skills.testing.clock import VirtualClock
from tests.executive.conftest import PATIENT
from tests.executive.store.copies import copy_database
from tests.tables import yaml_beside
from tests.visitors import OnTick

BLOCKS = yaml_beside(__file__, "blocks.yaml")
REQUEST = Request("blocks", seed=3, name="m", world_name="flat", robot="Alice", fingerprint="print")


class KilledError(BaseException):
    """The process is gone."""

    stops_run = True


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
            Inputs = StowInputs
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


@pytest.fixture
def live(tmp_path, make, works, registry, knowledge, script, done):
    """One life of the executive: to its end, or until it is killed after some tick. It begins at `since_s`.

    What is looked for is there once "a" was done twice.
    """

    def detect(skill):
        there = done.count("a") >= 2
        seen = {"observation": make.COKE, "observations": (make.COKE,), "unexplained": ()}
        return Succeeded("seen", seen) if there else Failed(Cause.POSTCONDITION, "not seen")

    script.ends["detect"], script.steps = detect, 2
    skills = {**registry, **works}

    @cache
    def tree_of(name):
        facts = {"name": "m", "robot": "Alice", "steps": BLOCKS[name]["steps"], "variables": {"n": 0, "so": False}}
        mission = load_mission("blocks.yaml", text=yaml.safe_dump(facts, sort_keys=False))
        return compile_mission(mission, knowledge=knowledge, registry=skills)

    def one_life(name, number, kill_after=None, *, since_s=0.0, visitor=None):
        tree, clock = tree_of(name), VirtualClock()
        robot = make.StandingRobot(clock)
        clock.advance(since_s)
        with MissionStore(tmp_path / f"{number}.sqlite") as store:
            missions = store.missions()
            mission = missions[0] if missions else store.add(REQUEST, queued=False)
            journal = store.journal(mission.id)
            if missions:
                tree, recollection = resumed_tree(tree, store.memory(mission.id))
                journal.use_recollection(recollection)
            store.begin(mission.id)
            entry = RunEntry(tree, robot, make.StillLocaliser(), make.EmptyCostmap())
            with LockStepWorker(clock) as worker:
                try:
                    return run(
                        [entry],
                        clock=clock,
                        worker=worker,
                        visitors=[Killing(journal, kill_after), *([] if visitor is None else [visitor])],
                        settings=replace(PATIENT, tick_period_s=0.1, time_limit_s=60.0),
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
def test_a_kill_in_any_tick_neither_repeats_nor_leaves_out_anything(live, tmp_path, done, name):
    """Nor does it add a finding: each look, and a check of several objects, is one.

    A copy of the store after each tick is what a kill would leave.
    """
    expected = (Outcome.SUCCESS, BLOCKS[name]["done"], BLOCKS[name].get("findings", ""))

    def achieved(result):
        found = "".join("Y" if finding.answer else "N" for finding in result.worst.findings)
        return result.outcome, "".join(done), found

    left, wrong = [], []

    def copy(progress):
        left.append((progress.now_s, done[:]))
        copy_database(tmp_path / "whole.sqlite", tmp_path / f"{len(left)}.sqlite")

    whole = live(name, "whole", visitor=OnTick(copy))
    assert achieved(whole) == expected
    for tick, (since_s, done[:]) in enumerate(left[: whole.ticks - 1], start=1):
        result = live(name, tick, since_s=since_s)
        if achieved(result) != expected:
            wrong.append((tick, *achieved(result), result.worst.message[:120]))
    assert not wrong, wrong


@pytest.mark.parametrize("name", ["if", "until", "while", "repeat in repeat", "try else", "always after a failure"])
def test_one_kill_after_the_other_leads_to_the_end_all_the_same(live, done, name):
    lives = 1
    while live(name, "store", kill_after=7) is None and lives < 50:
        lives += 1
    assert ("".join(done), 1 < lives < 50) == (BLOCKS[name]["done"], True)
