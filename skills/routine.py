"""Base of skills that are written as a routine: a generator that yields `Running` and returns `Succeeded`."""

import math
from abc import abstractmethod
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, Self, TypeVar

import numpy as np

from skills.api import Cause, Failed, InputsT, Job, PlanningError, Running, Skill, SkillContext, Step, Succeeded
from skills.geometry import wrap
from skills.robot import ArmTrajectory, Clock, CommandCause, CommandId, CommandState, FloatArray, NoImageError, Pose2D

PATIENCE_S: Final = 6.5
"""Duration (s) of a disturbance up to which no skill fails."""


@dataclass
class Patience:
    """Timeout for a disturbance that may pass; starts again after `reset`."""

    clock: Clock
    lasts_s: float = PATIENCE_S
    _since_s: float | None = field(default=None, init=False)

    def is_left(self) -> bool:
        """Notes that the disturbance is present now; returns whether it has lasted no longer than `lasts_s`."""
        now_s = self.clock.now()
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s <= self.lasts_s

    def reset(self) -> None:
        """Notes that the disturbance has passed."""
        self._since_s = None


ResultT = TypeVar("ResultT")
OtherT = TypeVar("OtherT")
Routine = Generator[Running, None, ResultT]
"""Generator that yields `Running` at each tick, and returns a result."""

ARM_EXPIRY_MARGIN_S = 3.0
STAND_EXPIRY_S = 6.0
HEIGHT_TOLERANCE_M = 0.02
_PAUSE_S = 10.0
"""Longest pause after which a routine continues."""
_STAYED_M = 0.15
"""Largest displacement of the body during such a pause."""
_STAYED_RAD = 0.2
"""Largest rotation of the body or of an arm joint during such a pause."""
_RESTART_RAD_S = 0.8
"""Joint speed towards the remaining part of a trajectory."""
_LEAST_S = 0.05
"""Shortest duration of that motion."""
_AGAIN_S = 0.4
"""Pause before a refused, stopped or lost command is issued again."""
_OLD_S = 0.45
"""Age beyond which measurements of the arm are not used."""
_LOST_S = 0.5
"""Time after its expiry from which on a running command counts as lost."""
_OFF_PATH_RAD = 0.2
"""Largest joint error between an arm and the trajectory that it continues."""


ENDED_EARLY: Final = Succeeded("ended early")
"""Result of an inner skill that `RoutineSkill.perform` ended because its condition `enough` held."""


class SkillFailure(Exception):  # noqa: N818 - a failed attempt is no program error
    """Failure of a routine: the cause, one plain sentence, the outputs, and whether it is final (see `Failed`)."""

    def __init__(
        self, cause: Cause, message: str, outputs: Mapping[str, Any] | None = None, *, final: bool = False
    ) -> None:
        super().__init__(message)
        self.cause = cause
        self.message = message
        self.outputs: Mapping[str, Any] = outputs or {}
        self.final = final


class OffPathError(Exception):
    """Error of an arm that is too far from an interrupted trajectory to continue it."""


class CommandFailure(SkillFailure):
    """Failure of a command that was refused, stopped or lost; cause EXECUTION. Issuing it again may succeed."""

    def __init__(self, message: str, why: CommandCause = CommandCause.NO_ANSWER) -> None:
        super().__init__(Cause.EXECUTION, message)
        self.why = why


class PlanningAttempt:
    """Context manager that keeps a SkillFailure with cause PLANNING in `failure`; other failures propagate."""

    failure: SkillFailure | None = None

    def __enter__(self) -> Self:
        """Returns the attempt."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> bool:
        """Suppresses and keeps a failure with cause PLANNING."""
        if not (isinstance(error, SkillFailure) and error.cause is Cause.PLANNING):
            return False
        self.failure = error
        return True


@dataclass(frozen=True)
class _Stance:
    """Pose, arm angles and grip of the robot when its routine was suspended."""

    since_s: float
    pose: Pose2D
    arm_rad: FloatArray
    holding: bool


class RoutineSkill(Skill[InputsT]):
    """Skill whose attempt is one generator, `run`. `end` stops the commands that the attempt has issued.

    After a short pause in which body, arm and grip stayed as they were, the routine continues from its last yield, and
    the stopped motion is resumed. Otherwise `run_again` first checks what is done already.
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
        """Makes one attempt. Raises SkillFailure when the attempt fails."""

    def begin(self, inputs: InputsT) -> None:
        """Forgets an earlier attempt and prepares a new one."""
        self.end()
        self._routine = self.run(inputs)

    def run_again(self, inputs: InputsT) -> Routine[Succeeded]:
        """Continues an interrupted attempt after a check of what is done. Raises SkillFailure when it fails."""
        return self.run(inputs)

    def suspend(self) -> None:
        """Stops the present motion; the routine stays at its last yield."""
        if self._routine is None:
            return
        self._stance = self._stance_now()
        if self._inner_skill is not None:
            self._inner_skill.suspend()
        self._stop_commands()
        stopped = (one for one in self._commands if self._state(one) is CommandState.STOPPED)
        self._interrupted |= set(stopped)

    def resume(self, inputs: InputsT) -> None:
        """Continues after a pause or a restart."""
        if self.can_go_on():
            self._stance = None
            if self._inner is not None:
                self._inner()
            return
        self.end()
        self._routine = self.run_again(inputs)

    def can_go_on(self) -> bool:
        """Returns whether the pause was short, body and arm have not moved, and no held object was lost."""
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
        """Returns a failure to raise inside the routine, or None; each step calls this first."""
        return None

    def step(self) -> Step:
        """Runs the routine to its next yield. Raises RuntimeError when called before `begin`."""
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
        """Registers a command as this attempt's own."""
        self._commands.append(command)
        return command

    def compute(self, work: Callable[[], ResultT], *, latency_s: float, name: str, message: str) -> Routine[ResultT]:
        """Runs `work` on the Worker. A PlanningError becomes a SkillFailure with cause PLANNING."""
        return (yield from self._awaited(self.context.worker.submit(work, latency_s=latency_s, name=name), message))

    def _awaited(self, job: Job[ResultT], message: str) -> Routine[ResultT]:
        """Waits for a job's result; withdraws the job when the routine is closed."""
        try:
            while not job.done():
                yield Running(message)
            return job.result()
        except PlanningError as error:
            raise SkillFailure(Cause.PLANNING, str(error), error.outputs) from error
        finally:
            job.withdraw()

    def sense(self, read: Callable[[], ResultT], *, latency_s: float, name: str, message: str) -> Routine[ResultT]:
        """Calls `read` on the Worker, because it may block; repeats it after a NoImageError while patience lasts.

        Raises SkillFailure with cause EXECUTION when the camera still returns no picture.
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
        """Waits, while patience lasts, until the measurements of the arm's joints and of the gripper are recent.

        If they stay old, `Skill.max_data_age_s` makes a success fail.
        """
        robot, clock, patience = self.context.robot, self.context.clock, Patience(self.context.clock)
        while min(robot.joints().stamp_s, robot.gripper().stamp_s) < clock.now() - _OLD_S and patience.is_left():
            yield Running(f"{message}; waits for a reading of the arm")

    def follow(
        self, trajectory: ArmTrajectory, message: str, guard: Callable[[FloatArray], bool] | None = None
    ) -> Routine[bool]:
        """Moves the arm along a trajectory; returns whether `guard` stopped it before the end.

        `guard` receives, at each tick, the joint angles that the trajectory has then. After a stopped or lost command
        the arm continues from its present angles. Raises SkillFailure with cause EXECUTION when the arm does not reach
        the end.
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
        """Returns the rest of a trajectory after a failed command, starting from the arm's present angles.

        Raises OffPathError when the arm is not on the trajectory.
        """
        q_rad = self._stance_now().arm_rad
        passed_s, off_rad = nearest_on(trajectory, elapsed_s, q_rad)
        if off_rad > _OFF_PATH_RAD:
            raise OffPathError
        return rest_of(trajectory, passed_s, q_rad)

    def persist(self, attempt: Callable[[], Routine[ResultT]], message: str) -> Routine[ResultT]:
        """Makes an attempt; repeats it, while patience lasts, when its command is refused, stopped or lost.

        Patience begins with the first such failure. An attempt refused for lack of the lease is repeated only once,
        because the run suspends the skill until the robot has its lease again. Raises SkillFailure when the attempt
        fails for good.
        """
        patience, before = Patience(self.context.clock), CommandFailure(message)
        while True:
            try:
                return (yield from attempt())
            except OffPathError as off:
                raise before from off
            except CommandFailure as failure:
                if not patience.is_left() or failure.why is before.why is CommandCause.NO_LEASE:
                    raise
                before = failure
                yield from self.pause(_AGAIN_S, f"{failure.message}; {message} again")

    def stand_at(self, height_m: float, message: str) -> Routine[None]:
        """Brings the body to a height, level, unless it is at that height already.

        Raises SkillFailure with cause EXECUTION when the body does not reach the height.
        """
        context = self.context

        def attempt() -> Routine[None]:
            while abs(float(context.robot.odometry().X_OB.translation()[2]) - height_m) > HEIGHT_TOLERANCE_M:
                until_s = context.clock.now() + STAND_EXPIRY_S
                command = self.issue(context.robot.stand(height_m, 0.0, until_s=until_s, lease=context.lease))
                if (yield from self.finish(command, message, "the body", until_s=until_s)) is None:
                    return

        yield from self.persist(attempt, message)

    def perform(
        self, skill: Skill[OtherT], inputs: OtherT, enough: Callable[[], bool] = lambda: False
    ) -> Routine[Succeeded]:
        """Runs another skill inside this one; returns `ENDED_EARLY` once `enough` holds.

        Raises SkillFailure with the inner skill's cause and message when that skill fails.
        """
        skill.begin(inputs)
        self._inner_skill, self._inner = skill, lambda: skill.resume(inputs)
        try:
            while isinstance(step := skill.step(), Running):
                yield step
                if enough():
                    return ENDED_EARLY
        finally:
            self._inner_skill = self._inner = None
            skill.end()
        if isinstance(step, Failed):
            raise SkillFailure(step.cause, step.message)
        return step

    def finish(
        self, command: CommandId, message: str, what: str, enough: Callable[[], bool] | None = None, *, until_s: float
    ) -> Routine[float | None]:
        """Waits until a command is done; returns None then.

        Returns the time (s) of the last tick when a suspension stopped the command, and when `enough` held, which stops
        it. Raises SkillFailure with cause EXECUTION when the command expired at `until_s`, and CommandFailure when it
        was refused, stopped for another reason, or lost (still running after its expiry).
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
        sentence = f"{what} was {status.state.value} while {message}{why}"
        if status.state is CommandState.STOPPED and self.context.clock.now() >= until_s:
            raise SkillFailure(Cause.EXECUTION, sentence)
        raise CommandFailure(sentence, status.cause)

    def pause(self, duration_s: float, message: str) -> Routine[None]:
        """Waits for a duration on the robot's clock."""
        end_s = self.context.clock.now() + duration_s
        while self.context.clock.now() < end_s:
            yield Running(message)


def _meets(guard: Callable[[FloatArray], bool], trajectory: ArmTrajectory, clock: Clock, begun_s: float) -> bool:
    """Returns whether `guard` asks to stop the arm at the angles that the trajectory has now."""
    elapsed_s, times = clock.now() - begun_s, trajectory.times_s
    return guard(np.array([np.interp(elapsed_s, times, joint) for joint in trajectory.positions_rad.T]))


def nearest_on(trajectory: ArmTrajectory, within_s: float, q_rad: FloatArray) -> tuple[float, float]:
    """Returns the time (s) on a trajectory at which it is nearest to an arm, and the largest joint error there.

    The arm has followed the trajectory for `within_s`.
    """
    times_s = np.append(trajectory.times_s[trajectory.times_s < within_s], min(within_s, trajectory.times_s[-1]))
    wanted = np.stack([np.interp(times_s, trajectory.times_s, joint) for joint in trajectory.positions_rad.T], axis=1)
    off_rad = np.max(np.abs(wanted - q_rad), axis=1)
    nearest = int(np.argmin(off_rad))
    return float(times_s[nearest]), float(off_rad[nearest])


def rest_of(trajectory: ArmTrajectory, elapsed_s: float, q_rad: FloatArray) -> ArmTrajectory:
    """Returns the rest of a trajectory after `elapsed_s`, starting slowly from the arm's present angles."""
    times, positions = trajectory.times_s, trajectory.positions_rad
    ahead = times > elapsed_s
    ahead[-1] = True
    here = np.clip(q_rad, positions.min(axis=0), positions.max(axis=0))
    left_s = times[ahead] - elapsed_s
    first_s = max(float(np.max(np.abs(positions[ahead][0] - here))) / _RESTART_RAD_S, _LEAST_S, float(left_s[0]))
    return ArmTrajectory(np.concatenate([[0.0], left_s - left_s[0] + first_s]), np.vstack([here, positions[ahead]]))
