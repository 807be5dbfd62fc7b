"""Control of one robot among several: the others go on."""

from dataclasses import dataclass

import pytest
from py_trees.common import Status

from executive.run.control import Control
from executive.run.control_state import Mode
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.steps import Group
from skills.api import Question
from tests.visitors import OnMessage, OnTick

GO = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"


@dataclass
class Pair:
    """Alice and Bob, each on the way to the kitchen, and what was logged."""

    robots: dict
    result: object
    log: list

    def outcomes(self):
        return {each.robot_name: each.outcome for each in self.result.robots}

    def said(self):
        return [message["message"] for topic, message in self.log if topic == "control"]


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def run_pair(clock, knowledge, registry, make, control):
    def runner(observe=None, *, after=(), time_limit_s=1200.0, step=None):
        log, robots = [], {name: make.StandingRobot(clock, name) for name in ("Alice", "Bob")}
        steps = (step or Do.from_command(parse_command(GO)),)
        missions = {name: Mission(name="go", robot=name, steps=steps) for name in robots}
        trees = {n: compile_mission(m, knowledge=knowledge, registry=registry) for n, m in missions.items()}
        waits = {"Bob": after}
        entries = [
            RunEntry(trees[name], robot, make.StillLocaliser(), make.EmptyCostmap(), after=waits.get(name, ()))
            for name, robot in robots.items()
        ]
        visitors = [OnMessage(lambda topic, message: log.append((topic, message)))]
        visitors += [] if observe is None else [OnTick(observe)]
        result = run(
            entries,
            clock=clock,
            worker=LockStepWorker(clock),
            settings=RunSettings(seed=3, time_limit_s=time_limit_s, endings_limit_s=5.0),
            control=control,
            visitors=visitors,
        )
        return Pair(robots, result, log)

    return runner


def at(actions):
    """An observer that does something after given ticks."""
    return lambda progress: actions.get(progress.ticks, lambda: None)()


def test_a_robot_that_is_paused_stands_and_the_other_is_done_meanwhile(run_pair, control):
    seen = {}

    def observe(progress):
        if progress.ticks == 1:
            control.pause("let me look", robot="Bob")
        if progress.ticks in (3, 20):
            seen[progress.ticks] = progress.states["Bob"]
        if progress.ticks == 20:
            seen["modes"] = {name: each.mode for name, each in control.state.robots.items()}
            seen["Alice"] = progress.states["Alice"]["alice/go"].status
            control.resume(robot="Bob")

    pair = run_pair(observe)
    assert (seen[3], seen["modes"]["Bob"], seen["Alice"]) == (seen[20], Mode.PAUSED, Status.SUCCESS)
    assert pair.outcomes() == {"Alice": Outcome.SUCCESS, "Bob": Outcome.SUCCESS}
    assert pair.said() == ["Bob: let me look", "Bob: the mission goes on"]


def test_the_stop_button_of_one_robot_is_not_that_of_the_other(run_pair, control):
    seen = {}

    def observe(progress):
        if progress.ticks == 1:
            control.stop_button("too near", robot="Alice")
            seen["pressed"] = [control.stop_pressed(name) for name in ("Alice", "Bob")]
        if progress.ticks == 10:
            seen["reason"] = control.state.robots["Alice"].reason
            seen["mode"] = control.state.mode
            control.release_stop_button(robot="Alice")

    assert set(run_pair(observe).outcomes().values()) == {Outcome.SUCCESS}
    assert seen == {"pressed": ["too near", None], "reason": "too near", "mode": Mode.RUNNING}


def test_the_mission_of_one_robot_is_cancelled_alone(run_pair, control):
    pair = run_pair(at({1: lambda: control.cancel("not now", robot="Bob")}))
    assert pair.outcomes() == {"Alice": Outcome.SUCCESS, "Bob": Outcome.CANCELLED}
    assert [each.message for each in pair.result.robots if each.robot_name == "Bob"] == ["not now"]
    assert (pair.robots["Bob"].driving, pair.robots["Bob"].holder) == (False, None)


def test_a_paused_robot_can_be_cancelled(run_pair, control):
    actions = {1: lambda: control.pause(robot="Bob"), 4: lambda: control.cancel("not now", robot="Bob")}
    assert run_pair(at(actions)).outcomes()["Bob"] is Outcome.CANCELLED


def test_a_robot_does_not_begin_when_the_one_it_waits_for_is_cancelled(run_pair, control):
    pair = run_pair(at({1: lambda: control.cancel("not now", robot="Alice")}), after=("Alice",))
    assert pair.outcomes() == {"Alice": Outcome.CANCELLED, "Bob": Outcome.FAILURE}


def test_while_every_robot_is_held_no_time_counts_against_the_run(run_pair, control):
    actions = {1: lambda: [control.pause(robot=name) for name in ("Alice", "Bob")]}
    actions[400] = lambda: [control.resume(robot=name) for name in ("Alice", "Bob")]
    pair = run_pair(at(actions), time_limit_s=10.0)
    assert set(pair.outcomes().values()) == {Outcome.SUCCESS}


@pytest.mark.parametrize("act", ["pause", "cancel", "stop_button"])
def test_a_robot_that_is_not_there_is_refused(control, compiled, act):
    control.begin({"Alice": compiled(GO)})
    with pytest.raises(ValueError, match="robot 'Carl' is not in this run; there are: Alice"):
        getattr(control, act)(robot="Carl")


def test_a_question_says_whose_it_is(control, clock):
    control.ask(Question("q", "Is it open?", ("yes", "no"), "no", 60.0), clock, "Bob")
    assert [each.robot for each in control.state.questions] == ["Bob"]


def test_a_hold_of_all_robots_holds_each(control, compiled):
    control.begin({"Alice": compiled(GO)})
    control.pause(robot="Alice")
    control.stop_button("fire")
    assert (control.state.robots["Alice"].mode, control.state.robots["Alice"].reason) == (Mode.STOPPED, "fire")
    control.release_stop_button()
    assert control.state.robots["Alice"].mode is Mode.PAUSED


def test_a_stopped_robot_does_not_run_the_steps_under_always(run_pair, control, script):
    # Both are on the way when all is cancelled; in the end each goes to the kitchen as well, but Bob is stopped.
    def stop_and_cancel():
        control.stop_button("too near", robot="Bob")
        control.cancel("enough")

    going = Do.from_command(parse_command(GO))
    pair = run_pair(at({2: stop_and_cancel}), step=Group(steps=(going,), always=(going,)))
    assert set(pair.outcomes().values()) == {Outcome.CANCELLED}
    drives = {name: robot.calls.count("drive") for name, robot in pair.robots.items()}
    assert drives["Alice"] == drives["Bob"] + script.steps
