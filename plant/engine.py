"""The engine: steps the Diagram, commands and senses for the robots, and is the only clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from plant.diagram import TIME_STEP_S, WorldDiagram
from plant.events import Doors, Moves
from plant.loose_objects import CarriedObjects, Sleepers
from plant.people.receivers import Receivers
from plant.people.walkers import Walkers
from plant.robots.robot_kind import SensorOptions
from plant.saved_state import State, Stateful
from skills.robot import FloatArray, Robot

CONTROL_STEPS = 2
SLEEP_PERIOD_STEPS = 4
_SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
HAND_OUTLINE_M, PERSON_OUTLINE_M = 0.15 * _SQUARE, 0.25 * _SQUARE
"""Outlines (4, 2) of a hand and a person about their centres, for which doors wait."""


class Engine(Stateful, saved=("_steps", "walkers", "receivers", "doors")):
    """A Diagram in motion with the robots in it; implements the Clock protocol."""

    def __init__(self, world: WorldDiagram, *, seed: int = 0) -> None:
        """Places the robots at their starts at time 0; `seed` gives the noise of their sensors.

        Raises WorldError when a person's route leads through something that is fixed.
        """
        self.world = world
        self._simulator = Simulator(world.diagram)
        self.root_context: Context = self._simulator.get_mutable_context()
        self.context: Context = world.plant.GetMyMutableContextFromRoot(self.root_context)
        for body in world.robots.values():
            body.place(self.context)
        self.work: Counter[str] = Counter()
        sensors = SensorOptions(world.scene_graph, self.context, seed=seed, scene=world.scene, work=self.work)
        self._robots = {name: body.kind.drive(body, sensors) for name, body in world.robots.items()}
        self.walkers = Walkers(world, self.context)
        self._sleepers = Sleepers(world, self.root_context)
        plant = world.plant
        loose = [plant.get_body(index) for model in world.models.values() for index in plant.GetBodyIndices(model)]
        self._carried = CarriedObjects(plant, self.context, loose)
        self._hands = {name: robot.hand for name, robot in world.robots.items()}
        self.receivers = Receivers(world, self.context)
        self._events: list[tuple[float, str]] = []
        self.doors = Doors(plant, self.context, world.config.doors, self._outlines_W, self.record_event)
        self.moves: Moves | None = None
        self._steps = 0
        self._observers: list[tuple[int, Callable[[float], None]]] = []
        self._after_advance: list[Callable[[], None]] = []
        self._command_robots()
        self._simulator.Initialize()

    @property
    def robots(self) -> Mapping[str, Robot]:
        """The robots by name."""
        return self._robots

    @property
    def events(self) -> Sequence[tuple[float, str]]:
        """Events of doors and moved objects: the time (s) and a sentence for each."""
        return self._events

    @property
    def asleep(self) -> frozenset[str]:
        """Names of the sleeping loose objects, which stay where they are."""
        return self._sleepers.asleep

    def observe(self, observer: Callable[[float], None], *, every: int = 1) -> None:
        """Calls `observer(now_s)` after every step, or after `every` steps."""
        self._observers.append((every, observer))

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self._steps * TIME_STEP_S

    def advance(self, dt_s: float) -> None:
        """Steps the plant by dt_s, rounded to whole steps (at least one), and takes readings."""
        self.step(dt_s)
        self.sense()

    def step(self, dt_s: float) -> None:
        """Steps the plant by dt_s, rounded to whole steps (at least one); the robots' readings stay as they are."""
        holding = [name for name, robot in self._robots.items() if robot.gripper().holding]
        until = self._steps + max(1, round(dt_s / TIME_STEP_S))
        while self._steps < until:
            if self._steps % SLEEP_PERIOD_STEPS == 0:
                self._sleepers.update(self.now())
            if self._steps % CONTROL_STEPS == 0:
                self._command_robots()
            self._before_step(0, holding)
            steps = min(CONTROL_STEPS - self._steps % CONTROL_STEPS, until - self._steps)
            if steps > 1 and self._only_robots_move(holding):
                for later in range(1, steps):
                    self._before_step(later, holding)
            else:
                steps = 1
            self._do_steps(steps, holding)

    def _before_step(self, later: int, holding: Sequence[str]) -> None:
        """Moves people, doors and objects before the next step, or before a `later` one."""
        now_s = (self._steps + later) * TIME_STEP_S
        self.walkers.before_step(TIME_STEP_S, standing=self.receivers.busy)
        self.receivers.before_step(now_s, TIME_STEP_S, holding)
        self.doors.before_step(now_s, TIME_STEP_S)
        if self.moves is not None:
            self.moves.before_step(now_s, self._hands_W, holding)

    def _only_robots_move(self, holding: Sequence[str]) -> bool:
        """Returns whether only robots move, so that all steps of one control period can be done at once."""
        observed = any(every % CONTROL_STEPS for every, _ in self._observers)
        still = self.walkers.still and self.doors.still and self.moves is None and not self.receivers.busy
        return still and not observed and not holding and self._sleepers.all_asleep

    def _do_steps(self, steps: int, holding: Sequence[str]) -> None:
        """Advances the plant by some steps at once, corrects loose objects, and calls the observers."""
        self._steps += steps
        self._simulator.AdvanceTo(self.now(), interruptible=False)  # a check for signals would wait for the GIL
        if not self._sleepers.all_asleep:
            self._carried.limit_spin()
        for name in holding:
            self._carried.after_step(self._hands[name], TIME_STEP_S)
        self.work["plant_steps"] += steps
        for every, observer in self._observers:
            if self._steps % every == 0:
                observer(self.now())

    def sense(self) -> None:
        """Takes the readings of all robots and calls the listeners of `after_advance`."""
        for robot in self._robots.values():
            robot.sense(self.now())
        for listener in self._after_advance:
            listener()

    def after_advance(self, listener: Callable[[], None]) -> None:
        """Calls `listener` after each advance, once all robots have sensed."""
        self._after_advance.append(listener)

    def world_state(self) -> Mapping[str, FloatArray]:
        """Discrete state of the Diagram by group: positions and velocities of everything that moves."""
        groups = range(self.root_context.num_discrete_state_groups())
        return {str(group): self.root_context.get_discrete_state(group).value() for group in groups}

    def state(self) -> State:
        """Returns the time and the saved state of robots, people, doors and moves."""
        robots = {name: robot.state() for name, robot in self._robots.items()}
        return {**super().state(), "robots": robots, "moves": None if self.moves is None else self.moves.state()}

    def resume(self, state: State, world: Mapping[str, FloatArray]) -> None:
        """Restores a state, and powers the robots up in it. Raises ValueError when it is of another Diagram."""
        if set(world) != set(self.world_state()):
            raise ValueError("the world has other parts")
        self._sleepers.wake_all()
        self.restore(state)
        self.root_context.SetTime(self.now())
        for group, values in world.items():
            self.root_context.get_mutable_discrete_state(int(group)).SetFromVector(values)
        if self.moves is not None and state["moves"] is not None:
            self.moves.restore(state["moves"])
        for name, robot in self._robots.items():
            robot.restore(state["robots"][name])
            robot.power_up(self.now())
        self._command_robots()
        self._simulator.Initialize()

    def record_event(self, sentence: str) -> None:
        """Records a sentence about an event that happens now."""
        self._events.append((round(self.now(), 6), sentence))

    def _hands_W(self) -> Mapping[str, FloatArray]:
        poses = {name: self.world.plant.EvalBodyPoseInWorld(self.context, hand) for name, hand in self._hands.items()}
        return {name: np.array(X_WH.translation()) for name, X_WH in poses.items()}

    def _outlines_W(self) -> Iterator[FloatArray]:
        """Outlines (K, 2) of robots, their hands and walking people, from above."""
        for robot in self.world.robots.values():
            yield robot.outline_W(self.context)
        yield from (p_W[:2] + HAND_OUTLINE_M for p_W in self._hands_W().values())
        yield from (np.array(place_W) + PERSON_OUTLINE_M for place_W in self.walkers.places_W())

    def _command_robots(self) -> None:
        for robot in self._robots.values():
            robot.control(self.now(), CONTROL_STEPS * TIME_STEP_S)
