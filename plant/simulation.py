"""The simulation: steps the Diagram, lets robots command and sense, and keeps the only clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from plant.diagram import RENDERER, WorldDiagram
from plant.spot.model import SpotModel
from plant.spot.robot import SpotRobot
from plant.spot.sensing import SpotSensors
from skills.robot import Pose2D, Robot

CONTROL_PERIOD_S = 0.01


class Engine:
    """A Diagram in motion with the robots in it; implements the Clock protocol."""

    def __init__(self, world: WorldDiagram, starts: Mapping[str, Pose2D], *, seed: int = 0) -> None:
        """`starts`: where each robot stands at time 0, in the world frame; `seed` gives the sensors' noise."""
        self.world = world
        self._simulator = Simulator(world.diagram)
        self.root_context: Context = self._simulator.get_mutable_context()
        self.context: Context = world.plant.GetMyMutableContextFromRoot(self.root_context)
        for name, pose in starts.items():
            world.robots[name].place(self.context, pose)
        self._spots = {
            name: SpotRobot(model, self._sensors(model, seed), self.context)
            for name, model in sorted(world.robots.items())
        }
        self._steps = 0
        self._observers: list[Callable[[float], None]] = []
        self._command_robots()
        self._simulator.Initialize()

    def _sensors(self, model: SpotModel, seed: int) -> SpotSensors:
        scene_graph = self.world.scene_graph
        return SpotSensors(model, scene_graph, self.root_context, self.context, seed=seed, renderer=RENDERER)

    @property
    def robots(self) -> Mapping[str, Robot]:
        """The robots by name."""
        return self._spots

    def observe(self, observer: Callable[[float], None]) -> None:
        """Call `observer(now_s)` after every control period."""
        self._observers.append(observer)

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self._steps * CONTROL_PERIOD_S

    def advance(self, dt_s: float) -> None:
        """Step the plant by dt_s, rounded to whole control periods (at least one)."""
        for _ in range(max(1, round(dt_s / CONTROL_PERIOD_S))):
            self._command_robots()
            self._steps += 1
            self._simulator.AdvanceTo(self.now())
            for observer in self._observers:
                observer(self.now())
        for spot in self._spots.values():
            spot.sense(self.now())

    def _command_robots(self) -> None:
        for spot in self._spots.values():
            spot.control(self.now(), CONTROL_PERIOD_S)
