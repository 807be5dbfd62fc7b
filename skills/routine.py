"""Skills written as a routine: a generator that yields `Running` and returns `Succeeded`."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from skills.api import Cause, Failed, InputsT, Job, PlanningError, Running, Skill, SkillContext, Step, Succeeded
from skills.geometry import wrap
from skills.patience import Patience
from skills.robot import ArmTrajectory, Clock, CommandId, CommandState, FloatArray, NoImageError, Pose2D

ResultT = TypeVar("ResultT")
OtherT = TypeVar("OtherT")
Routine = Generator[Running, None, ResultT]

ARM_EXPIRY_MARGIN_S = 3.0
GRIPPER_EXPIRY_S = 4.0
STAND_EXPIRY_S = 6.0
HEIGHT_TOLERANCE_M = 0.02
_PAUSE_S = 10.0
_STAYED_M = 0.15
_STAYED_RAD = 0.2
_RESTART_RAD_S = 0.8
_LEAST_S = 0.05
_AGAIN_S = 0.4
"""What was refused, stopped or lost is given again so much later."""
_OLD_S = 0.45
"""Readings of the arm that are older are not gone by."""
_LOST_S = 0.5
"""A command that is still under way so long after its expiry is lost."""
_OFF_PATH_RAD = 0.2
"""An arm that is farther than this from a trajectory does not go on with it."""


class SkillFailure(Exception):  # noqa: N818 - a failed attempt is no program error
    """Ends a routine: the cause, one plain sentence, what was learnt, and whether it is final (see `Failed`)."""

    def __init__(
        self, cause: Cause, message: str, outputs: Mapping[str, Any] | None = None, *, final: bool = False
    ) -> None:
        super().__init__(message)
        self.cause = cause
        self.message = message
        self.outputs: Mapping[str, Any] = outputs or {}
        self.final = final


class OffPathError(Exception):
    """The arm is not where a motion that was broken off can go on."""


class CommandFailure(SkillFailure):
    """A command was refused, stopped or lost; cause EXECUTION. It may go well when it is given again."""

    def __init__(self, message: str) -> None:
        super().__init__(Cause.EXECUTION, message)


@dataclass(frozen=True)
class _Stance:
    """How the robot was when its routine was suspended."""

    since_s: float
    pose: Pose2D
    arm_rad: FloatArray
    holding: bool


class RoutineSkill(Skill[InputsT]):
    """A skill whose attempt is one generator, `run`. Commands given through it are stopped by `end`.

    After a short pause in which the robot stayed as it was, the routine goes on where it was, and the motion that was
    stopped is taken up; else `run_again` looks what is done already.
    """

    def __init__(self, context: SkillContext, options: Any = None) -> None:
        super().__init__(context, options)
        self._routine: Routine[Succeeded] | None = None
        self._commands: list[CommandId] = []
        self._interrupted: set[CommandId] = set()
        self._inner: Callable[[], None] | None = None
        self._inner_skill: Skill[Any] | None = None
        self._stance: _Stance | None = None

    @abstractmethod
    def run(self, inputs: InputsT) -> Routine[Succeeded]:
        """One attempt. Raises SkillFailure."""

    def begin(self, inputs: InputsT) -> None:
        """Forgets an earlier attempt and prepares a new one."""
        self.end()
        self._routine = self.run(inputs)

    def run_again(self, inputs: InputsT) -> Routine[Succeeded]:
        """Goes on from an attempt that was broken off; looks first what is done already. Raises SkillFailure."""
        return self.run(inputs)

    def suspend(self) -> None:
        """Stops the motion under way; what was found out and planned so far is kept."""
        if self._routine is None:
            return
        self._stance = self._stance_now()
        if self._inner_skill is not None:
            self._inner_skill.suspend()
        self._stop_commands()
        stopped = (one for one in self._commands if self._state(one) is CommandState.STOPPED)
        self._interrupted |= set(stopped)

    def resume(self, inputs: InputsT) -> None:
        """Goes on after a pause or a restart."""
        if self.can_go_on():
            self._stance = None
            if self._inner is not None:
                self._inner()
            return
        self.end()
        self._routine = self.run_again(inputs)

    def can_go_on(self) -> bool:
        """Whether the routine was suspended not long ago, body and arm are where they were, and nothing was lost."""
        before = self._stance
        if self._routine is None or before is None:
            return False
        now = self._stance_now()
        moved_m = math.hypot(now.pose.x_m - before.pose.x_m, now.pose.y_m - before.pose.y_m)
        turn = now.pose.yaw_rad - before.pose.yaw_rad
        still = moved_m < _STAYED_M and abs(wrap(turn)) < _STAYED_RAD
        arm_off = float(np.max(np.abs(now.arm_rad - before.arm_rad), initial=0.0))
        fresh = now.since_s - before.since_s < _PAUSE_S
        return fresh and still and arm_off < _STAYED_RAD and (now.holding or not before.holding)

    def _stance_now(self) -> _Stance:
        robot = self.context.robot
        arm, gripper = robot.capabilities().arm, robot.capabilities().gripper
        positions = {} if arm is None else robot.joints().position_rad
        q = np.array([positions[name] for name in (() if arm is None else arm.joint_names)], dtype=np.float64)
        return _Stance(
            self.context.clock.now(), robot.odometry().pose, q, gripper is not None and robot.gripper().holding
        )

    def trouble(self) -> SkillFailure | None:
        """What the routine must learn of at once, asked for before each step: it is raised where the routine waits."""
        return None

    def step(self) -> Step:
        """Goes on to the routine's next yield. Raises RuntimeError before `begin`."""
        if self._routine is None:
            raise RuntimeError(f"skill {self.name}: step before begin")
        trouble = self.trouble()
        try:
            return next(self._routine) if trouble is None else self._routine.throw(trouble)
        except StopIteration as finished:
            assert isinstance(finished.value, Succeeded)
            return finished.value
        except SkillFailure as failure:
            return Failed(failure.cause, failure.message, failure.outputs, failure.final)

    def end(self) -> None:
        """Drops the routine and stops its commands that still run."""
        if self._routine is not None:
            self._routine.close()
        self._routine = self._stance = None
        self._stop_commands()
        self._commands, self._interrupted = [], set()

    def _stop_commands(self) -> None:
        """Stops this attempt's commands that still run."""
        for command in self._commands:
            if self._state(command) is CommandState.RUNNING:
                self.context.robot.stop(lease=self.context.lease, only=command)

    def _state(self, command: CommandId) -> CommandState:
        return self.context.robot.command_status(command).state

    def issue(self, command: CommandId) -> CommandId:
        """Remember a command as this attempt's own."""
        self._commands.append(command)
        return command

    def compute(self, work: Callable[[], ResultT], *, latency_s: float, name: str, message: str) -> Routine[ResultT]:
        """Lets the Worker do `work`. A PlanningError becomes a SkillFailure with cause PLANNING."""
        return (yield from self._awaited(self.context.worker.submit(work, latency_s=latency_s, name=name), message))

    def _awaited(self, job: Job[ResultT], message: str) -> Routine[ResultT]:
        """A job's result; a routine that is left before waits until the job no longer uses what it was given."""
        try:
            while not job.done():
                yield Running(message)
            return job.result()
        except PlanningError as error:
            raise SkillFailure(Cause.PLANNING, str(error), error.outputs) from error
        finally:
            job.withdraw()

    def sense(self, read: Callable[[], ResultT], *, latency_s: float, name: str, message: str) -> Routine[ResultT]:
        """What `read` gives, which may block; while it raises NoImageError it is called again, as patience lasts.

        Raises SkillFailure with cause EXECUTION: a camera gives no picture.
        """
        patience = Patience(self.context.clock)
        while True:
            job = self.context.worker.sense(read, lambda given: given, latency_s=latency_s, name=name)
            try:
                return (yield from self._awaited(job, message))
            except NoImageError as error:
                if not patience.is_left():
                    raise SkillFailure(Cause.EXECUTION, str(error)) from error
                yield from self.pause(_AGAIN_S, f"{error}; {message}")

    def feel_arm(self, message: str) -> Routine[None]:
        """Wait, as patience lasts, until the readings of the arm's joints and of the gripper are new enough to go by.

        What stays old afterwards is left to the limit on the age of data on which a success rests.
        """
        robot, clock, patience = self.context.robot, self.context.clock, Patience(self.context.clock)
        while min(robot.joints().stamp_s, robot.gripper().stamp_s) < clock.now() - _OLD_S and patience.is_left():
            yield Running(f"{message}; waits for a reading of the arm")

    def follow(
        self, trajectory: ArmTrajectory, message: str, guard: Callable[[FloatArray], bool] | None = None
    ) -> Routine[bool]:
        """Moves the arm along a trajectory; whether `guard` stopped it before its end.

        `guard` is asked at each tick with the joint angles that the arm should have then. After a command that was
        stopped or lost the arm goes on from where it is. Raises SkillFailure with cause EXECUTION when the arm does
        not get there.
        """
        context, begun_s = self.context, -math.inf

        def attempt() -> Routine[bool]:
            nonlocal trajectory, begun_s
            if begun_s > -math.inf:
                trajectory = self._left_of(trajectory, context.clock.now() - begun_s)
            while True:
                begun_s = context.clock.now()
                until_s = begun_s + float(trajectory.times_s[-1]) + ARM_EXPIRY_MARGIN_S
                command = self.issue(context.robot.move_arm(trajectory, until_s=until_s, lease=context.lease))
                guarded = None if guard is None else partial(_meets, guard, trajectory, context.clock, begun_s)
                stopped_s = yield from self.finish(command, message, "the arm", guarded, until_s=until_s)
                if stopped_s is None or (guard is not None and command not in self._interrupted):
                    return stopped_s is not None
                trajectory = rest_of(trajectory, stopped_s - begun_s, self._stance_now().arm_rad)

        return (yield from self.persist(attempt, message))

    def _left_of(self, trajectory: ArmTrajectory, elapsed_s: float) -> ArmTrajectory:
        """What is left of a trajectory after a command that went wrong, from where the arm is by now.

        Raises OffPathError: the arm is not on it.
        """
        q_rad = self._stance_now().arm_rad
        passed_s, off_rad = passed(trajectory, elapsed_s, q_rad)
        if off_rad > _OFF_PATH_RAD:
            raise OffPathError
        return rest_of(trajectory, passed_s, q_rad)

    def persist(self, attempt: Callable[[], Routine[ResultT]], message: str) -> Routine[ResultT]:
        """What an attempt gives; one whose command is refused, stopped or lost is made again while patience lasts.

        Patience begins with the first of them. Raises SkillFailure.
        """
        patience, before = Patience(self.context.clock), SkillFailure(Cause.EXECUTION, message)
        while True:
            try:
                return (yield from attempt())
            except OffPathError as off:
                raise before from off
            except CommandFailure as failure:
                if not patience.is_left() or self.context.robot.lease_holder() != self.context.lease:
                    raise
                before = failure
                yield from self.pause(_AGAIN_S, f"{failure.message}; {message} again")

    def move_gripper(self, opening: float, force_n: float, message: str) -> Routine[None]:
        """Moves the gripper with limited force. Raises SkillFailure with cause EXECUTION when it does not finish."""

        def attempt() -> Routine[None]:
            stopped_s: float | None = 0.0
            while stopped_s is not None:
                until_s = self.context.clock.now() + GRIPPER_EXPIRY_S
                command = self.issue(self.gripper_command(opening, force_n))
                stopped_s = yield from self.finish(command, message, "the gripper", until_s=until_s)

        yield from self.persist(attempt, message)

    def gripper_command(self, opening: float, force_n: float) -> CommandId:
        """Gives the gripper its command, and do not wait for it."""
        context = self.context
        if opening > context.robot.gripper().opening:
            context.payload.corners_H = context.payload.R_BH = context.payload.kind = None
        until_s = context.clock.now() + GRIPPER_EXPIRY_S
        return context.robot.set_gripper(opening, force_n, until_s=until_s, lease=context.lease)

    def stand_at(self, height_m: float, message: str) -> Routine[None]:
        """Brings the body to a height, level; nothing is done where it is there already.

        Raises SkillFailure with cause EXECUTION when the body does not get there.
        """
        context = self.context

        def attempt() -> Routine[None]:
            while abs(float(context.robot.odometry().X_OB.translation()[2]) - height_m) > HEIGHT_TOLERANCE_M:
                until_s = context.clock.now() + STAND_EXPIRY_S
                command = self.issue(context.robot.stand(height_m, 0.0, until_s=until_s, lease=context.lease))
                if (yield from self.finish(command, message, "the body", until_s=until_s)) is None:
                    return

        yield from self.persist(attempt, message)

    def perform(self, skill: Skill[OtherT], inputs: OtherT) -> Routine[Succeeded]:
        """Lets another skill do its work as part of this one. Raises SkillFailure with its cause and message."""
        skill.begin(inputs)
        self._inner_skill, self._inner = skill, lambda: skill.resume(inputs)
        try:
            while isinstance(step := skill.step(), Running):
                yield step
        finally:
            self._inner_skill = self._inner = None
            skill.end()
        if isinstance(step, Failed):
            raise SkillFailure(step.cause, step.message)
        return step

    def finish(
        self,
        command: CommandId,
        message: str,
        what: str,
        enough: Callable[[], bool] | None = None,
        *,
        until_s: float,
    ) -> Routine[float | None]:
        """Waits until a command is done, and gives None; or, when a pause stopped it, the time (s) of its last tick.

        Once `enough` holds the command is stopped, and the time is given as well. Raises SkillFailure with cause
        EXECUTION when it expired at `until_s`; CommandFailure when it was stopped otherwise, was refused, or is lost:
        a robot ends what has expired.
        """
        last_s = self.context.clock.now()
        while (status := self.context.robot.command_status(command)).state is CommandState.RUNNING:
            last_s = self.context.clock.now()
            if enough is not None and enough():
                self.context.robot.stop(lease=self.context.lease, only=command)
                return last_s
            if last_s > until_s + _LOST_S and command not in self._interrupted:
                self.context.robot.stop(lease=self.context.lease, only=command)
                raise CommandFailure(f"{what} did not answer while {message}")
            yield Running(message)
        if status.state is CommandState.DONE:
            return None
        if command in self._interrupted:
            return last_s
        why = f": {status.reason}" if status.reason else ""
        told = f"{what} was {status.state.value} while {message}{why}"
        if status.state is CommandState.STOPPED and self.context.clock.now() >= until_s:
            raise SkillFailure(Cause.EXECUTION, told)
        raise CommandFailure(told)

    def pause(self, duration_s: float, message: str) -> Routine[None]:
        """Waits on the robot's clock."""
        end_s = self.context.clock.now() + duration_s
        while self.context.clock.now() < end_s:
            yield Running(message)


def _meets(guard: Callable[[FloatArray], bool], trajectory: ArmTrajectory, clock: Clock, begun_s: float) -> bool:
    """Returns whether a guard wants the arm stopped, given where a trajectory has it now."""
    elapsed_s, times = clock.now() - begun_s, trajectory.times_s
    return guard(np.array([np.interp(elapsed_s, times, joint) for joint in trajectory.positions_rad.T]))


def passed(trajectory: ArmTrajectory, within_s: float, q_rad: FloatArray) -> tuple[float, float]:
    """How far (s) along a trajectory an arm is that has followed it for `within_s`, and how far off it (rad)."""
    times_s = np.append(trajectory.times_s[trajectory.times_s < within_s], min(within_s, trajectory.times_s[-1]))
    wanted = np.stack([np.interp(times_s, trajectory.times_s, joint) for joint in trajectory.positions_rad.T], axis=1)
    off_rad = np.max(np.abs(wanted - q_rad), axis=1)
    nearest = int(np.argmin(off_rad))
    return float(times_s[nearest]), float(off_rad[nearest])


def rest_of(trajectory: ArmTrajectory, elapsed_s: float, q_rad: FloatArray) -> ArmTrajectory:
    """What is left of a trajectory that was stopped after elapsed_s, from where the arm is now; it starts slowly."""
    times, positions = trajectory.times_s, trajectory.positions_rad
    ahead = times > elapsed_s
    ahead[-1] = True
    here = np.clip(q_rad, positions.min(axis=0), positions.max(axis=0))
    left_s = times[ahead] - elapsed_s
    first_s = max(float(np.max(np.abs(positions[ahead][0] - here))) / _RESTART_RAD_S, _LEAST_S, float(left_s[0]))
    return ArmTrajectory(np.concatenate([[0.0], left_s - left_s[0] + first_s]), np.vstack([here, positions[ahead]]))
