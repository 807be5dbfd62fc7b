"""An auction of missions among robots: each goes to the robot that is done with it first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

__all__ = ["Award", "Bid", "award"]


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
    """Give each mission to one robot, one after another: always the one that is done first, by what the robots have
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
