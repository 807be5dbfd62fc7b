"""Suspending a tree: motion ends, places and attempts are kept, and time does not count in between."""

from typing import ClassVar

import pytest
from py_trees.common import Status

from executive.tree.behaviour import StoppableTime, suspend
from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.policies import Retry, Timeout
from executive.tree.nodes.skill_leaf import SkillLeaf
from skills.api import Cause, Failed, Running, Skill, Succeeded


@pytest.fixture
def leaf_of(context):
    def make(name, steps, log, **hooks):
        class Listed(Skill):
            name: ClassVar[str] = "listed"
            Inputs: ClassVar[type] = dict

            def begin(self, inputs):
                log.append(f"{name} begin")
                self.steps = list(steps)

            def step(self):
                log.append(f"{name} step")
                return self.steps.pop(0)

            def end(self):
                log.append(f"{name} end")

        for hook, function in hooks.items():
            setattr(Listed, hook, function)
        return SkillLeaf(
            path_id=f"alice/{name}", name=name, skill=Listed, inputs={}, outputs={}, limit_s=5.0, context=context
        )

    return make


def test_the_sequence_keeps_its_place_and_the_running_skill_begins_again(leaf_of):
    log = []
    first, second = leaf_of("a", [Succeeded("")], log), leaf_of("b", [Running(""), Succeeded("")], log)
    root = MemorySequence(path_id="alice/all", name="all", children=[first, second])
    root.tick_once()
    suspend(root)
    suspend(root)
    assert (root.status, second.status, second.suspended) == (Status.RUNNING, Status.RUNNING, True)
    assert log == ["a begin", "a step", "a end", "b begin", "b step", "b end"]
    log.clear()
    root.tick_once()
    assert (log, second.suspended) == (["b begin", "b step"], False)
    root.tick_once()
    assert root.status == Status.SUCCESS


def test_a_retry_keeps_its_attempt(leaf_of):
    log = []
    child = leaf_of("a", [Running(""), Failed(Cause.EXECUTION, "no")], log)
    root = Retry(path_id="alice/r", name="r", child=child, attempts=2, causes=frozenset({Cause.EXECUTION}))
    for _ in range(3):
        root.tick_once()
    suspend(root)
    assert (root.attempt, root.status) == (2, Status.RUNNING)
    root.tick_once()
    root.tick_once()
    assert (root.status, root.attempt) == (Status.FAILURE, 2)


def test_time_does_not_count_for_leaf_and_timeout(leaf_of, clock):
    leaf = leaf_of("a", [Running(""), Running(""), Succeeded("")], [], resume=lambda self, inputs: None)
    root = Timeout(path_id="alice/t", name="t", child=leaf, limit_s=3.0, clock=clock)
    root.tick_once()
    clock.advance(2.0)
    suspend(root)
    clock.advance(1000.0)
    root.tick_once()
    assert root.status == Status.RUNNING
    clock.advance(0.9)
    root.tick_once()
    assert root.status == Status.SUCCESS


def test_time_before_and_after_adds_up(leaf_of, clock):
    leaf = leaf_of("a", [Running("")] * 9, [])
    root = Timeout(path_id="alice/t", name="t", child=leaf, limit_s=3.0, clock=clock)
    root.tick_once()
    clock.advance(2.0)
    suspend(root)
    clock.advance(50.0)
    root.tick_once()
    clock.advance(1.1)
    root.tick_once()
    assert (root.status, root.cause) == (Status.FAILURE, Cause.TIMEOUT)


def test_a_skill_may_go_on_where_it_was(leaf_of):
    log = []
    hooks = {"suspend": lambda self: log.append("rest"), "resume": lambda self, inputs: log.append(f"on {inputs}")}
    leaf = leaf_of("a", [Running(""), Succeeded("")], log, **hooks)
    leaf.tick_once()
    suspend(leaf)
    leaf.tick_once()
    assert log == ["a begin", "a step", "rest", "on {}", "a step", "a end"]


def test_a_defect_in_a_hook_is_a_failure_with_error(leaf_of):
    def broken(self, *_):
        raise ZeroDivisionError("hook")

    for hook in ("suspend", "resume"):
        leaf = leaf_of("a", [Running(""), Succeeded("")], [], **{hook: broken})
        leaf.tick_once()
        suspend(leaf)
        assert leaf.status == Status.RUNNING
        leaf.tick_once()
        assert (leaf.status, leaf.cause) == (Status.FAILURE, Cause.ERROR)
        assert "ZeroDivisionError" in leaf.message


def test_a_suspended_leaf_that_is_stopped_ends_its_skill(leaf_of):
    log = []
    leaf = leaf_of("a", [Running("")], log, suspend=lambda self: None)
    leaf.tick_once()
    suspend(leaf)
    leaf.stop(Status.INVALID)
    assert (log[-1], leaf.active, leaf.cause) == ("a end", False, Cause.CANCELLED)


def test_idle_nodes_are_left_alone(leaf_of):
    log = []
    leaf = leaf_of("a", [Succeeded("done")], log)
    leaf.tick_once()
    suspend(leaf)
    assert (leaf.status, leaf.suspended, log) == (Status.SUCCESS, False, ["a begin", "a step", "a end"])


def test_stoppable_time(clock):
    time = StoppableTime(clock)
    clock.advance(1.0)
    time.stop()
    clock.advance(1.0)
    time.stop()
    assert (time.elapsed_s(), time.stopped) == (1.0, True)
    time.go_on()
    time.go_on()
    clock.advance(0.5)
    assert (time.elapsed_s(), time.stopped) == (1.5, False)
