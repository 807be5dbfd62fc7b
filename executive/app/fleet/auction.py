"""Auction of missions among robots: each mission goes to the robot that finishes it first."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Bid:
    """Bid of one robot for one mission.

    The robot is free in `ready_s` (s from now), then takes `duration_s`, and has `charge` (0 to 1) left at the end.
    `problems` are reasons why the robot cannot do the mission; a bid with problems never wins. With `charges` the robot
    charges first; `duration_s` includes this time.
    """

    mission: int
    robot: str
    ready_s: float
    duration_s: float
    charge: float = 1.0
    charges: bool = False
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Award:
    """Assignment of a mission to a robot, which finishes it at `ends_s` (s from now).

    A `first` mission is the robot's next one. With `charges` the robot charges before it.
    """

    mission: int
    robot: str
    ends_s: float
    first: bool
    charges: bool = False


def award(bids: Iterable[Bid]) -> Sequence[Award]:
    """Assigns missions greedily: the next award goes to the pair of mission and robot that ends first.

    A robot is ready again when its awarded missions end. Ties go to the lower mission number, then to the robot's name.
    Missions that no robot can do get no award.
    """
    left = [bid for bid in bids if not bid.problems]
    ready_s = {bid.robot: bid.ready_s for bid in left}
    busy: set[str] = set()
    awards: list[Award] = []
    while left:
        best = min(left, key=lambda bid: (ready_s[bid.robot] + bid.duration_s, bid.mission, bid.robot))
        ready_s[best.robot] += best.duration_s
        awards.append(Award(best.mission, best.robot, ready_s[best.robot], best.robot not in busy, best.charges))
        busy.add(best.robot)
        left = [bid for bid in left if bid.mission != best.mission]
    return awards


BidOf = Callable[[int, str], Bid]
PlacesOf = Callable[[int], frozenset[str]]


@dataclass(frozen=True)
class Round:
    """Result of one auction round: missions that begin now, refused missions with reasons, robots that charge first."""

    begun: Sequence[Award]
    refused: Mapping[int, str]
    charging: Sequence[str] = ()


class Auction:
    """Assignment of missions to robots, one mission for each robot at a time.

    `waiting` are the missions that are not assigned, `robots` the robots that can work, and `under_way` maps a robot to
    its mission. A robot in `resting` is charging: it bids, but begins no mission.
    """

    def __init__(
        self, missions: Iterable[int], robots: Iterable[str], places: PlacesOf = lambda mission: frozenset()
    ) -> None:
        """Takes the missions in the order of the queue; `places` returns the places that a mission needs alone."""
        self._places = places
        self.waiting: list[int] = list(dict.fromkeys(missions))
        self.robots: list[str] = list(dict.fromkeys(robots))
        self.under_way: dict[str, int] = {}
        self.resting: set[str] = set()
        self._after: dict[int, int] = {}

    def assign(self, bid: BidOf) -> Round:
        """Runs one round of the auction; busy robots bid as well.

        A mission waits for the next round if the winner is busy or charges first, or if another robot works at a place
        that it needs. A round without robots refuses no mission.
        """
        free = [robot for robot in self.robots if robot not in self.under_way and robot not in self.resting]
        taken = self._taken if free else frozenset[str]()
        up = [each for each in self.waiting if free and each not in self._after and not taken & self._places(each)]
        if not up:
            return Round((), {})
        bids = {mission: [bid(mission, robot) for robot in self.robots] for mission in up}
        awards = award(one for each in bids.values() for one in each)
        given = {each.mission for each in awards}
        refused = {
            mission: f"no robot can do it: {'; '.join(f'{one.robot}: {one.problems[0]}' for one in each)}"
            for mission, each in bids.items()
            if mission not in given
        }
        next_up = [each for each in awards if each.first and each.robot in free]
        begun: list[Award] = []
        for each in next_up:
            if not each.charges and not self._taken & self._places(each.mission):
                begun.append(each)
                self.under_way[each.robot] = each.mission
        charging = [each.robot for each in next_up if each.charges]
        self.resting.update(charging)
        gone = {each.mission for each in begun} | set(refused)
        self.waiting = [mission for mission in self.waiting if mission not in gone]
        return Round(begun, refused, charging)

    @property
    def _taken(self) -> frozenset[str]:
        """Places that are reserved by the missions under way."""
        return frozenset[str]().union(*map(self._places, self.under_way.values()))

    def add(self, mission: int, *, after: int | None = None) -> None:
        """Adds a mission; with `after` it waits until that mission is done."""
        self.waiting.append(mission)
        if after is not None:
            self._after[mission] = after

    def done(self, mission: int) -> None:
        """Marks a mission as done, so that the missions that wait for it can be assigned."""
        self._after = {each: before for each, before in self._after.items() if before != mission}

    def drop(self, mission: int) -> Sequence[int]:
        """Removes the missions that wait for a failed mission; returns their numbers."""
        dropped = [each for each, before in self._after.items() if before == mission]
        self.waiting = [each for each in self.waiting if each not in dropped]
        return [*dropped, *(later for each in dropped for later in self.drop(each))]

    def hand_back(self, robot: str) -> int:
        """Puts the robot's mission first in the queue; returns its number. Raises KeyError if the robot has none."""
        mission = self.under_way.pop(robot)
        self.waiting.insert(0, mission)
        return mission

    def lose(self, robot: str) -> None:
        """Removes a robot that can no longer work."""
        self.resting.discard(robot)
        self.robots = [each for each in self.robots if each != robot]
