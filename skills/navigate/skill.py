"""The navigate skill: plans a path, follows it, clears reserved paths of other robots, and stops at the goal."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from skills.api import Cause, Failed, Part, PlanningError, Running, Skill, SkillContext, Step, Succeeded
from skills.footprint import Footprint, footprint_clearance_m
from skills.geometry import relative_pose
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.base import Base
from skills.navigate.giving_way import Avoided
from skills.navigate.surroundings import Company, NavigateInputs, NavigateOptions, Surroundings
from skills.navigate.trip_planning import TripPlanning, place_text
from skills.path import Drive, LocalController, Path
from skills.robot import Pose2D
from skills.routine import Patience, Routine, RoutineSkill, SkillFailure

_STILL_THERE_M = 1.0
_REVIEWED_M = 0.02
_BRAKING_M_S2 = 0.4
_ON_PATH_M = 0.35
_ON_PATH_RAD = 0.3
_EARLY = 0.4
"""The robot begins to stop within this fraction of the goal's tolerances."""


class _OnReservedPath(Exception):  # noqa: N818 - no program error
    """Raised when the robot stands on paths that other robots have reserved."""

    def __init__(self, robots: Sequence[str]) -> None:
        super().__init__()
        self.robots = robots


@dataclass
class _Progress:
    """Progress along the path: the shortest remaining length so far (m), and when it was reached (s).

    Time spent waiting for a known reason does not count as a lack of progress.
    """

    best_s: float
    best_m: float = math.inf
    whole_m: float | None = None

    def restart(self, now_s: float) -> None:
        """Resets the progress, for another path."""
        self.best_m, self.best_s = math.inf, now_s

    def note(self, left_m: float, now_s: float) -> float:
        """Notes the remaining length; returns the completed fraction of the whole path, 0 to 1."""
        if left_m < self.best_m - 0.03:
            self.best_m, self.best_s = left_m, now_s
        return min(1.0, max(0.0, 1.0 - left_m / max(self.whole_m or left_m, left_m, 1e-3)))


class Navigate(RoutineSkill[NavigateInputs]):
    """Drives to a pose: plans a path for the whole footprint, follows it, and stands still at the goal.

    An attempt goes through the stages localise, plan, follow, wait aside and settle; each stage returns the next one. A
    robot that stands on another's reserved path leaves its stage and goes aside first.
    """

    name: ClassVar[str] = "navigate"
    Inputs: ClassVar[type] = NavigateInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "localisation is lost, the LiDAR does not work, or the robot refuses to drive",
        Cause.PLANNING: "the goal is blocked, or there is no path, even after waiting for what stands there to move",
        Cause.EXECUTION: "the robot makes no progress, loses localisation or its LiDAR, or refuses to drive on",
        Cause.POSTCONDITION: "it stands still, but not at the goal",
    }
    default_timeout_s: ClassVar[float] = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}
    Options: ClassVar[type] = NavigateOptions
    options: NavigateOptions

    def __init__(
        self, context: SkillContext, options: NavigateOptions | None = None, company: Company | None = None
    ) -> None:
        """With `company` the robot accompanies a person, and does not wait for that person to clear the path."""
        super().__init__(context, options)
        self._base, self._company = Base(context), company

    def begin(self, inputs: NavigateInputs) -> None:
        """Starts a new attempt to reach the goal of `inputs`."""
        super().begin(inputs)
        context, options, clock = self.context, self.options, self.context.clock
        self._base, self._inputs = Base(context), inputs
        self._around = Surroundings(context, options, self._company)
        self._around.robots.begin()
        self._planning = TripPlanning(context, options, inputs, self._around)
        self._progress, self._drives = _Progress(clock.now()), False
        self._blind = Patience(clock, options.blind_patience_s)
        self._lost, self._placed = Patience(clock, options.localising_patience_s), False
        self._blocked = Patience(clock, options.blocked_patience_s)
        self._around_due_s = self._review_due_s = -math.inf

    def end(self) -> None:
        """Stops the base and releases the reserved path."""
        self._base.stop()
        self.context.traffic.release()
        super().end()

    def retarget(self, inputs: NavigateInputs) -> bool:
        """Changes the goal while the robot drives along its path; returns False while a plan is being computed."""
        if self._planning.under_way:
            return False
        self._inputs = inputs
        self._planning.retarget(inputs, self._pose_then() if self._drives else None)
        return True

    suspend, resume = Skill.suspend, Skill.resume
    """A pause ends the attempt, so that other robots may pass; afterwards a new one begins from the present pose."""

    def undone(self, inputs: NavigateInputs) -> str | None:
        """Checks that the robot is within 1 m of the goal; later skills may have moved it a little."""
        pose, goal = self.context.pose(), inputs.goal
        off_m = math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m)
        return None if off_m < _STILL_THERE_M else f"the robot is {off_m:.1f} m from where it went"

    def outline(self) -> Footprint:
        """The robot's footprint with its present arm posture."""
        return ArmFootprint(self.context).now()

    def run(self, inputs: NavigateInputs) -> Routine[Succeeded]:
        """Runs one attempt, stage by stage. Raises SkillFailure when the goal is not reached."""
        stage: _Stage | Succeeded = self._localise
        while not isinstance(stage, Succeeded):
            try:
                stage = yield from stage()
            except _OnReservedPath as error:
                self._base.stop()
                self._planning.go_aside(error.robots, forget=True)
                yield Running(f"making way for {', '.join(error.robots)}")
                self._around.look(self._base.last_velocity)
                stage = self._plan
        return stage

    def step(self) -> Step:
        """Runs one tick: see `Skill.step`."""
        return self._stands() or super().step()

    def _stands(self) -> Step | None:
        """Stops while the LiDAR fails or the robot refuses to drive; fails when either lasts too long."""
        trouble = self._around.scans.trouble()
        if trouble is not None:
            self._base.stop()
            self._progress.best_s = self._now()
            if self._blind.is_left():
                return Running(f"standing: {trouble}")
            return Failed(self._refusal_cause, f"{trouble} The robot does not drive without it.")
        self._blind.reset()
        if self.context.localiser.estimate().localised:
            self._lost.reset()
        elif not self._lost.is_left():
            self._base.stop()
            if self._placed:
                return Failed(Cause.EXECUTION, "The robot lost its place: its scans no longer agree with the map.")
            return Failed(Cause.PRECONDITION, "The robot does not know where it is, so no path can be planned.")
        refusal = self._base.refusal()
        if refusal is None:
            return None
        if self._base.ask_again():
            self._progress.best_s = self._now()
            return Running(f"standing: the robot refuses to drive: {refusal}")
        return Failed(self._refusal_cause, f"The robot refused to drive: {refusal}.")

    @property
    def _refusal_cause(self) -> Cause:
        """PRECONDITION before the robot has accepted a command, EXECUTION afterwards."""
        return Cause.EXECUTION if self._base.accepted else Cause.PRECONDITION

    def _now(self) -> float:
        return self.context.clock.now()

    def _tick(self, message: str, progress: float | None = None, *, waits_aside: bool = False) -> Routine[None]:
        """Waits for the next tick and updates the surroundings.

        Raises _OnReservedPath when the robot stands on a reserved path, unless it is going aside already.
        """
        yield Running(message, progress)
        if waits_aside or self._planning.aside is None:
            first = self._planning.robots_blocked()
            if first:
                raise _OnReservedPath(first)
        self._planning.pass_request.update(self._planning.blocker, self._around.people_by_shape)
        self._around.look(self._base.last_velocity)

    def _localise(self) -> Routine[_Stage]:
        """Waits until a scan agrees with the map."""
        while not self.context.localiser.estimate().localised:
            yield Running("finding out where I am")
        self._placed = True
        self._planning.ask()
        yield from self._tick("finding out where I am")
        return self._plan

    def _plan(self) -> Routine[_Stage]:
        """Waits until a plan is finished, or until the next one is due."""
        planning = self._planning
        while True:
            if not planning.under_way and self._now() < planning.wait_until_s:
                yield from self._tick(self._waiting_sentence())
                continue
            if not planning.under_way:
                planning.ask()
            stage = self._after_plan()
            yield from self._tick("planning a path")
            if stage is not None:
                return stage

    def _after_plan(self) -> _Stage | None:
        """The stage after a finished plan; None while none has finished. Raises SkillFailure when no plan is left."""
        try:
            path = self._planning.path()
        except PlanningError as error:
            self._base.stop()
            return self._wait_aside if self._planning.try_instead(str(error)) else self._plan
        if path is None:
            return None
        self._take(path)
        return self._follow

    def _take(self, path: Path) -> None:
        """Starts to follow a path."""
        controller, speed = self.context.stack.controller, self._inputs.max_speed_m_s
        self._follower: LocalController = controller.build(path, self._around.footprint, max_speed_m_s=speed)
        self._drives = True
        self._progress.whole_m = self._progress.whole_m or max(self._follower.length_m, 1e-3)
        self._progress.restart(self._now())
        self._blocked.reset()
        poses = [[round(float(v), 3) for v in pose] for pose in path.poses[::4]]
        self.context.publish("path", {"robot": self.context.robot.name, "frame": "world", "poses": poses})

    def _follow(self) -> Routine[_Stage]:
        """Drives along the path, slowly near people; plans again around obstacles that stay."""
        while True:
            stage = self._after_plan()
            if stage is not None and stage != self._follow:
                yield from self._tick(self._waiting_sentence())
                return stage
            standing = self._stands_at_once()
            if standing is None:
                answer, standing = self._drive()
            if standing is not None:
                yield from self._tick(standing)
            elif self._planning.aside is not None and self._arrived(1.0):
                self._base.stop()
                self._planning.wait_until_s = self._now() + self.options.giving_way.again_s
                yield from self._tick("waiting aside for another robot to pass", waits_aside=True)
                return self._wait_aside
            elif self._arrived(_EARLY):
                return self._settle
            else:
                yield from self._tick(*self._goes_on(answer))

    def _wait_aside(self) -> Routine[_Stage]:
        """Stands at a waiting pose until no other robot passes any more, then plans to the goal again."""
        robots = self._around.robots
        while True:
            robots.reserve_poses(self._around.footprint, self.context.pose())
            self._progress.best_s = self._now()
            if not robots.robots_with_priority() or self._now() >= self._planning.wait_until_s:
                break
            yield from self._tick("waiting aside for another robot to pass", waits_aside=True)
        self._planning.go_on()
        yield from self._tick("planning a path")
        return self._plan

    def _settle(self) -> Routine[_Stage | Succeeded]:
        """Stops and checks the pose against the goal. Raises SkillFailure when the robot is not there."""
        goal = self._inputs.goal
        until_s, still = self._now() + self.options.settle_s, False
        while not still and self._now() < until_s:
            yield Running("stopping at the goal", 1.0)
            self._base.drive((0.0, 0.0, 0.0))
            vx, vy, wz = self.context.robot.odometry().velocity
            still = math.hypot(vx, vy) < self.options.still_m_s and abs(wz) < self.options.still_rad_s
        self._base.stop()
        if self._inputs.goal != goal:
            return self._plan
        off = relative_pose(self._inputs.goal, self.context.pose())
        sentence = f"{math.hypot(off.x_m, off.y_m):.2f} m and {abs(off.yaw_rad):.2f} rad off the goal"
        if not still:
            raise SkillFailure(Cause.POSTCONDITION, f"The robot does not come to rest; it is {sentence}.")
        if not self._arrived(1.0):
            raise SkillFailure(Cause.POSTCONDITION, f"The robot stands {sentence}.")
        return Succeeded(f"standing {sentence}")

    def _stands_at_once(self) -> str | None:
        """Stops for a lost pose or a sudden obstacle; returns the reason, or None when the robot may drive."""
        if not self.context.localiser.estimate().localised:
            self._base.drive((0.0, 0.0, 0.0))
            return "standing until scans agree with the map again"
        danger_W = self._around.danger(self._follower, self._inputs.max_speed_m_s)
        if danger_W is None:
            return None
        self._base.stop()
        self._progress.best_s = self._now()
        return f"standing, since an obstacle comes into the path at {place_text(danger_W)}"

    def _drive(self) -> tuple[Drive, str | None]:
        """Sends the next velocity; returns it with a message while the robot waits, else None.

        Raises SkillFailure when the robot may not drive on.
        """
        follower, goal = self._follower, self._planning.goal
        pace = self._around.pace(follower, self._inputs.max_speed_m_s, goal)
        most_m_s, waits = self._give_way()
        pose, velocity = self.context.pose(), self.context.robot.odometry().velocity
        costmap, most_m_s = self._around.costmap(pose, goal), min(most_m_s, pace.most_m_s)
        answer = follower.command(pose, velocity, self._base.last_velocity, costmap, most_m_s)
        self._base.drive(answer.velocity) if answer.halt is None else self._base.leave_to(answer.halt)
        if waits is not None or not pace.waiting or pace.person is None:
            return answer, waits
        place_W = pace.person.place_W
        waits = self._waits(f"waiting for a person at {place_text(place_W)}")
        self._planning.obstacle_W = place_W
        if pace.overdue and not self._planning.under_way:
            waits = self._replan(f"A person stays in the path at {place_text(place_W)}.")
        return answer, waits

    def _give_way(self) -> tuple[float, str | None]:
        """The speed that reserved paths allow (m/s), and a message while the robot waits for another robot."""
        robots, footprint, options = self._around.robots, self._around.footprint, self.options.giving_way
        robots.reserve_path(self._follower, footprint)
        if self._planning.aside is not None:
            return math.inf, None
        conflict = robots.conflict_m(self._follower, footprint)
        if conflict is None:
            name = robots.robot_to_wait_for(self._follower, footprint)
            return (math.inf, None) if name is None else (0.0, self._waits(f"waiting for {name} to make way"))
        conflict_m, name = conflict
        left_m = conflict_m - options.short_m
        if left_m > 0.02:
            return math.sqrt(2.0 * _BRAKING_M_S2 * left_m), None
        if not self._planning.under_way and self._now() >= self._around_due_s:
            self._planning.avoided, self._around_due_s = Avoided.PATHS, self._now() + 2.0 * options.again_s
            self._planning.ask()
        return 0.0, self._waits(f"waiting for {name} to pass")

    def _waits(self, message: str) -> str:
        """Resets the timers for blocked and stuck robots, because this wait has a reason; returns the message."""
        self._progress.best_s = self._now()
        self._blocked.reset()
        return message

    def _waiting_sentence(self) -> str:
        obstacle_W = self._planning.obstacle_W
        return f"waiting for the path {f'at {place_text(obstacle_W)}' if obstacle_W else 'ahead'} to become free"

    def _goes_on(self, answer: Drive) -> tuple[str, float | None]:
        """Plans again when the path fails; returns the message and the progress, 0 to 1."""
        done = self._progress.note(answer.remaining_m, self._now())
        trouble = self._trouble(answer)
        if not self._planning.under_way:
            if trouble is not None:
                return self._replan(trouble), None
            if self._lacks_clearance() or self._around.outgrows_footprint():
                self._planning.ask(self._pose_then())
        return f"on the way, {answer.remaining_m:.1f} m to go", done

    def _trouble(self, answer: Drive) -> str | None:
        """The reason to abandon the path; None when there is none."""
        if answer.blocked_at is None:
            self._blocked.reset()
        else:
            self._planning.obstacle_W = answer.blocked_at
            if not self._blocked.is_left():
                return f"The path is blocked by an obstacle at {place_text(answer.blocked_at)}."
        if answer.off_path_m > self.context.stack.controller.lost_path_m:
            return f"The robot is {answer.off_path_m:.2f} m off its path."
        stuck = self._now() - self._progress.best_s > self.options.stuck_s
        return "The robot makes no progress." if stuck else None

    def _lacks_clearance(self) -> bool:
        """Returns whether obstacles leave the path too little clearance; checked every `review_s`."""
        through = self._planning.avoided is Avoided.WORKING and self._planning.aside is None
        if through or not self.options.review_m or self._now() < self._review_due_s:
            return False
        self._review_due_s = self._now() + self.options.review_s
        ahead = self._follower.ahead(self.options.review_m)
        costmap = self._around.costmap(self.context.pose(), self._planning.goal)
        clearance_m = footprint_clearance_m(costmap, self._around.footprint, ahead)
        blocked = np.flatnonzero(clearance_m < min(_REVIEWED_M, float(clearance_m[0]) - 0.01))
        if not len(blocked):
            return False
        self._planning.obstacle_W = (float(ahead[blocked[0], 0]), float(ahead[blocked[0], 1]))
        return True

    def _replan(self, why: str) -> str:
        """Plans again from where the robot will be. Raises SkillFailure after too many plans."""
        self._progress.restart(self._now())
        self._blocked.reset()
        self._planning.plan_again(why, self._pose_then())
        return f"{why} Planning another path."

    def _pose_then(self) -> Pose2D | None:
        """The robot's pose on the path when a plan requested now arrives; None when the robot is off the path."""
        vx, vy, _ = self.context.robot.odometry().velocity
        then = self._follower.pose_after(math.hypot(vx, vy) * self.options.planning_latency_s)
        off = relative_pose(self.context.pose(), then)
        on_path = math.hypot(off.x_m, off.y_m) < _ON_PATH_M and abs(off.yaw_rad) < _ON_PATH_RAD
        return then if on_path else None

    def _arrived(self, share: float) -> bool:
        """Returns whether the robot is within a fraction of the tolerances of its present goal."""
        off = relative_pose(self._planning.goal, self.context.pose())
        near = math.hypot(off.x_m, off.y_m) <= share * self._inputs.position_tolerance_m
        return near and abs(off.yaw_rad) <= share * self._inputs.yaw_tolerance_rad


_Stage = Callable[[], "Routine[_Stage | Succeeded]"]
