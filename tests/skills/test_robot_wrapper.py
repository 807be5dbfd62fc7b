"""Every wrapper of a robot passes every verb of the protocol on, with its arguments and its answer."""

import inspect
from itertools import product
from types import SimpleNamespace

import pytest

from executive.run.guarded_robot import GuardedRobot
from executive.run.watchdog import Watchdog
from plant.engine import Pipeline, PipelinedRobot
from skills.faults.faulty_robot import FaultyRobot, inject_faults, parse_fault
from skills.robot import CommandId, CommandState, CommandStatus, Lease, Robot
from skills.robot_wrapper import VERBS, RobotWrapper
from skills.testing.clock import VirtualClock

LEASE = Lease("Alice", "test", 1)
VALUES = {"lease": LEASE, "until_s": 1.0, "only": CommandId(3), "visual": False, "depth": True, "command": CommandId(3)}
OWN_COMMAND = CommandId(77)
SETTLED = ("command_status", "move_arm", "stop")  # by a pipeline itself: see tests/plant/test_engine.py
PACKAGES = ("executive.", "skills.", "plant.")


def answer_of(verb):
    """Answer of the recording robot: the id of a command, None, or the verb's name."""
    return {"CommandId": OWN_COMMAND, "None": None}.get(inspect.signature(getattr(Robot, verb)).return_annotation, verb)


def arguments_of(verb):
    """Arguments of a verb by position and by name; those without a value of their own are strings."""
    parameters = list(inspect.signature(getattr(Robot, verb)).parameters.values())[1:]
    by_name = [each for each in parameters if each.kind is inspect.Parameter.KEYWORD_ONLY]
    by_position = [VALUES.get(each.name, each.name) for each in parameters if each not in by_name]
    return tuple(by_position), {each.name: VALUES[each.name] for each in by_name}


class RecordingRobot:
    """Robot that records each call."""

    name = "Alice"

    def __init__(self):
        self.calls = []
        for verb in VERBS:
            setattr(self, verb, self._verb(verb))

    def _verb(self, verb):
        def call(*by_position, **by_name):
            self.calls.append((verb, by_position, by_name))
            return answer_of(verb)

        return call


def faulty(robot):
    return FaultyRobot(robot, VirtualClock(), (), 0.0)


def pipelined(robot):
    """Robot of an engine whose steps change nothing."""
    nothing = {"now": lambda: 0.0, "step": lambda dt_s: None, "sense": lambda: None, "poses_W": dict}
    return Pipeline(SimpleNamespace(robots={robot.name: robot}, **nothing)).robots["Alice"]


MAKERS = {
    "plain": RobotWrapper,
    "guarded": lambda robot: GuardedRobot(robot, Watchdog()),
    "faulty": faulty,
    "in the pipeline": pipelined,
    "faulty in the pipeline": lambda robot: faulty(pipelined(robot)),
    "guarded and faulty in the pipeline": lambda robot: GuardedRobot(faulty(pipelined(robot)), Watchdog()),
}


def begin(robot):
    """Begins the waiting commands of the pipeline among the wrappers, if there is one."""
    while isinstance(robot, RobotWrapper):
        if isinstance(robot, PipelinedRobot):
            robot._robot.command_status = lambda command: CommandStatus(CommandState.DONE)
            robot.begin_commands()
        robot = robot._robot


def test_these_are_all_wrappers():
    shipped = {each for each in RobotWrapper.__subclasses__() if each.__module__.startswith(PACKAGES)}
    assert shipped == {GuardedRobot, FaultyRobot, PipelinedRobot}


@pytest.mark.parametrize("wrapper", [RobotWrapper, *RobotWrapper.__subclasses__()])
def test_a_wrapper_has_every_verb_with_the_signature_of_the_protocol(wrapper):
    assert not hasattr(wrapper, "__getattr__")
    for verb in VERBS:
        of_wrapper, of_robot = (inspect.signature(getattr(each, verb), eval_str=False) for each in (wrapper, Robot))
        assert list(of_wrapper.parameters) == list(of_robot.parameters), verb
        kinds = [[each.kind for each in one.parameters.values()] for one in (of_wrapper, of_robot)]
        assert kinds[0] == kinds[1], verb


@pytest.mark.parametrize(
    ("maker", "verb"), [pair for pair in product(MAKERS, VERBS) if "pipeline" not in pair[0] or pair[1] not in SETTLED]
)
def test_a_verb_arrives_with_its_arguments_and_its_answer_comes_back(maker, verb, monkeypatch):
    monkeypatch.setattr("executive.run.guarded_robot.CHECKS", {})
    robot = RecordingRobot()
    wrapped = MAKERS[maker](robot)
    by_position, by_name = arguments_of(verb)
    answer = getattr(wrapped, verb)(*by_position, **by_name)
    begin(wrapped)
    assert robot.calls == [(verb, by_position, by_name)]
    assert answer == answer_of(verb) or ("pipeline" in maker and answer_of(verb) == OWN_COMMAND)


@pytest.mark.parametrize("verb", VERBS)
def test_a_fault_raises_in_every_verb_of_a_robot_in_the_pipeline(verb):
    robot = pipelined(RecordingRobot())
    by_position, by_name = arguments_of(verb)
    with pytest.raises(RuntimeError, match=f"{verb} does not answer"):
        getattr(inject_faults(robot, VirtualClock(), [parse_fault("robot dies")]), verb)(*by_position, **by_name)
