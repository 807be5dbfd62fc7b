"""Skills written as a routine: a generator that yields `Running` and returns `Succeeded`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Generator, Mapping
from typing import Any, TypeVar

from skills.api import Cause, Failed, InputsT, Running, Skill, SkillContext, Step, Succeeded
from skills.robot import ArmTrajectory, CommandId, CommandState

ResultT = TypeVar("ResultT")
OtherT = TypeVar("OtherT")
Routine = Generator[Running, None, ResultT]

ARM_EXPIRY_MARGIN_S = 3.0
GRIPPER_EXPIRY_S = 4.0
STAND_EXPIRY_S = 5.0
HEIGHT_TOLERANCE_M = 0.02


class SkillFailure(Exception):  # noqa: N818 - a failed attempt is no program error
    """Ends a routine: the cause, one plain sentence, and what was learnt for the next attempt (see `Failed`)."""

    def __init__(self, cause: Cause, message: str, outputs: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.cause = cause
        self.message = message
        self.outputs: Mapping[str, Any] = outputs or {}


class PlanningError(Exception):
    """No way was found; the message is one plain sentence."""


class RoutineSkill(Skill[InputsT]):
    """A skill whose attempt is one generator, `run`. Commands given through it are stopped by `end`."""

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._routine: Routine[Succeeded] | None = None
        self._commands: list[CommandId] = []

    @abstractmethod
    def run(self, inputs: InputsT) -> Routine[Succeeded]:
        """One attempt. Raises SkillFailure."""

    def begin(self, inputs: InputsT) -> None:
        """Forget an earlier attempt and prepare a new one."""
        self.end()
        self._routine = self.run(inputs)

    def run_again(self, inputs: InputsT) -> Routine[Succeeded]:
        """Go on from an attempt that was broken off; looks first what is done already. Raises SkillFailure."""
        return self.run(inputs)

    def resume(self, inputs: InputsT) -> None:
        """Go on after a pause or a restart."""
        self.end()
        self._routine = self.run_again(inputs)

    def step(self) -> Step:
        """Go on to the routine's next yield. Raises RuntimeError before `begin`."""
        if self._routine is None:
            raise RuntimeError(f"skill {self.name}: step before begin")
        try:
            return next(self._routine)
        except StopIteration as finished:
            assert isinstance(finished.value, Succeeded)
            return finished.value
        except SkillFailure as failure:
            return Failed(failure.cause, failure.message, failure.outputs)

    def end(self) -> None:
        """Drop the routine and stop its commands that still run."""
        if self._routine is not None:
            self._routine.close()
        self._routine = None
        for command in self._commands:
            if self.context.robot.command_status(command).state is CommandState.RUNNING:
                self.context.robot.stop(lease=self.context.lease, only=command)
        self._commands = []

    def issue(self, command: CommandId) -> CommandId:
        """Remember a command as this attempt's own."""
        self._commands.append(command)
        return command

    def compute(self, work: Callable[[], ResultT], *, latency_s: float, name: str, message: str) -> Routine[ResultT]:
        """Let the Worker do `work`. A PlanningError becomes a SkillFailure with cause PLANNING."""
        job = self.context.worker.submit(work, latency_s=latency_s, name=name)
        while not job.done():
            yield Running(message)
        try:
            return job.result()
        except PlanningError as error:
            raise SkillFailure(Cause.PLANNING, str(error)) from error

    def follow(self, trajectory: ArmTrajectory, message: str) -> Routine[None]:
        """Move the arm along a trajectory. Raises SkillFailure with cause EXECUTION when it does not get there."""
        context = self.context
        until_s = context.clock.now() + float(trajectory.times_s[-1]) + ARM_EXPIRY_MARGIN_S
        command = context.robot.move_arm(trajectory, until_s=until_s, lease=context.lease)
        yield from self.finish(self.issue(command), message, "the arm")

    def move_gripper(self, opening_rad: float, force_n: float, message: str) -> Routine[None]:
        """Move the jaw with limited force. Raises SkillFailure with cause EXECUTION when it does not finish."""
        context = self.context
        until_s = context.clock.now() + GRIPPER_EXPIRY_S
        command = context.robot.set_gripper(opening_rad, force_n, until_s=until_s, lease=context.lease)
        yield from self.finish(self.issue(command), message, "the gripper")

    def stand_at(self, height_m: float, message: str) -> Routine[None]:
        """Bring the body to a height, level; nothing is done where it is there already."""
        context = self.context
        if abs(float(context.robot.odometry().X_OB.translation()[2]) - height_m) > HEIGHT_TOLERANCE_M:
            until_s = context.clock.now() + STAND_EXPIRY_S
            command = context.robot.stand(height_m, 0.0, until_s=until_s, lease=context.lease)
            yield from self.finish(self.issue(command), message, "the body")

    def perform(self, skill: Skill[OtherT], inputs: OtherT) -> Routine[Succeeded]:
        """Let another skill do its work as part of this one. Raises SkillFailure with its cause and message."""
        skill.begin(inputs)
        try:
            while isinstance(step := skill.step(), Running):
                yield step
        finally:
            skill.end()
        if isinstance(step, Failed):
            raise SkillFailure(step.cause, step.message)
        return step

    def finish(self, command: CommandId, message: str, what: str) -> Routine[None]:
        """Wait until a command is done. Raises SkillFailure with cause EXECUTION when it was stopped or refused."""
        while (status := self.context.robot.command_status(command)).state is CommandState.RUNNING:
            yield Running(message)
        if status.state is not CommandState.DONE:
            why = f": {status.reason}" if status.reason else ""
            raise SkillFailure(Cause.EXECUTION, f"{what} was {status.state.value} while {message}{why}")

    def pause(self, duration_s: float, message: str) -> Routine[None]:
        """Wait on the robot's clock."""
        end_s = self.context.clock.now() + duration_s
        while self.context.clock.now() < end_s:
            yield Running(message)
