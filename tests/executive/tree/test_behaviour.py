"""Suspending a tree: motion ends, places and attempts are kept, and time does not count in between."""

from typing import ClassVar

import pytest
from py_trees.common import Status

from executive.tree.behaviour import StoppableTime, suspend
from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.policies import Retry, Timeout
from executive.tree.nodes.skill_leaf import SkillLeaf
from skills.api import Cause, Failed, Running, Skill, Succeeded
from tests.executive.tree.scripted import play


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
    assert play(root, "R||") == "R||"
    assert (root.status, second.status, second.suspended) == (Status.RUNNING, Status.RUNNING, True)
    assert log == ["a begin", "a step", "a end", "b begin", "b step", "b end"]
    log.clear()
    assert play(root, "R") == "R"
    assert (log, second.suspended) == (["b begin", "b step"], False)
    assert play(root, "S") == "S"


def test_a_retry_keeps_its_attempt(leaf_of):
    child = leaf_of("a", [Running(""), Failed(Cause.EXECUTION, "no")], [])
    root = Retry(path_id="alice/r", name="r", child=child, attempts=2, causes=frozenset({Cause.EXECUTION}))
    assert (play(root, "RRR|"), root.attempt) == ("RRR|", 2)
    assert (play(root, "RF"), root.attempt) == ("RF", 2)


@pytest.fixture
def limited(leaf_of, clock):
    """A skill under a time limit of 3 s, suspended after 2 s for a long time."""

    def begun(*steps, **hooks):
        leaf = leaf_of("a", steps, [], **hooks)
        root = Timeout(path_id="alice/t", name="t", child=leaf, limit_s=3.0, clock=clock)
        root.tick_once()
        clock.advance(2.0)
        suspend(root)
        clock.advance(1000.0)
        return root

    return begun


def test_time_does_not_count_for_leaf_and_timeout(limited, clock):
    root = limited(Running(""), Running(""), Succeeded(""), resume=lambda self, inputs: None)
    assert play(root, "R") == "R"
    clock.advance(0.9)
    assert play(root, "S") == "S"


def test_time_before_and_after_adds_up(limited, clock):
    root = limited(*[Running("")] * 9)
    assert play(root, "R") == "R"
    clock.advance(1.1)
    assert (play(root, "F"), root.cause) == ("F", Cause.TIMEOUT)


def test_a_skill_may_go_on_where_it_was(leaf_of):
    log = []
    hooks = {"suspend": lambda self: log.append("rest"), "resume": lambda self, inputs: log.append(f"on {inputs}")}
    assert play(leaf_of("a", [Running(""), Succeeded("")], log, **hooks), "R|S") == "R|S"
    assert log == ["a begin", "a step", "rest", "on {}", "a step", "a end"]


@pytest.mark.parametrize("hook", ["suspend", "resume"])
def test_a_defect_in_a_hook_is_a_failure_with_error(leaf_of, hook):
    leaf = leaf_of("a", [Running(""), Succeeded("")], [], **{hook: lambda self, *_: 1 / 0})
    assert (play(leaf, "R|"), leaf.status) == ("R|", Status.RUNNING)
    assert (play(leaf, "F"), leaf.cause) == ("F", Cause.ERROR)
    assert "ZeroDivisionError" in leaf.message


def test_a_suspended_leaf_that_is_stopped_ends_its_skill(leaf_of):
    log = []
    leaf = leaf_of("a", [Running("")], log, suspend=lambda self: None)
    assert play(leaf, "R|I") == "R|I"
    assert (log[-1], leaf.active, leaf.cause) == ("a end", False, Cause.CANCELLED)


def test_idle_nodes_are_left_alone(leaf_of):
    log = []
    leaf = leaf_of("a", [Succeeded("done")], log)
    assert play(leaf, "S|") == "S|"
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
