"""The skill that goes to a place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from skills.api import (
    Cause,
    Costmap,
    Failed,
    ForgettingCostmap,
    Job,
    PlanningError,
    Running,
    SkillContext,
    Step,
    Succeeded,
)
from skills.geometry import compose, relative
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.base import Base
from skills.navigate.collision_guard import CollisionGuard, GuardOptions
from skills.navigate.cut_off import DoorOptions, DoorWatch, closed_sentence
from skills.navigate.footprint import Footprint, footprint_clearance_m
from skills.navigate.giving_way import Avoided, GivingWay, GivingWayOptions
from skills.navigate.low_obstacles import LowObstacleWatch, WatchOptions
from skills.navigate.path import Path
from skills.navigate.people_space import Pace, PaceManager, SpaceOptions, spaced
from skills.navigate.ports import NavigateInputs, NavigatePorts
from skills.navigate.scan_health import ScanHealth, ScanHealthOptions
from skills.patience import PATIENCE_S
from skills.perception.doorway import Doorway
from skills.perception.people import SeenPerson
from skills.perception.people_watch import PeopleOptions, PeopleWatch
from skills.quantities import Delay, Duration, Margin, Speed, Tries, TurnRate
from skills.robot import Pose2D
from skills.stack import LocalController

_STILL_THERE_M = 1.0
_REVIEWED_M = 0.02
_OUTLINE_PERIOD_S = 0.5


@dataclass(frozen=True)
class NavigateOptions:
    """Patience and bounds of the skill, times in seconds of the robot's clock.

    Every `review_s` the path is checked `review_m` ahead, and planned anew, while driving, where something blocks it.
    While people are near, and for `after_person_s` (longer than a costmap remembers them), plans that fail are tried
    again without being counted, up to person_patience_s.
    """

    planning_latency_s: Delay = 0.3
    localising_patience_s: Delay = 3.0
    blind_patience_s: Delay = PATIENCE_S
    blocked_patience_s: Delay = 1.5
    replan_pause_s: Delay = 2.0
    replans: Tries = 6
    stuck_s: Duration = 4.0
    review_s: Duration = 0.2
    review_m: Margin = 0.0
    settle_s: Delay = 2.0
    still_m_s: Speed = 0.03
    still_rad_s: TurnRate = 0.05
    after_person_s: Delay = 14.0
    person_patience_s: Delay = 45.0
    low_obstacles: WatchOptions = field(default_factory=WatchOptions)
    people: PeopleOptions = field(default_factory=PeopleOptions)
    space: SpaceOptions = field(default_factory=SpaceOptions)
    guard: GuardOptions = field(default_factory=GuardOptions)
    scans: ScanHealthOptions = field(default_factory=ScanHealthOptions)
    giving_way: GivingWayOptions = field(default_factory=GivingWayOptions)
    doors: DoorOptions = field(default_factory=DoorOptions)


class Navigate(NavigatePorts):
    """The skill that `NavigatePorts` declares."""

    Options: ClassVar[type] = NavigateOptions
    options: NavigateOptions

    def __init__(self, context: SkillContext, options: NavigateOptions | None = None) -> None:
        super().__init__(context, options)
        self._base = Base(context)

    def begin(self, inputs: NavigateInputs) -> None:
        """Start anew to the goal of `inputs`."""
        self._base.stop()
        self._base = Base(self.context)
        self._inputs = inputs
        self._aside: Pose2D | None = None
        self._tried: tuple[Pose2D, ...] = ()
        self._avoided, self._waits = Avoided.WAYS, False
        self._giving = GivingWay(self.context, self.options.giving_way)
        self._giving.begin()
        self._asked_due_s = self._around_due_s = self._neighbour_s = self._neighbour_since_s = -math.inf
        self._outline = ArmFootprint(self.context)
        self._footprint = self._outline.now()
        self._outline_due_s = -math.inf
        self._watch = LowObstacleWatch(self.context, self.options.low_obstacles)
        self._people = PeopleWatch(self.context, self.options.people)
        self._pace = PaceManager(self._footprint, self.options.space)
        self._scans = ScanHealth(self.context, self.options.scans)
        self._doors = DoorWatch(self.context, self.options.doors)
        self._shut_since_s: float | None = None
        self._seen_anew = False
        self._blind_since_s: float | None = None
        self._guard = CollisionGuard(self.context, self._footprint, self.options.guard)
        self._room_m = self.options.space.room_m
        self._person_s = self._person_since_s = -math.inf
        self._phase: Callable[[], Step] = self._localising
        self._follower: LocalController | None = None
        self._job: Job[Path] | None = None
        self._map_alone = self._map_leads = False
        self._replans = 0
        self._whole_m: float | None = None
        self._wait_until_s = -math.inf
        self._blocked_since_s: float | None = None
        self._lost_since_s: float | None = None
        self._obstacle: tuple[float, float] | None = None
        self._best_m, self._best_s = math.inf, self._now()
        self._review_due_s = -math.inf

    def step(self) -> Step:
        """One tick: see `Skill.step`."""
        blind = self._blind()
        if blind is not None:
            return blind
        if self._phase != self._localising and self._lost():
            self._base.stop()
            return Failed(Cause.EXECUTION, "The robot lost its place: its scans no longer agree with the map.")
        refusal = self._base.refusal()
        if refusal is not None and self._base.asks_again():
            self._best_s = self._now()
            return Running(f"standing: the robot refuses to drive: {refusal}")
        if refusal is not None:
            cause = Cause.EXECUTION if self._base.accepted else Cause.PRECONDITION
            return Failed(cause, f"The robot refused to drive: {refusal}.")
        return self._make_way() or self._phase()

    def end(self) -> None:
        """Stop what this skill set in motion, and give the way back."""
        self._base.stop()
        self.context.traffic.release()

    def outline(self) -> Footprint:
        """The robot's footprint as it stands now."""
        return ArmFootprint(self.context).now()

    def undone(self, inputs: NavigateInputs) -> str | None:
        """The robot's place tells; skills that came after may have gone a little aside."""
        pose, goal = self.context.pose(), inputs.goal
        off_m = math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m)
        return None if off_m < _STILL_THERE_M else f"the robot is {off_m:.1f} m from where it went"

    def _now(self) -> float:
        return self.context.clock.now()

    def _lost(self) -> bool:
        """Whether the robot has not known its place for longer than patience allows; it stands meanwhile."""
        if self.context.localiser.estimate().localised:
            self._lost_since_s = None
            return False
        self._lost_since_s = self._now() if self._lost_since_s is None else self._lost_since_s
        return self._now() - self._lost_since_s > self.options.localising_patience_s

    def _blind(self) -> Step | None:
        """Stand as long as the LiDAR does not work, and fail when that takes too long."""
        trouble, now_s = self._scans.trouble(), self._now()
        if trouble is None:
            self._blind_since_s = None
            return None
        self._base.stop()
        self._best_s = now_s
        self._blind_since_s = now_s if self._blind_since_s is None else self._blind_since_s
        if now_s - self._blind_since_s <= self.options.blind_patience_s:
            return Running(f"standing: {trouble}")
        cause = Cause.EXECUTION if self._base.accepted else Cause.PRECONDITION
        return Failed(cause, f"{trouble} The robot does not drive without it.")

    def _localising(self) -> Step:
        """Wait for the first agreement of a scan with the map."""
        if self._lost():
            return Failed(Cause.PRECONDITION, "The robot does not know where it is, so no way can be planned.")
        if self._lost_since_s is None:
            self._ask_for_plan()
            self._phase = self._planning
        return Running("finding out where I am")

    def _ask_for_plan(self, start: Pose2D | None = None, *, map_alone: bool = False) -> None:
        """Sample the costmap now and plan in the Worker, from a pose or from here; `map_alone`: as if nobody stood
        about, only to see whether there is a way."""
        if not self._persons():
            self._room_m = self.options.space.room_m
        self._doors.look()
        self._footprint = self._pace.footprint = self._guard.footprint = self._outline.now()
        self._outline_due_s = self._now() + _OUTLINE_PERIOD_S
        speed = max(0.1, self._inputs.max_speed_m_s)
        begin, goal = start or self.context.pose(), self._goal
        avoided, self._map_alone = self._avoided if self._aside is None else Avoided.BODIES, map_alone
        plan = self.context.stack.planner.problem(
            self.context.costmap if map_alone else self._costmap(begin, avoided),
            self._footprint,
            begin,
            goal,
            max_speed_m_s=speed,
            work=self.context.work,
        )
        self._job = self.context.worker.submit(plan, latency_s=self.options.planning_latency_s, name="plan a path")

    @property
    def _goal(self) -> Pose2D:
        """Where the robot goes just now: the goal, or a place where it waits for others to pass."""
        return self._aside or self._inputs.goal

    def _costmap(self, here: Pose2D, avoided: Avoided = Avoided.BODIES) -> Costmap:
        """What is in the way, with room about people as far as `here` and the goal leave it."""
        fixed = (here, self._goal)
        costmap = self._giving.costmap(self._doors.costmap(self.context.costmap), avoided)
        return spaced(costmap, self._footprint, fixed, self._persons(), self._room_m)

    def _look_out(self) -> None:
        """Look for low things and for people; what was seen comes in later."""
        self._watch.step()
        self._people.step(self._base.last_velocity)

    def _planning(self) -> Step:
        """Stand and wait for a plan, or for the time of the next attempt."""
        self._look_out()
        if self._job is None:
            if self._now() < self._wait_until_s:
                return Running(self._waiting_sentence())
            self._ask_for_plan()
        return self._take_plan() or Running("planning a path")

    def _take_plan(self) -> Step | None:
        """Take over a plan that is done; a failure when planning failed for good."""
        if self._job is None or not self._job.done():
            return None
        job, self._job = self._job, None
        try:
            path = job.result()
        except PlanningError as error:
            return self._plan_failed(str(error))
        if self._map_alone:
            self._map_alone, self._map_leads = False, True
            self._wait_until_s = self._now() + self.options.replan_pause_s
            return None
        controller, speed = self.context.stack.controller, self._inputs.max_speed_m_s
        self._follower = controller.build(path, self._footprint, max_speed_m_s=speed)
        self._whole_m = self._whole_m or max(self._follower.length_m, 1e-3)
        self._blocked_since_s = self._obstacle = None
        self._best_m, self._best_s, self._waits = math.inf, self._now(), False
        self._phase = self._following
        poses = [[round(float(v), 3) for v in pose] for pose in path.poses[::4]]
        self.context.publish("path", {"robot": self.context.robot.name, "frame": "world", "poses": poses})
        return None

    def _plan_failed(self, why: str) -> Step | None:
        """Go nearer to people, or wait and try again when something seen may go away; give up at the bound."""
        self._base.stop()
        if self._map_alone:  # nobody is in the way: there is none
            return Failed(Cause.PLANNING, why)
        if self._other_plan():
            return None
        if self._persons() and self._room_m > self.options.space.least_room_m:
            self._room_m = self.options.space.least_room_m
            self._phase = self._planning
            return None
        neighbour = self._neighbour_may_go()
        may_go = neighbour or self._people_may_go()
        shut = () if neighbour else self._shut_doors()
        if shut:
            return self._wait_for_doors(shut)
        self._replans += not may_go
        if self._replans < self.options.replans and self._doors.forget_distant(self.context.pose()):
            self._phase = self._planning
            self._ask_for_plan()
            return None
        if not may_go and self._see_anew():
            return None
        if self._obstacle is None or self._replans >= self.options.replans:
            who = self._giving.name_at(self._obstacle) or "something seen"
            seen = f" The way is blocked by {who} at {_xy(self._obstacle)}." if self._obstacle else ""
            return Failed(Cause.PLANNING, why + seen, final=not may_go and self._cut_off())
        self._wait_until_s = self._now() + self.options.replan_pause_s
        self._phase = self._planning
        if neighbour and not self._map_leads and isinstance(self.context.costmap, ForgettingCostmap):
            self._ask_for_plan(map_alone=True)
        return None

    @property
    def _goals(self) -> tuple[Pose2D, ...]:
        """The goal, and the poses nearby that will do as well."""
        goal = self._inputs.goal
        return (goal, *(compose(goal, Pose2D(*offset, 0.0)) for offset in self._inputs.nearby_m))

    def _shut_doors(self) -> tuple[Doorway, ...]:
        """The doors that were seen closed and leave no path to any of the goals."""
        people_W = [one.place_W for one in self._persons()]
        return self._doors.in_the_way(self._footprint, self.context.pose(), self._goals, people_W)

    def _cut_off(self) -> bool:
        """Whether surely none of the goals can be reached."""
        return self._doors.regions(self._footprint, self.context.pose(), self._goals).cut_off

    def _wait_for_doors(self, doors: Sequence[Doorway]) -> Step | None:
        """Stand while closed doors leave no path; give up when patience is over."""
        now_s, options = self._now(), self.options.doors
        self._shut_since_s = now_s if self._shut_since_s is None else self._shut_since_s
        if now_s - self._shut_since_s >= options.patience_s:
            return Failed(Cause.PLANNING, closed_sentence(doors, self._inputs.goal), final=True)
        self._obstacle = doors[0].middle_W
        self._wait_until_s = now_s + options.look_s
        self._phase = self._planning
        return None

    def _see_anew(self) -> bool:
        """Forget once what was seen and look again, before the goal is taken for cut off by it."""
        costmap = self.context.costmap
        if self._seen_anew or not isinstance(costmap, ForgettingCostmap) or not self._cut_off():
            return False
        self._seen_anew = True
        if not costmap.forget_seen():
            return False
        self._wait_until_s = self._now() + self.options.doors.look_s
        self._phase = self._planning
        return True

    def _people_may_go(self) -> bool:
        """Whether a failure may be due to people who are near or were a moment ago, and patience lasts."""
        now_s = self._now()
        if self._persons():
            gap_s, self._person_s = now_s - self._person_s, now_s
            self._person_since_s = now_s if gap_s > self.options.after_person_s else self._person_since_s
        recently = now_s - self._person_s < self.options.after_person_s
        return recently and now_s - self._person_since_s < self.options.person_patience_s

    def _other_plan(self) -> bool:
        """Whether there is another plan to try, or to wait for, after one failed that led around others, or aside."""
        waits, self._waits = self._waits, False
        if self._aside is not None:
            self._tried = (*self._tried, self._aside)
            self._go_aside(self._giving.in_whose_way(self.context.pose(), self._footprint))
            return True
        if waits and self._giving.ahead_of_us():
            self._phase = self._waiting_aside
            return True
        less = self._giving.less(self._avoided)
        self._avoided = less or Avoided.WAYS
        if less is None:
            return False
        self._phase = self._planning
        self._ask_for_plan()
        return True

    def _neighbour_may_go(self) -> bool:
        """Whether a failure may be due to a robot that is about, or was a moment ago, and patience lasts.

        What the costmap remembers of it is forgotten; what still stands there is seen anew.
        """
        now_s, costmap = self._now(), self.context.costmap
        if self._giving.others():
            gap_s, self._neighbour_s = now_s - self._neighbour_s, now_s
            if gap_s > self.options.after_person_s:
                self._neighbour_since_s = now_s
        recently = now_s - self._neighbour_s < self.options.after_person_s
        if not recently or now_s - self._neighbour_since_s >= self.options.giving_way.blocked_patience_s:
            return False
        self._obstacle = self._obstacle or (self._goal.x_m, self._goal.y_m)
        self._giving.wish(self.context.pose(), self._goal, self._footprint)
        if isinstance(costmap, ForgettingCostmap):
            costmap.forget_seen()
        return True

    def _persons(self) -> tuple[SeenPerson, ...]:
        """The people near; what a camera takes for one where a robot says that it stands is that robot."""
        return tuple(one for one in self._people.people() if not self._giving.is_robot(one.place_W))

    def _make_way(self) -> Step | None:
        """Go out of a way that is reserved; None where the robot stands in none, or is on its way out."""
        goes_aside = self._aside is not None and self._phase != self._waiting_aside
        if goes_aside or self._phase in (self._localising, self._settling) or self._now() < self._asked_due_s:
            return None
        first = self._giving.in_whose_way(self.context.pose(), self._footprint)
        if not first:
            return None
        self._base.stop()
        self._tried = ()
        self._go_aside(first)
        return Running(f"making way for {', '.join(first)}")

    def _go_aside(self, first: Sequence[str]) -> None:
        """Go to the nearest waiting place; where none is left to try, change turns, so that the others make way."""
        here, place = self.context.pose(), None
        if len(self._tried) < self.options.giving_way.places:
            place = self._giving.waiting_place(self.context.costmap, self._footprint, here, self._tried)
        if place is None:
            self._giving.let_pass(first)
            self._asked_due_s = self._now() + self.options.giving_way.again_s
        self._aside, self._avoided, self._waits = place, Avoided.WAYS, False
        self._best_m, self._best_s = math.inf, self._now()
        self._phase = self._planning
        self._ask_for_plan()

    def _waiting_aside(self) -> Step:
        """Stand at a waiting place until there is a way that nobody has reserved."""
        self._look_out()
        self._giving.stand(self.context.pose(), self._footprint)
        self._best_s = self._now()
        if self._giving.ahead_of_us() and self._now() < self._wait_until_s:
            return Running("waiting aside for another robot to pass")
        self._wait_until_s = self._now() + self.options.giving_way.again_s
        self._aside, self._avoided, self._phase, self._waits = None, Avoided.WAYS, self._planning, True
        self._ask_for_plan()
        return Running("planning a path")

    def _give_way(self, follower: LocalController) -> tuple[float, Step | None]:
        """How fast others' rights let the robot go (m/s), and what it does while it stands for them."""
        self._giving.announce(follower, self._footprint)
        if self._aside is not None:
            return math.inf, None
        options, conflict = self.options.giving_way, self._giving.conflict_m(follower, self._footprint)
        if conflict is None:
            name = self._giving.room_for(follower, self._footprint)
            return (math.inf, None) if name is None else (0.0, self._waits_for(name, "to make way"))
        way_m, name = conflict
        left_m = way_m - options.short_m
        if left_m > 0.02:
            return math.sqrt(2.0 * 0.4 * left_m), None
        if self._job is None and self._now() >= self._around_due_s:
            self._avoided, self._around_due_s = Avoided.WAYS, self._now() + 2.0 * options.again_s
            self._ask_for_plan()
        return 0.0, self._waits_for(name, "to pass")

    def _waits_for(self, name: str, what: str) -> Step:
        self._best_s, self._blocked_since_s = self._now(), None
        return Running(f"waiting for {name} {what}")

    def _waiting_sentence(self) -> str:
        place = _xy(self._obstacle) if self._obstacle else "ahead"
        return f"waiting for the way to become free at {place}"

    def _following(self) -> Step:
        """Drive along the path, slowly near people; replan around what stays in the way."""
        self._look_out()
        failure = self._take_plan()
        if failure is not None or self._phase != self._following or self._follower is None:
            return failure or Running(self._waiting_sentence())
        if self._lost_since_s is not None:
            self._base.drive((0.0, 0.0, 0.0))
            return Running("standing until scans agree with the map again")
        pose, velocity = self.context.pose(), self.context.robot.odometry().velocity
        danger = self._guard.danger(pose, self._follower, self._inputs.max_speed_m_s)
        if danger is not None:
            return self._stand_at_once(danger)
        pace = self._paced(self._follower, pose)
        most_m_s, waits = self._give_way(self._follower)
        if self._phase != self._following:
            return waits or Running("making way")
        costmap, most_m_s = self._costmap(pose), min(most_m_s, pace.most_m_s)
        answer = self._follower.command(pose, velocity, self._base.last_velocity, costmap, most_m_s)
        self._base.drive(answer.velocity)
        if waits is not None:
            return waits
        if pace.waiting and pace.person is not None:
            return self._wait_for_person(pace, pace.person.place_W)
        if self._aside is not None and self._arrived(pose, 1.0):
            self._base.stop()
            self._wait_until_s = self._now() + self.options.giving_way.again_s
            self._phase = self._waiting_aside
            return Running("waiting aside for another robot to pass")
        if self._arrived(pose, 0.4):
            self._wait_until_s = self._now() + self.options.settle_s
            self._phase = self._settling
            return Running("stopping at the goal", 1.0)
        self._note_block(answer.blocked_at)
        trouble = self._trouble(answer.remaining_m, answer.off_path_m)
        if trouble is not None and self._job is None:
            return self._replan(trouble)
        self._review(self._follower, costmap)
        self._review_outline()
        return self._progress(answer.remaining_m)

    def _stand_at_once(self, place_W: tuple[float, float]) -> Step:
        """Brake as hard as the robot can, and stand."""
        self._base.stop()
        self._best_s = self._now()
        return Running(f"standing, since something comes into the way at {_xy(place_W)}")

    def _paced(self, follower: LocalController, pose: Pose2D) -> Pace:
        """How fast people near the way let the robot go."""
        ahead = follower.ahead(self.options.space.look_ahead_m)
        people, most_m_s = self._persons(), self._inputs.max_speed_m_s
        return self._pace.pace(self._now(), pose, ahead, people, most_m_s, self._goal)

    def _wait_for_person(self, pace: Pace, place_W: tuple[float, float]) -> Step:
        """Stand; once that has taken long, plan around whoever stands there."""
        self._best_s, self._obstacle, self._blocked_since_s = self._now(), place_W, None
        if pace.overdue and self._job is None:
            return self._replan(f"Somebody stays in the way at {_xy(place_W)}.")
        return Running(f"waiting for a person at {_xy(place_W)}")

    def _progress(self, remaining_m: float) -> Running:
        done = 1.0 - remaining_m / max(self._whole_m or remaining_m, remaining_m, 1e-3)
        return Running(f"on the way, {remaining_m:.1f} m to go", min(1.0, max(0.0, done)))

    def _note_block(self, blocked_at: tuple[float, float] | None) -> None:
        if blocked_at is None:
            self._blocked_since_s = None
            return
        self._obstacle = blocked_at
        self._blocked_since_s = self._now() if self._blocked_since_s is None else self._blocked_since_s

    def _trouble(self, remaining_m: float, off_path_m: float) -> str | None:
        """Why the path should be given up, None when all goes well."""
        now = self._now()
        if remaining_m < self._best_m - 0.03:
            self._best_m, self._best_s = remaining_m, now
        if self._blocked_since_s is not None and now - self._blocked_since_s > self.options.blocked_patience_s:
            return f"The way is blocked by something seen at {_xy(self._obstacle)}."
        if off_path_m > self.context.stack.controller.lost_path_m:
            return f"The robot is {off_path_m:.2f} m off its path."
        if now - self._best_s > self.options.stuck_s:
            return "The robot does not get on."
        return None

    def _review(self, follower: LocalController, costmap: Costmap) -> None:
        """Plan anew, while the robot drives on, once what is seen leaves the path too little clearance."""
        through = self._avoided is Avoided.WORKING and self._aside is None
        if through or self._job is not None or not self.options.review_m or self._now() < self._review_due_s:
            return
        self._review_due_s = self._now() + self.options.review_s
        ahead = follower.ahead(self.options.review_m)
        clearance = footprint_clearance_m(costmap, self._footprint, ahead)
        blocked = np.flatnonzero(clearance < min(_REVIEWED_M, float(clearance[0]) - 0.01))
        if len(blocked):
            self._obstacle = (float(ahead[blocked[0], 0]), float(ahead[blocked[0], 1]))
            self._ask_for_plan(self._pose_then())

    def _review_outline(self) -> None:
        """Plan anew, while the robot drives on, once its arm or what it carries reaches farther than planned for."""
        if self._job is not None or self._now() < self._outline_due_s:
            return
        self._outline_due_s = self._now() + _OUTLINE_PERIOD_S
        if self._outline.outgrows(self._footprint):
            self._ask_for_plan(self._pose_then())

    def _replan(self, why: str) -> Step:
        """Plan anew from here; fail when that was done too often."""
        self._replans += not self._giving.somebody_goes()
        self._avoided = Avoided.WAYS
        if self._replans > self.options.replans:
            self._base.stop()
            return Failed(Cause.EXECUTION, f"{why} Planning anew {self.options.replans} times did not help.")
        self._best_m, self._best_s = math.inf, self._now()
        self._blocked_since_s = None
        self._ask_for_plan(self._pose_then())
        return Running(f"{why} Planning a way around.")

    def _pose_then(self) -> Pose2D | None:
        """Where the old path will have led when a plan asked for now is there; None when the robot is off it."""
        if self._follower is None:
            return None
        vx, vy, _ = self.context.robot.odometry().velocity
        then = self._follower.pose_after(math.hypot(vx, vy) * self.options.planning_latency_s)
        off = relative(self.context.pose(), then)
        return then if math.hypot(off.x_m, off.y_m) < 0.35 and abs(off.yaw_rad) < 0.3 else None

    def _arrived(self, pose: Pose2D, share: float) -> bool:
        """Whether a pose lies within a share of the tolerances of the goal."""
        off = relative(self._goal, pose)
        near = math.hypot(off.x_m, off.y_m) <= share * self._inputs.position_tolerance_m
        return near and abs(off.yaw_rad) <= share * self._inputs.yaw_tolerance_rad

    def _settling(self) -> Step:
        """Come to rest, then look whether the robot really is there."""
        self._base.drive((0.0, 0.0, 0.0))
        vx, vy, wz = self.context.robot.odometry().velocity
        still = math.hypot(vx, vy) < self.options.still_m_s and abs(wz) < self.options.still_rad_s
        if not still and self._now() < self._wait_until_s:
            return Running("stopping at the goal", 1.0)
        self._base.stop()
        off = relative(self._inputs.goal, self.context.pose())
        sentence = f"{math.hypot(off.x_m, off.y_m):.2f} m and {abs(off.yaw_rad):.2f} rad off the goal"
        if not still:
            return Failed(Cause.POSTCONDITION, f"The robot does not come to rest; it is {sentence}.")
        if not self._arrived(self.context.pose(), 1.0):
            return Failed(Cause.POSTCONDITION, f"The robot stands {sentence}.")
        return Succeeded(f"standing {sentence}")


def _xy(place: tuple[float, float] | None) -> str:
    return "an unknown place" if place is None else f"({place[0]:.2f}, {place[1]:.2f})"
