"""The plans of one trip: asks the planner for them, and decides what is tried after one failed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skills.api import Cause, ForgettingCostmap, Job, SkillContext
from skills.geometry import compose
from skills.navigate.cut_off import closed_sentence
from skills.navigate.giving_way import Avoided
from skills.navigate.navigate_options import NavigateOptions
from skills.navigate.path import Path
from skills.navigate.ports import NavigateInputs
from skills.navigate.surroundings import Surroundings
from skills.patience import Patience
from skills.robot import Pose2D
from skills.routine import SkillFailure

__all__ = ["TripPlanning", "place_text"]


@dataclass
class _Lately:
    """Whether somebody was near within the last gap_s, who may be why a plan fails, and has not been for too long."""

    gap_s: float
    last_s: float = -math.inf
    since_s: float = -math.inf

    def note(self, now_s: float) -> None:
        """Somebody is near now."""
        self.since_s = now_s if now_s - self.last_s > self.gap_s else self.since_s
        self.last_s = now_s

    def may_go(self, now_s: float, patience_s: float) -> bool:
        """Whether it is worth waiting for them."""
        return now_s - self.last_s < self.gap_s and now_s - self.since_s < patience_s


class TripPlanning:
    """The plans of one trip.

    `aside` is the pose to which the robot goes to let others pass, None on its way to the goal; `avoided` what plans
    lead around of other robots; `obstacle_W` the last place (x, y) that was found blocked. The next plan is not asked
    for before `wait_until_s`.
    """

    def __init__(
        self, context: SkillContext, options: NavigateOptions, inputs: NavigateInputs, around: Surroundings
    ) -> None:
        self._context, self._options, self._inputs, self._around = context, options, inputs, around
        self._job: Job[Path] | None = None
        self._map_alone = self._map_leads = self._seen_anew = self._waited = False
        self._replans = 0
        self._people, self._robots = _Lately(options.after_person_s), _Lately(options.after_person_s)
        self._closed = Patience(context.clock, options.doors.patience_s)
        self._tried: tuple[Pose2D, ...] = ()
        self._asked_due_s = -math.inf
        self.aside: Pose2D | None = None
        self.avoided = Avoided.WAYS
        self.obstacle_W: tuple[float, float] | None = None
        self.wait_until_s = -math.inf

    @property
    def goal(self) -> Pose2D:
        """Where the robot goes just now: the goal, or a place where it waits for others to pass."""
        return self.aside or self._inputs.goal

    @property
    def under_way(self) -> bool:
        """Whether a plan was asked for and not taken yet."""
        return self._job is not None

    def ask(self, start: Pose2D | None = None, *, map_alone: bool = False) -> None:
        """Sample the costmap now and plan in the Worker, from a pose or from here.

        `map_alone`: as if nobody stood about, only to see whether there is a way.
        """
        context, around = self._context, self._around
        around.look_anew()
        begin, self._map_alone = start or context.pose(), map_alone
        avoided = self.avoided if self.aside is None else Avoided.BODIES
        plan = context.stack.planner.problem(
            context.costmap if map_alone else around.costmap(begin, self.goal, avoided),
            around.footprint,
            begin,
            self.goal,
            max_speed_m_s=max(0.1, self._inputs.max_speed_m_s),
            work=context.work,
        )
        self._job = context.worker.submit(plan, latency_s=self._options.planning_latency_s, name="plan a path")

    def path(self) -> Path | None:
        """The path of a plan that is done, once; None: there is none to follow. Raises PlanningError."""
        if self._job is None or not self._job.done():
            return None
        job, self._job = self._job, None
        path = job.result()
        if self._map_alone:
            self._map_alone, self._map_leads = False, True
            self.wait_until_s = self._now() + self._options.replan_pause_s
            return None
        self.obstacle_W, self._waited = None, False
        return path

    def plan_again(self, why: str, start: Pose2D | None) -> None:
        """Plan anew, since the path does not do. Raises SkillFailure: that was done too often."""
        self._replans += not self._around.robots.somebody_goes()
        self.avoided = Avoided.WAYS
        if self._replans > self._options.replans:
            text = f"{why} Planning anew {self._options.replans} times did not help."
            raise SkillFailure(Cause.EXECUTION, text)
        self.ask(start)

    def try_instead(self, why: str) -> bool:
        """Decide what is done after a plan failed, and whether the robot waits aside before it plans again.

        Raises SkillFailure: nothing is left to try.
        """
        if self._map_alone:  # nobody is in the way: there is none
            raise SkillFailure(Cause.PLANNING, why)
        waited, self._waited = self._waited, False
        if waited and self.aside is None and self._around.robots.ahead_of_us():
            return True
        if not (self._goes_around_less() or self._around.comes_nearer()):
            self._wait_or_give_up(why)
        return False

    def go_aside(self, first: Sequence[str], *, anew: bool = False) -> None:
        """Plan to the nearest waiting place; where none is left to try, change turns, so that the others make way.

        `anew`: no place was tried yet.
        """
        context, robots = self._context, self._around.robots
        self._tried = () if anew else self._tried
        place = None
        if len(self._tried) < self._options.giving_way.places:
            place = robots.waiting_place(context.costmap, self._around.footprint, context.pose(), self._tried)
        if place is None:
            robots.let_pass(first)
            self._asked_due_s = self._now() + self._options.giving_way.again_s
        self.aside, self.avoided, self._waited = place, Avoided.WAYS, False
        self.ask()

    def go_on(self) -> None:
        """Plan to the goal after waiting aside."""
        self.wait_until_s = self._now() + self._options.giving_way.again_s
        self.aside, self.avoided, self._waited = None, Avoided.WAYS, True
        self.ask()

    def in_whose_way(self) -> Sequence[str]:
        """The robots for which this one has to make way, where it stands now; none for a while after it could not."""
        if self._now() < self._asked_due_s:
            return ()
        return self._around.robots.in_whose_way(self._context.pose(), self._around.footprint)

    def _now(self) -> float:
        return self._context.clock.now()

    @property
    def _goals(self) -> tuple[Pose2D, ...]:
        """The goal, and the poses nearby that will do as well."""
        goal = self._inputs.goal
        return (goal, *(compose(goal, Pose2D(*offset, 0.0)) for offset in self._inputs.nearby_m))

    def _goes_around_less(self) -> bool:
        """Whether a plan is asked for that avoids less of other robots, or leads to another waiting place."""
        robots = self._around.robots
        if self.aside is not None:
            self._tried = (*self._tried, self.aside)
            self.go_aside(robots.in_whose_way(self._context.pose(), self._around.footprint))
            return True
        less = robots.less(self.avoided)
        self.avoided = less or Avoided.WAYS
        if less is not None:
            self.ask()
        return less is not None

    def _wait_or_give_up(self, why: str) -> None:
        """Wait for what may go away, and see it anew; at the bound raise SkillFailure."""
        robot = self._robot_may_go()
        may_go = robot or self._people_may_go()
        if not robot and self._waits_for_doors():
            return
        self._replans += not may_go
        if self._replans < self._options.replans and self._around.doors.forget_distant(self._context.pose()):
            self.ask()
            return
        if not may_go and self._sees_anew():
            return
        if self.obstacle_W is None or self._replans >= self._options.replans:
            who = self._around.robots.name_at(self.obstacle_W) or "something seen"
            seen = f" The way is blocked by {who} at {place_text(self.obstacle_W)}." if self.obstacle_W else ""
            final = not may_go and self._around.cut_off(self._goals)
            raise SkillFailure(Cause.PLANNING, why + seen, final=final)
        self.wait_until_s = self._now() + self._options.replan_pause_s
        if robot and not self._map_leads and isinstance(self._context.costmap, ForgettingCostmap):
            self.ask(map_alone=True)

    def _waits_for_doors(self) -> bool:
        """Whether closed doors leave no path, and may still be opened. Raises SkillFailure: patience is over."""
        doors, options = self._around.closed_doors(self._goals), self._options.doors
        if not doors:
            return False
        if not self._closed.is_left():
            raise SkillFailure(Cause.PLANNING, closed_sentence(doors, self._inputs.goal), final=True)
        self.obstacle_W = doors[0].middle_W
        self.wait_until_s = self._now() + options.look_s
        return True

    def _sees_anew(self) -> bool:
        """Forget once what was seen and look again, before the goal is taken for cut off by it."""
        if self._seen_anew or not self._around.cut_off(self._goals):
            return False
        self._seen_anew = True
        if not self._around.forget():
            return False
        self.wait_until_s = self._now() + self._options.doors.look_s
        return True

    def _people_may_go(self) -> bool:
        """Whether a failure may be due to people who are near or were a moment ago, and patience lasts."""
        if self._around.persons():
            self._people.note(self._now())
        return self._people.may_go(self._now(), self._options.person_patience_s)

    def _robot_may_go(self) -> bool:
        """Whether a failure may be due to a robot that is about, or was a moment ago, and patience lasts.

        What the costmap remembers of it is forgotten; what still stands there is seen anew.
        """
        if self._around.robots.others():
            self._robots.note(self._now())
        if not self._robots.may_go(self._now(), self._options.giving_way.blocked_patience_s):
            return False
        self.obstacle_W = self.obstacle_W or (self.goal.x_m, self.goal.y_m)
        self._around.robots.wish(self._context.pose(), self.goal, self._around.footprint)
        self._around.forget()
        return True


def place_text(place_W: tuple[float, float] | None) -> str:
    """ "(1.20, 5.50)"."""
    return "an unknown place" if place_W is None else f"({place_W[0]:.2f}, {place_W[1]:.2f})"
