"""The engine: steps the Diagram, applies commands and samples sensors for the robots, and is the only clock.

In a pipeline, the plant steps towards the next tick while the executive computes the present tick. A tick's command
takes effect at the end of the current step: one period late, as over a radio link. Measurements are those of the tick's
start. The same calls give the same run, whether or not a thread does the steps.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from functools import partial
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from plant.diagram import TIME_STEP_S, WorldDiagram
from plant.events import Doors, Moves
from plant.loose_objects import CarriedObjects, Sleepers
from plant.people.receivers import Receivers
from plant.people.walkers import Walkers
from plant.robots.robot_kind import SensorOptions
from plant.robots.servos import arm_set_point
from plant.saved_state import State, Stateful
from skills.command_table import CommandStatuses
from skills.robot import ArmTrajectory, CommandId, CommandState, CommandStatus, FloatArray, Lease, Robot
from skills.robot_wrapper import RobotWrapper

CONTROL_STEPS = 2
SLEEP_PERIOD_STEPS = 4
_SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
HAND_OUTLINE_M = 0.15 * _SQUARE
"""Outline (4, 2) of a hand about its centre, for which doors wait."""
PERSON_OUTLINE_M = 0.25 * _SQUARE


class Engine(Stateful, saved=("_steps", "walkers", "receivers", "doors")):
    """A Diagram in motion with the robots in it; implements the Clock protocol."""

    def __init__(self, world: WorldDiagram, *, seed: int = 0) -> None:
        """Places the robots at their starts at time 0; `seed` determines the noise of their sensors.

        Raises WorldError when a person's route leads through a fixed shape.
        """
        self.world = world
        self._simulator = Simulator(world.diagram)
        self.root_context: Context = self._simulator.get_mutable_context()
        self.context: Context = world.plant.GetMyMutableContextFromRoot(self.root_context)
        for body in world.robots.values():
            body.place(self.context)
        self.work: Counter[str] = Counter()
        sensors = SensorOptions(world.scene_graph, self.context, seed=seed, scene=world.scene, work=self.work)
        self.robots = {name: body.kind.drive(body, sensors) for name, body in world.robots.items()}
        self.words: list[tuple[float, str, str]] = []
        """Words of people to a robot near them: the time (s), the person's name and the words."""
        self.walkers = Walkers(world, self.context, self._record_words)
        self._sleepers = Sleepers(world, self.root_context)
        plant = world.plant
        loose = [plant.get_body(index) for model in world.models.values() for index in plant.GetBodyIndices(model)]
        self._carried = CarriedObjects(plant, self.context, loose)
        self._hands = {name: robot.hand for name, robot in world.robots.items()}
        self.receivers = Receivers(world, self.context)
        self.events: list[tuple[float, str]] = []
        """Events of doors and moved objects: the time (s) and a sentence for each."""
        self.doors = Doors(plant, self.context, world.config.doors, self._outlines_W, self.record_event)
        self.moves: Moves | None = None
        self._steps = 0
        self._observers: list[tuple[int, Callable[[float], None]]] = []
        self._after_advance: list[Callable[[], None]] = []
        self._command_robots()
        self._simulator.Initialize()

    @property
    def asleep(self) -> frozenset[str]:
        """Names of the sleeping loose objects, which do not move."""
        return self._sleepers.asleep

    def observe(self, observer: Callable[[float], None], *, every: int = CONTROL_STEPS) -> None:
        """Calls `observer(now_s)` after `every` steps, a multiple of `CONTROL_STEPS`."""
        self._observers.append((every, observer))

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self._steps * TIME_STEP_S

    def advance(self, dt_s: float) -> None:
        """Steps the plant by dt_s, rounded to whole steps (at least one), and updates the sensors."""
        self.step(dt_s)
        self.sense()

    def step(self, dt_s: float) -> None:
        """Steps the plant by dt_s, rounded to whole steps (at least one), without updating the sensors."""
        holding = [name for name, robot in self.robots.items() if robot.gripper().holding]
        until = self._steps + max(1, round(dt_s / TIME_STEP_S))
        while self._steps < until:
            if self._steps % SLEEP_PERIOD_STEPS == 0:
                self._sleepers.update(self.now())
            if self._steps % CONTROL_STEPS == 0:
                self._command_robots()
            self._before_step(holding)
            left = min(CONTROL_STEPS - self._steps % CONTROL_STEPS, until - self._steps)
            self._do_steps(left if self._only_robots_move() else 1, holding)

    def _before_step(self, holding: Sequence[str]) -> None:
        """Moves people, doors and objects before the next step."""
        now_s = self.now()
        self.walkers.before_step(TIME_STEP_S, self.receivers.busy, self.doors.barriers)
        self.receivers.before_step(now_s, TIME_STEP_S, holding)
        self.doors.before_step(now_s, TIME_STEP_S)
        if self.moves is not None:
            self.moves.before_step(now_s, self._hands_W, holding)

    def _only_robots_move(self) -> bool:
        """Returns whether only robots and what they carry move; then one call does all steps of a control period."""
        still = self.walkers.still and self.doors.still and self.moves is None and self.receivers.still
        return still and (self._sleepers.all_asleep or self._carried.calm)

    def _do_steps(self, steps: int, holding: Sequence[str]) -> None:
        """Advances the plant by `steps` steps at once, corrects loose objects, and calls the observers."""
        self._steps += steps
        self._simulator.AdvanceTo(self.now(), interruptible=False)  # a check for signals would wait for the GIL
        if not self._sleepers.all_asleep:
            self._carried.limit_motion()
        for name in holding:
            self._carried.after_steps(self._hands[name], TIME_STEP_S, steps)
        self.work["plant_steps"] += steps
        for every, observer in self._observers:
            if self._steps % every == 0:
                observer(self.now())

    def sense(self) -> None:
        """Updates the sensors of all robots and calls the listeners of `after_advance`."""
        for robot in self.robots.values():
            robot.sense(self.now())
        for listener in self._after_advance:
            listener()

    def after_advance(self, listener: Callable[[], None]) -> None:
        """Calls `listener` after each advance, once the sensors of all robots are updated."""
        self._after_advance.append(listener)

    def poses_W(self) -> Mapping[str, RigidTransform]:
        """True poses X_WB of the robots, for the log and the referee; no robot may ask."""
        return {name: robot.body.EvalPoseInWorld(self.context) for name, robot in self.world.robots.items()}

    def world_state(self) -> Mapping[str, FloatArray]:
        """Discrete state of the Diagram by group: positions and velocities of everything that moves."""
        groups = range(self.root_context.num_discrete_state_groups())
        return {str(group): self.root_context.get_discrete_state(group).value() for group in groups}

    def state(self) -> State:
        """Returns the time and the saved state of robots, people, doors and moves."""
        robots = {name: robot.state() for name, robot in self.robots.items()}
        return {**super().state(), "robots": robots, "moves": None if self.moves is None else self.moves.state()}

    def resume(self, state: State, world: Mapping[str, FloatArray]) -> None:
        """Restores a state, and powers the robots up in it. Raises ValueError when it belongs to another Diagram."""
        if set(world) != set(self.world_state()):
            raise ValueError("the world has other parts")
        self._sleepers.wake_all()
        self.restore(state)
        self.root_context.SetTime(self.now())
        for group, values in world.items():
            self.root_context.get_mutable_discrete_state(int(group)).SetFromVector(values)
        if self.moves is not None and state["moves"] is not None:
            self.moves.restore(state["moves"])
        for name, robot in self.robots.items():
            robot.restore(state["robots"][name])
            robot.power_up(self.now())
        self._command_robots()
        self._simulator.Initialize()

    def _record_words(self, person: str, words: str) -> None:
        self.words.append((round(self.now(), 6), person, words))
        self.record_event(f'{person} says "{words}"')

    def record_event(self, sentence: str) -> None:
        """Records a sentence about an event that happens now."""
        self.events.append((round(self.now(), 6), sentence))

    def _hands_W(self) -> Mapping[str, FloatArray]:
        poses = {name: self.world.plant.EvalBodyPoseInWorld(self.context, hand) for name, hand in self._hands.items()}
        return {name: np.array(X_WH.translation()) for name, X_WH in poses.items()}

    def _outlines_W(self) -> Iterator[FloatArray]:
        """Outlines (K, 2), from above, of robots, their hands and walking people."""
        for robot in self.world.robots.values():
            yield robot.outline_W(self.context)
        yield from (p_W[:2] + HAND_OUTLINE_M for p_W in self._hands_W().values())
        yield from (np.array(place_W) + PERSON_OUTLINE_M for place_W in self.walkers.places_W())

    def _command_robots(self) -> None:
        for robot in self.robots.values():
            robot.control(self.now(), CONTROL_STEPS * TIME_STEP_S)


Background = Callable[[Callable[[], None]], "Future[None]"]
"""Begins work in the background."""

_EXACT_S = 1e-9
"""Rounding of times."""
_LEAST_S = 1e-6
"""Least time after which a trajectory has another point."""


class Pipeline:
    """Clock of an engine that steps ahead of the ticks, with its robots; implements the Clock protocol."""

    def __init__(self, engine: Engine, background: Background | None = None) -> None:
        """`background` does the steps in parallel to the ticks; without it `advance` does them."""
        self._engine, self._background = engine, background or _at_once
        self.robots = {name: PipelinedRobot(robot, self) for name, robot in engine.robots.items()}
        self._now_s: float | None = None
        self.poses_W = engine.poses_W()
        """True poses X_WB of the robots at the time of the last measurements."""
        self._under_way: Future[None] | None = None

    @property
    def words(self) -> Sequence[tuple[float, str, str]]:
        """Words that people have said to a robot near them: the time (s), the person's name and the words."""
        return [each for each in self._engine.words if each[0] <= self.now() + _EXACT_S]

    @property
    def events(self) -> Sequence[tuple[float, str]]:
        """Events of doors and moved objects so far: the time (s) and a sentence for each."""
        return [(time_s, sentence) for time_s, sentence in self._engine.events if time_s <= self.now() + _EXACT_S]

    def now(self) -> float:
        """Simulated seconds since the start, as of the last measurements."""
        return self._engine.now() if self._now_s is None else self._now_s

    def advance(self, dt_s: float) -> None:
        """Advances by dt_s: waits for the current step, updates the sensors, begins commands and starts the next step.

        Raises the exception of the current step, and ValueError when that step is longer than dt_s.
        """
        until_s = self.now() + dt_s
        self.settle()
        left_s = until_s - self._engine.now()
        if left_s < -dt_s / 2.0:
            raise ValueError(f"the plant has stepped to {self._engine.now():.3f} s, beyond {until_s:.3f} s")
        if left_s > dt_s / 2.0:
            self._engine.step(left_s)
        self._engine.sense()
        self._now_s, self.poses_W = self._engine.now(), self._engine.poses_W()
        for robot in self.robots.values():
            robot.begin_commands()
        self._under_way = self._background(partial(self._engine.step, dt_s))

    def reached_s(self) -> float:
        """Time (s) that the plant has reached; call it only between steps."""
        return self._engine.now()

    def settle(self) -> None:
        """Waits until no step is running. Raises the exception of that step."""
        if (under_way := self._under_way) is not None:
            wait([under_way])  # an alarm may interrupt this: the step is still under way then
            self._under_way = None
            under_way.result()


class PipelinedRobot(RobotWrapper):
    """A robot whose commands begin at the end of the current step, and count as running until then.

    Verbs of the lease wait for this step, because they return a result. The time of an arm trajectory counts from its
    command: the arm begins at the trajectory's point for the present time.
    """

    def __init__(self, robot: Robot, pipeline: Pipeline) -> None:
        super().__init__(robot)
        self._pipeline = pipeline
        self._statuses = CommandStatuses()
        self._commanded: list[tuple[CommandId, Callable[[], CommandId]]] = []
        self._running: dict[CommandId, CommandId] = {}  # by the ids given here, those of the robot

    def begin_commands(self) -> None:
        """Passes the queued commands to the robot; no step may be running."""
        for command, begin in self._commanded:
            self._running[command] = begin()
        self._commanded = []
        for command, inner in list(self._running.items()):
            status = self._robot.command_status(inner)
            if status.state is not CommandState.RUNNING:
                self._statuses.change(command, status)
                del self._running[command]

    def _later(self, begin: Callable[[], CommandId]) -> CommandId:
        command = self._statuses.add(CommandStatus(CommandState.RUNNING))
        self._commanded.append((command, begin))
        return command

    def _settled(self) -> Robot:
        """Returns the robot, once no step is running and its queued commands have begun."""
        self._pipeline.settle()
        self.begin_commands()
        return self._robot

    def _command(self, verb: str, call: Callable[..., CommandId], *arguments: Any, **options: Any) -> CommandId:
        """Queues the command."""
        return self._later(partial(call, *arguments, **options))

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when the arm rests at its end."""
        commanded_s = self._pipeline.now()

        def begin() -> CommandId:
            late_s = self._pipeline.reached_s() - commanded_s
            return self._robot.move_arm(_remaining(trajectory, late_s), until_s=until_s, lease=lease)

        return self._later(begin)

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the given command if it still runs."""

        def begin() -> CommandId:
            inner = None if only is None else self._running.get(only, CommandId(0))  # 0: that command is over
            return self._robot.stop(lease=lease, only=inner)

        return self._later(begin)

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the status of a command as of the last measurements. Raises KeyError for an unknown id."""
        return self._statuses.status(command)

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""
        return self._settled().acquire_lease(holder)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease away from its holder; the robot stops."""
        return self._settled().take_lease(holder)

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. Ignores a lease that is no longer valid."""
        self._settled().return_lease(lease)


def _remaining(trajectory: ArmTrajectory, late_s: float) -> ArmTrajectory:
    """Rest of a trajectory that begins late_s after its command."""
    left_s = trajectory.times_s - late_s
    ahead = left_s > _LEAST_S
    here, _ = arm_set_point(trajectory, late_s)
    return ArmTrajectory(np.concatenate([[0.0], left_s[ahead]]), np.vstack([here, trajectory.positions_rad[ahead]]))


def _at_once(work: Callable[[], None]) -> Future[None]:
    """Does the work in the caller's thread."""
    done: Future[None] = Future()
    try:
        work()
        done.set_result(None)
    except Exception as error:
        done.set_exception(error)
    return done
