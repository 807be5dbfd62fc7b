"""An auction of missions among robots: each goes to the robot that is done with it first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Bid:
    """What one robot offers for one mission.

    It is free in `ready_s` (s from now), takes `duration_s` from there, and has `charge` (0 to 1) left afterwards.
    `problems` are sentences that say why it cannot do it; such a bid never wins. With `charges` it would have to charge
    first, which `duration_s` includes.
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
    """A mission that goes to a robot, which is done with it at `ends_s` (s from now); `first`: it begins right away
    after what the robot does now, or when it has charged, where it `charges` before."""

    mission: int
    robot: str
    ends_s: float
    first: bool
    charges: bool = False


def award(bids: Iterable[Bid]) -> Sequence[Award]:
    """Gives each mission to one robot, one after another: always the one that is done first, by what the robots have
    to do by then; among equals the lower number, then the name. Missions that nobody can do are not among them.
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
    """What one round of the auction brings: missions that begin now, why nobody can do some others, and robots that
    charge before they begin theirs."""

    begun: Sequence[Award]
    refused: Mapping[int, str]
    charging: Sequence[str] = ()


class Auction:
    """Gives each mission to one robot at a time. No mission is given out again once it is over.

    `waiting` are the missions that no robot has, `robots` those that can be given work, and `under_way` the mission of
    each robot that has one. Those that are `resting` charge: they bid, and begin nothing meanwhile.
    """

    def __init__(
        self, missions: Iterable[int], robots: Iterable[str], places: PlacesOf = lambda mission: frozenset()
    ) -> None:
        """`missions` are those to be done, in the order in which they came; `robots` those that are there; `places`
        those at which a mission has work for one robot at a time."""
        self._places = places
        self.waiting: list[int] = list(dict.fromkeys(missions))
        self.robots: list[str] = list(dict.fromkeys(robots))
        self.under_way: dict[str, int] = {}
        self.resting: set[str] = set()
        self._after: dict[int, int] = {}

    def assign(self, bid: BidOf) -> Round:
        """One round of the auction, in which robots that are busy bid as well; `bid` is asked for each pair.

        A mission that goes to a busy robot, or to one that has to charge first, waits, and is put up again when any
        robot is free; so does one with work at a place where a robot is at work. Without a robot that can be given
        work, nothing is refused.
        """
        free = [robot for robot in self.robots if robot not in self.under_way and robot not in self.resting]
        taken = self._taken if free else frozenset[str]()
        up = [each for each in self.waiting if free and each not in self._after and not taken & self._places(each)]
        if not up:
            return Round((), {})
        bids = {mission: [bid(mission, robot) for robot in self.robots] for mission in up}
        awards = award(one for each in bids.values() for one in each)
        given = {each.mission for each in awards}
        refused = {mission: _why(each) for mission, each in bids.items() if mission not in given}
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
        """The places where robots are at work."""
        return frozenset[str]().union(*map(self._places, self.under_way.values()))

    def add(self, mission: int, *, after: int | None = None) -> None:
        """One more mission, which is put up when the one that it comes `after` has been done."""
        self.waiting.append(mission)
        if after is not None:
            self._after[mission] = after

    def done(self, mission: int) -> None:
        """A mission has been done: those that come after it are put up."""
        self._after = {each: before for each, before in self._after.items() if before != mission}

    def drop(self, mission: int) -> Sequence[int]:
        """A mission was not done: those that come after it are not waiting any more; their numbers."""
        dropped = [each for each, before in self._after.items() if before == mission]
        self.waiting = [each for each in self.waiting if each not in dropped]
        return [*dropped, *(later for each in dropped for later in self.drop(each))]

    def hand_back(self, robot: str) -> int:
        """The robot's mission waits for another robot, before all others; its number. Raises KeyError: it has none."""
        mission = self.under_way.pop(robot)
        self.waiting.insert(0, mission)
        return mission

    def lose(self, robot: str) -> None:
        """The robot can be given no work any more."""
        self.resting.discard(robot)
        self.robots = [each for each in self.robots if each != robot]


def _why(bids: Sequence[Bid]) -> str:
    """Why no robot can do a mission."""
    return f"no robot can do it: {'; '.join(f'{bid.robot}: {bid.problems[0]}' for bid in bids)}"
