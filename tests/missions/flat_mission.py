"""Missions in the flat, without a command line and visual meshes, with robots in the pipeline as in `errand run`."""

from dataclasses import replace

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.app.runs.goal_conditions import verdict_of
from executive.app.runs.simulated import run_entry
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from plant.engine import Pipeline
from plant.robots.robot_kind import PlacedRobot
from plant.simulation import Simulation
from skills.faults.faulty_robot import inject_faults
from tests.project import core_skills
from tests.visitors import OnMessage, OnTick

FETCH = (
    "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
    "Take [drink] to [start] and do [Nothing] to [Nothing]",
)


class FlatMission:
    """A mission in the flat, with what happened in it."""

    def __init__(self, texts, *, seed=1, start=None, world="flat", skills=(), visuals=False, **plant):
        self.world = open_world(world)
        self.knowledge = knowledge_of(self.world)
        mission = Mission(name="m", robot="Alice", steps=tuple(Do.from_command(parse_command(text)) for text in texts))
        registry = core_skills() | {each.name: each for each in skills}
        self.tree = compile_mission(mission, knowledge=self.knowledge, registry=registry)
        if start is not None:
            plant["robots"] = [PlacedRobot("Alice", "spot", start, self.world.dock)]
        self.simulation = Simulation(self.world, seed=seed, visuals=visuals, **plant)
        self.clock = Pipeline(self.simulation.engine)
        robot, start = self.clock.robots["Alice"], self.simulation.starts["Alice"]
        self.entry = run_entry(robot, self.world, self.tree, start=start)
        self.transitions, self.seed = [], seed

    def _publish(self, topic, message):
        if topic == "transitions":
            self.transitions.append(message)

    def run(self, robot=None, observer=None, faults=()):
        """Run it to its end; the robot's result and the referee's verdict."""
        robot = inject_faults(robot or self.entry.robot, self.clock, faults)
        result = run(
            [replace(self.entry, robot=robot)],
            clock=self.clock,
            worker=LockStepWorker(self.clock),
            settings=RunSettings(seed=self.seed),
            visitors=[OnMessage(self._publish), *([] if observer is None else [OnTick(observer)])],
        ).worst
        return result, verdict_of(self.tree, result, self.simulation.referee.judge)

    def running(self):
        """Names of the leaves that work now."""
        last = {t["node"]: t["to"] for t in self.transitions}
        return {node.rsplit("/", 1)[-1].replace("-", "_") for node, status in last.items() if status == "RUNNING"}

    def ended(self, part):
        """How the nodes with `part` in their path ids ended, in order."""
        return [t["to"] for t in self.transitions if part in t["node"] and t["to"] in ("SUCCESS", "FAILURE")]


def honest(result, verdict):
    """The claim is true; a failure carries a cause and a sentence."""
    claimed = result.outcome is Outcome.SUCCESS
    assert not claimed or verdict.success, verdict.why
    assert claimed or (result.cause is not None and result.message)
