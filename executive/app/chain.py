"""A mission that no robot can do alone, in two parts for two robots, which hand over what is held by a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from executive.app.auction import Bid
from executive.words.command import Command, Task

__all__ = ["Chain", "Split", "soonest", "splits"]


@dataclass(frozen=True)
class Split:
    """The commands of a mission in two parts; the second takes from the `table` what the first puts there (None: the
    gripper is empty between the two)."""

    first: tuple[Command, ...]
    second: tuple[Command, ...]
    table: str | None = None


@dataclass(frozen=True)
class Chain:
    """A split with the bids of two robots for its parts, done at `ends_s` (s from now)."""

    split: Split
    first: Bid
    second: Bid

    @property
    def ends_s(self) -> float:
        """When the second is done, which begins when the first is."""
        begins_s = max(self.first.ready_s + self.first.duration_s, self.second.ready_s)
        return begins_s + self.second.duration_s


def splits(commands: Sequence[Command], tables: Iterable[str]) -> Iterator[Split]:
    """All ways to do a mission of plain commands in two parts, one after the other."""
    own = tuple(commands)
    for number in range(1, len(own)):
        before, after = own[number - 1], own[number]
        if after.item is None:
            yield Split(own[:number], own[number:])
        elif before.task is Task.GRASP and before.object == after.item:
            thing, count = after.item, after.item_count
            for table in tables:
                put = Command(item=thing, goal=table, item_count=count)
                take = Command(goal=table, task=Task.GRASP, object=thing, object_count=count)
                yield Split((*own[:number], put), (take, *own[number:]), table)


def soonest(split: Split, first: Iterable[Bid], second: Sequence[Bid]) -> Chain | None:
    """The chain of two different robots that is done first; None: no two robots can do it."""
    able = [(a, b) for a in first for b in second if not a.problems and not b.problems and a.robot != b.robot]
    chains = [Chain(split, a, b) for a, b in able]
    return min(chains, key=lambda chain: (chain.ends_s, chain.first.robot, chain.second.robot), default=None)
