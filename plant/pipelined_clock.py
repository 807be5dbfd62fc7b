"""Pipelined stepping: the plant steps towards the next tick while the present tick is computed.

A command of a tick begins when the step under way is done: one period late, as over a radio link. Readings are those of
the tick's beginning. The same calls give the same run, whether a thread does the steps or `advance` itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np

from plant.engine import Engine
from plant.robots.command_table import CommandStatuses
from plant.robots.servos import arm_set_point
from skills.robot import ArmTrajectory, CommandId, CommandState, CommandStatus, Lease, Robot

Background = Callable[[Callable[[], None]], "Future[None]"]
"""Begins work in the background."""

_EXACT_S, _LEAST_S = 1e-9, 1e-6
_BEGIN_LATER = frozenset({"drive", "stand", "sit", "point_head", "set_gripper"})


class Pipeline:
    """Clock of an engine that steps ahead, with its robots; implements the Clock protocol."""

    def __init__(self, engine: Engine, background: Background | None = None) -> None:
        """`background` does the steps while the ticks are computed; without it `advance` does them."""
        self._engine, self._background = engine, background or _at_once
        self._robots = {name: PipelinedRobot(robot, self) for name, robot in engine.robots.items()}
        self._now_s: float | None = None
        self._under_way: Future[None] | None = None

    @property
    def robots(self) -> Mapping[str, Robot]:
        """The robots by name."""
        return self._robots

    @property
    def events(self) -> Sequence[tuple[float, str]]:
        """Events of doors and moved objects until now: the time (s) and a sentence for each."""
        return [(time_s, sentence) for time_s, sentence in self._engine.events if time_s <= self.now() + _EXACT_S]

    def now(self) -> float:
        """Simulated seconds since the start, as of the last readings."""
        return self._engine.now() if self._now_s is None else self._now_s

    def advance(self, dt_s: float) -> None:
        """Advances by dt_s: waits for the step under way, takes readings, begins commands and starts the next step.

        Raises the exception of the step under way. Raises ValueError when that step is longer than dt_s.
        """
        until_s = self.now() + dt_s
        self.settle()
        left_s = until_s - self._engine.now()
        if left_s < -dt_s / 2.0:
            raise ValueError(f"the plant has stepped to {self._engine.now():.3f} s, beyond {until_s:.3f} s")
        if left_s > dt_s / 2.0:
            self._engine.step(left_s)
        self._engine.sense()
        self._now_s = self._engine.now()
        for robot in self._robots.values():
            robot.begin_commands()
        self._under_way = self._background(partial(self._engine.step, dt_s))

    def reached_s(self) -> float:
        """Time (s) that the plant has reached; call it while no step is under way."""
        return self._engine.now()

    def settle(self) -> None:
        """Waits until no step is under way. Raises the exception of that step."""
        under_way, self._under_way = self._under_way, None
        if under_way is not None:
            under_way.result()


class PipelinedRobot:
    """A robot whose commands begin when the step under way is done, and count as running until then.

    Verbs of the lease wait for that step, because they are answered at once. The time of an arm's trajectory counts
    from its command: the arm begins at the point that it should have reached by then.
    """

    def __init__(self, robot: Robot, pipeline: Pipeline) -> None:
        self._robot, self._pipeline = robot, pipeline
        self._statuses = CommandStatuses()
        self._commanded: list[tuple[CommandId, Callable[[], CommandId]]] = []
        self._running: dict[CommandId, CommandId] = {}  # by the ids given here, those of the robot

    def begin_commands(self) -> None:
        """Passes the waiting commands to the robot; no step may be under way."""
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
        """Returns the robot, once no step is under way and its waiting commands have begun."""
        self._pipeline.settle()
        self.begin_commands()
        return self._robot

    def __getattr__(self, verb: str) -> Any:
        """Returns a verb of the robot; a verb that moves the robot begins later."""
        value = getattr(self._robot, verb)
        if verb in _BEGIN_LATER:
            value = partial(self._begin_later, value)
        self.__dict__[verb] = value
        return value

    def _begin_later(self, verb: Callable[..., CommandId], *given: Any, **named: Any) -> CommandId:
        return self._later(partial(verb, *given, **named))

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when its end is reached and the arm is still."""
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
        """Returns the status of a command as of the last readings. Raises KeyError for an unknown id."""
        return self._statuses.status(command)

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""
        return self._settled().acquire_lease(holder)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder; the robot stops."""
        return self._settled().take_lease(holder)

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. A lease that no longer counts is ignored."""
        self._settled().return_lease(lease)


def _remaining(trajectory: ArmTrajectory, late_s: float) -> ArmTrajectory:
    """Rest of a trajectory that begins late_s after its command, from the point that the arm should have reached."""
    left_s = trajectory.times_s - late_s
    ahead = left_s > _LEAST_S
    here, _ = arm_set_point(trajectory, late_s)
    return ArmTrajectory(np.concatenate([[0.0], left_s[ahead]]), np.vstack([here, trajectory.positions_rad[ahead]]))


def _at_once(work: Callable[[], None]) -> Future[None]:
    """Does the work in the caller's thread."""
    done: Future[None] = Future()
    try:
        work()
    except Exception as error:
        done.set_exception(error)
    else:
        done.set_result(None)
    return done
