"""Path planning for one trip: requests plans, and decides what to try after a failed plan."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skills.api import Cause, ClearableCostmap, Job, SkillContext, say
from skills.geometry import bearing_rad, compose
from skills.navigate.cut_off import closed_doors_sentence
from skills.navigate.door_openers import DoorCalls
from skills.navigate.giving_way import Avoided
from skills.navigate.planner import LatticePlanner, xy_text
from skills.navigate.surroundings import NavigateInputs, NavigateOptions, Surroundings
from skills.path import Path
from skills.perception.people import SeenPerson
from skills.robot import Pose2D
from skills.routine import Patience, SkillFailure
from skills.world_model import zones_sentence

EARSHOT_M = 3.0
"""Distance up to which a person who leaves no path is asked to make way."""
_CLOSE_M = 1.4
"""Distance up to which a person is asked although there may be another path."""
_AHEAD_RAD = 1.0
"""Bearing to either side up to which a close person may block the robot."""
_AT_GOAL_M = 0.8
"""Distance from the goal within which a person close ahead does not block the robot, but may be whom it meets."""
_BESIDE_M, _BEHIND_GOAL_M = 0.7, 0.4
"""Distance from the path within which a person blocks it, and from its end within which nobody does."""
_PERSON_M = 0.45
"""Radius of a person's obstacles."""

ASKS_S = 8.0
"""Time for which the robot stands before a person until it asks, and until it asks again or gives up."""
TIMES = 2
_STANDS_M = 0.3
"""Distance within which the robot counts as standing."""
_LEFT_M = 0.4
"""Distance of everybody from where the person stood from which on that person has made way."""


class PassRequest:
    """Asks the person who blocks a standing robot; call `update` at each tick."""

    def __init__(self, context: SkillContext) -> None:
        self._context, self._here, self._tick_s = context, Pose2D(0.0, 0.0, 0.0), -math.inf
        self._since_s, self._asked, self._person_W = -math.inf, 0, (0.0, 0.0)

    @property
    def refused(self) -> bool:
        """Returns whether the person has stayed after every request."""
        return self._asked >= TIMES and self._context.clock.now() - self._since_s >= ASKS_S

    @property
    def awaited_W(self) -> tuple[float, float] | None:
        """Position of the person who has just been asked; None when the robot waits for no answer."""
        waits = self._asked > 0 and self._context.clock.now() - self._since_s < ASKS_S
        return self._person_W if waits else None

    def update(self, find: Callable[[], SeenPerson | None], people: Callable[[], Sequence[SeenPerson]]) -> None:
        """Asks the person whom `find` returns once the robot has stood for `ASKS_S`; thanks a person who made way."""
        now_s, here = self._context.clock.now(), self._context.pose()
        goes_on, self._tick_s = now_s - self._tick_s < ASKS_S, now_s
        if not goes_on or math.dist((here.x_m, here.y_m), (self._here.x_m, self._here.y_m)) > _STANDS_M:
            if goes_on and self._asked and all(math.dist(one.place_W, self._person_W) > _LEFT_M for one in people()):
                say(self._context, "Thank you.")
            self._here, self._since_s, self._asked = here, now_s, 0
        elif now_s - self._since_s >= ASKS_S and self._asked < TIMES:
            self._since_s = now_s
            if (blocker := find()) is not None:
                say(self._context, "May I pass, please?")
                self._asked, self._person_W = self._asked + 1, blocker.place_W


@dataclass
class _Presence:
    """Presence of people or robots that may leave: last seen within `gap_s`, and not for too long already."""

    gap_s: float
    last_s: float = -math.inf
    since_s: float = -math.inf

    def note(self, now_s: float) -> None:
        """Notes that a person or robot is near now."""
        self.since_s = now_s if now_s - self.last_s > self.gap_s else self.since_s
        self.last_s = now_s

    def may_go(self, now_s: float, patience_s: float) -> bool:
        """Returns whether they were near within `gap_s`, and have been near for less than `patience_s`."""
        return now_s - self.last_s < self.gap_s and now_s - self.since_s < patience_s


class TripPlanning:
    """Requests the plans for one trip.

    `aside` is the robot's waiting pose while others pass; None on the way to the goal. `avoided` says what plans avoid
    of other robots. `obstacle_W` is the last blocked point (x, y). The trip requests no plan before `wait_until_s`.
    """

    def __init__(
        self, context: SkillContext, options: NavigateOptions, inputs: NavigateInputs, around: Surroundings
    ) -> None:
        self._context, self._options, self._inputs, self._around = context, options, inputs, around
        self._job: Job[Path] | None = None
        self._map_path: Path | None = None
        self._map_alone = self._looked_again = self._waited = self._detours = False
        self._suspected = False
        self._replans = 0
        self._people, self._robots = _Presence(options.after_person_s), _Presence(options.after_person_s)
        self._closed = Patience(context.clock, options.doors.patience_s)
        self._calls = DoorCalls(context, options.doors.opens_s)
        self._tried: tuple[Pose2D, ...] = ()
        self._asked_due_s = -math.inf
        self.pass_request = PassRequest(context)
        self.aside: Pose2D | None = None
        self.avoided = Avoided.PATHS
        self.obstacle_W: tuple[float, float] | None = None
        self.wait_until_s = -math.inf

    @property
    def goal(self) -> Pose2D:
        """The present goal: the waiting pose if there is one, else the goal of the inputs."""
        return self.aside or self._inputs.goal

    def blocker(self) -> SeenPerson | None:
        """The person who blocks the robot: in earshot on the path that the map alone gives, without one close ahead."""
        return self._around.nearest_person(_CLOSE_M if self._map_path is None else EARSHOT_M, self._blocks)

    def _blocks(self, person: SeenPerson) -> bool:
        goal_W = np.array((self.goal.x_m, self.goal.y_m))
        if self._map_path is None:
            ahead = abs(bearing_rad(self._context.pose(), person.place_W)) < _AHEAD_RAD
            return ahead and math.dist(person.place_W, goal_W) >= _AT_GOAL_M
        places = self._map_path.poses[:, :2]
        away_m = np.linalg.norm(places - person.place_W, axis=1)
        return bool(away_m.min() < _BESIDE_M and math.dist(places[away_m.argmin()], goal_W) > _BEHIND_GOAL_M)

    @property
    def under_way(self) -> bool:
        """Returns whether a plan has been requested and its path not yet fetched."""
        return self._job is not None

    def ask(self, start: Pose2D | None = None, *, map_alone: bool = False) -> None:
        """Samples the costmap now and plans in the Worker, from `start` or from the present pose.

        With `map_alone` the plan ignores people and robots, to find out whether a path exists at all.
        """
        context, around = self._context, self._around
        around.refresh()
        self._check_zones()
        begin, self._map_alone = start or context.pose(), map_alone
        avoided = self.avoided if self.aside is None else Avoided.BODIES
        planner = context.stack.planner
        if self._detours and isinstance(planner, LatticePlanner):
            planner = replace(planner, around_m=around.doors.detour_margin_m(begin, self.goal))
        plan = planner.problem(
            around.free_space() if map_alone else around.costmap(begin, self.goal, avoided),
            around.footprint,
            begin,
            self.goal,
            max_speed_m_s=max(0.1, self._inputs.max_speed_m_s),
            work=context.work,
            **around.zone_costs(begin),
        )
        self._job = context.worker.submit(plan, latency_s=self._options.planning_latency_s, name="plan a path")

    def retarget(self, inputs: NavigateInputs, start: Pose2D | None) -> None:
        """Plans to another goal, unless the robot waits aside, and forgets earlier failures."""
        self._inputs, self._replans, self._map_path, self.wait_until_s = inputs, 0, None, -math.inf
        self._suspected = False
        if self.aside is None:
            self.avoided = Avoided.PATHS
            self.ask(start)

    def _check_zones(self) -> None:
        """Raises SkillFailure when the body would reach into a keep-out zone at the goal."""
        zones = self._around.forbidding_zones(self._inputs.goal)
        if zones:
            sentence = (
                f"{zones_sentence(zones, 'keep-out zone')} The robot does not stand at {xy_text(self._inputs.goal)}."
            )
            raise SkillFailure(Cause.PLANNING, sentence, final=all(map(self._around.forbidding_zones, self._goals)))

    def path(self) -> Path | None:
        """The path of a finished plan, returned once, or None. Raises PlanningError when the plan has failed."""
        if self._job is None or not self._job.done():
            return None
        job, self._job = self._job, None
        path = job.result()
        if self._map_alone:
            self._map_alone, self._map_path = False, path
            self.wait_until_s = self._now() + self._options.replan_pause_s
            return None
        self.obstacle_W, self._waited = None, False
        return path

    def plan_again(self, why: str, start: Pose2D | None) -> None:
        """Requests another plan because the path failed for the reason `why`. Raises SkillFailure after too many."""
        self._replans += not self._around.robots.another_drives()
        self.avoided = Avoided.PATHS
        if self._replans > self._options.replans:
            text = f"{why} Planning again {self._options.replans} times did not help."
            raise SkillFailure(Cause.EXECUTION, text)
        self.ask(start)

    def try_instead(self, why: str) -> bool:
        """Decides what to try after a plan failed; returns whether the robot waits aside before the next plan.

        Raises SkillFailure when nothing is left to try.
        """
        if self._map_alone and not self._suspected:  # nobody blocks this plan, so no path exists
            raise SkillFailure(Cause.PLANNING, why)
        self._map_alone = False
        waited, self._waited = self._waited, False
        if waited and self.aside is None and self._around.robots.robots_with_priority():
            return True
        if not (self._asks_for_less() or self._around.reduce_distance_to_people()):
            self._wait_or_give_up(why)
        return False

    def go_aside(self, first: Sequence[str], *, forget: bool = False) -> None:
        """Plans to the nearest untried waiting pose; without one, lets the robots `first` clear the path instead.

        With `forget` all waiting poses count as untried.
        """
        context, robots = self._context, self._around.robots
        self._tried = () if forget else self._tried
        place = None
        if len(self._tried) < self._options.giving_way.places:
            place = robots.waiting_pose(self._around.free_space(), self._around.footprint, context.pose(), self._tried)
        if place is None:
            robots.let_pass(first)
            self._asked_due_s = self._now() + self._options.giving_way.again_s
        self.aside, self.avoided, self._waited = place, Avoided.PATHS, False
        self.ask()

    def go_on(self) -> None:
        """Plans to the goal again after waiting aside."""
        self.wait_until_s = self._now() + self._options.giving_way.again_s
        self.aside, self.avoided, self._waited = None, Avoided.PATHS, True
        self.ask()

    def robots_blocked(self) -> Sequence[str]:
        """Names of the robots whose reserved path this one blocks; empty for a while after it found no waiting pose."""
        if self._now() < self._asked_due_s:
            return ()
        return self._around.robots.blocked_robots(self._context.pose(), self._around.footprint)

    def _now(self) -> float:
        return self._context.clock.now()

    @property
    def _goals(self) -> tuple[Pose2D, ...]:
        """The goal, and the poses near it that count as reached too."""
        goal = self._inputs.goal
        return (goal, *(compose(goal, Pose2D(*offset, 0.0)) for offset in self._inputs.nearby_m))

    def _asks_for_less(self) -> bool:
        """Requests a plan that avoids less, or a plan to another waiting pose; returns whether it requested one."""
        robots = self._around.robots
        if self.aside is not None:
            self._tried = (*self._tried, self.aside)
            self.go_aside(robots.blocked_robots(self._context.pose(), self._around.footprint))
            return True
        less = robots.less_avoided(self.avoided)
        self.avoided = less or Avoided.PATHS
        if less is not None:
            self.ask()
        return less is not None

    def _wait_or_give_up(self, why: str) -> None:
        """Waits for people, robots or doors, or looks again. Raises SkillFailure when patience or tries are used up."""
        robot = self._robot_may_go()
        if not robot and self._waits_for_blocker():
            return
        may_go = robot or self._people_may_go()
        if not robot and (self._waits_for_doors(may_go) or self._plans_detour()):
            return
        self._replans += not may_go
        if self._replans < self._options.replans and self._around.doors.forget_distant(self._context.pose()):
            self.ask()
            return
        if not may_go and self._looks_again():
            return
        if self.obstacle_W is None or self._replans >= self._options.replans:
            zones = () if may_go else self._around.zones_between(self._goals)
            if zones:
                sentence = f"{zones_sentence(zones, 'keep-out zone')} No path leads to {xy_text(self._inputs.goal)}."
                raise SkillFailure(Cause.PLANNING, sentence, final=True)
            who = self._around.robots.name_at(self.obstacle_W) or "an obstacle"
            seen = f" The path is blocked by {who} at {place_text(self.obstacle_W)}." if self.obstacle_W else ""
            final = not may_go and self._around.cut_off(self._goals)
            raise SkillFailure(Cause.PLANNING, why + seen, final=final)
        self.wait_until_s = self._now() + self._options.replan_pause_s
        if robot and self._map_path is None and isinstance(self._context.costmap, ClearableCostmap):
            self.ask(map_alone=True)

    def _waits_for_blocker(self) -> bool:
        """Returns whether the robot waits for a person without whom there is a path, and who can still be asked.

        Raises SkillFailure when the person has not made way.
        """
        person, costmap = self.blocker(), self._context.costmap
        if not self._suspected and self._map_path is None:
            person = self._around.nearest_person(EARSHOT_M, lambda one: True)
        if not isinstance(costmap, ClearableCostmap) or (self._suspected and self._map_path is None):
            return False
        if person is None and (left_W := self.pass_request.awaited_W) is not None:
            costmap.clear_obstacles(np.array([[*left_W, _PERSON_M]]))  # the LiDAR may not see that they have left
            self.wait_until_s = self._now() + self._options.doors.look_s
        if person is None:
            return self._now() < self.wait_until_s
        if self.pass_request.refused and not self._around.persons():  # an obstacle with the shape of a person
            return False
        if self.pass_request.refused:
            text = f"A person at {place_text(person.place_W)} blocks the path, and does not let the robot pass."
            raise SkillFailure(Cause.PLANNING, text, final=True)
        self.obstacle_W, self.wait_until_s = person.place_W, self._now() + self._options.replan_pause_s
        if not self._suspected:
            self._suspected = True
            costmap.clear_obstacles(np.array([[*person.place_W, _PERSON_M]]))
            self.ask(map_alone=True)
        return True

    def _waits_for_doors(self, may_go: bool) -> bool:
        """Returns whether the robot goes to the blocking doors or waits for them; calls the doors' plug-ins.

        Raises SkillFailure once patience is over.
        """
        options, no_detour = self._options.doors, self._detours and not may_go
        doors = self._around.closed_doors(self._goals, on_path=no_detour)
        if not doors:
            return False
        if self._around.doors.doubt(doors):
            self.ask()
            return True
        if not self._calls.may_open(doors) and not self._closed.is_left():
            sentence = f"{closed_doors_sentence(doors, self._inputs.goal)} {self._calls.reasons(doors)}".strip()
            raise SkillFailure(Cause.PLANNING, sentence, final=True)
        self.obstacle_W = doors[0].middle_W
        self.wait_until_s = self._now() + options.look_s
        return True

    def _plans_detour(self) -> bool:
        """Requests plans with a wide detour around closed doors; False when none is closed or this was done before."""
        if self._detours or not self._around.doors.closed:
            return False
        self._detours = True
        self.ask()
        return True

    def _looks_again(self) -> bool:
        """Clears the obstacle layer once before the goal counts as unreachable; returns whether cells were cleared."""
        if self._looked_again or not self._around.cut_off(self._goals):
            return False
        self._looked_again = True
        if not self._around.clear_obstacles():
            return False
        self.wait_until_s = self._now() + self._options.doors.look_s
        return True

    def _people_may_go(self) -> bool:
        """Returns whether people are near who may leave soon."""
        if self._around.persons():
            self._people.note(self._now())
        return self._people.may_go(self._now(), self._options.person_patience_s)

    def _robot_may_go(self) -> bool:
        """Returns whether a robot is near that may leave soon; then reserves the goal and clears the obstacle layer."""
        if self._around.robots.others():
            self._robots.note(self._now())
        if not self._robots.may_go(self._now(), self._options.giving_way.blocked_patience_s):
            return False
        self.obstacle_W = self.obstacle_W or (self.goal.x_m, self.goal.y_m)
        self._around.robots.reserve_poses(self._around.footprint, self._context.pose(), self.goal)
        self._around.clear_obstacles()
        return True


def place_text(place_W: tuple[float, float] | None) -> str:
    """Position for a message: "(1.20, 5.50)"."""
    return "an unknown place" if place_W is None else f"({place_W[0]:.2f}, {place_W[1]:.2f})"
