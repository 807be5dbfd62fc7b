"""A mission that no robot can do alone, in two parts for two robots, which hand over what is held by a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from executive.app.auction import Bid
from executive.app.fleet import FleetMission, is_plain, with_commands
from executive.app.prepared import Prepared
from executive.words.command import Command, Task
from executive.words.knowledge import Knowledge, SurfaceFacts
from skills.files.errors import InputError


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


BidOn = Callable[[FleetMission, str], Bid]
TakesFrom = Callable[[str, SurfaceFacts], bool]


@dataclass(frozen=True)
class ChainedMission:
    """What the robots would do of each part, and where one takes over from the other (None: nothing is handed over)."""

    first: Mapping[str, Prepared]
    second: Mapping[str, Prepared]
    table: str | None


def chained(mission: FleetMission, bid: BidOn, takes_from: TakesFrom) -> ChainedMission | None:
    """The mission in two parts that is done first by two robots; None: no two can do it, or it has more than commands.

    `bid` is asked what each robot offers for a part, `takes_from` whether it reaches what another one puts on a table.
    """
    prepared = next(iter(mission.options.values()))
    if len(mission.options) < 2 or not is_plain(prepared.tree):
        return None
    parts = _Parts(mission, bid, takes_from)
    found = [chain for split in splits(prepared.tree.commands, _tables(prepared.knowledge)) if (chain := parts(split))]
    best = min(found, key=lambda chain: chain.ends_s, default=None)
    if best is None:
        return None
    split = best.split
    return ChainedMission(parts.options(split.first), parts.options(split.second), split.table)


def _tables(knowledge: Knowledge) -> Sequence[str]:
    return tuple(knowledge.surfaces)


class _Parts:
    """Asks for bids on parts of one mission; what a robot could not even begin is asked once for all tables."""

    def __init__(self, mission: FleetMission, bid: BidOn, takes_from: TakesFrom) -> None:
        self._mission, self._bid, self._takes_from = mission, bid, takes_from
        self._able: dict[tuple[Command, ...], tuple[str, ...]] = {}

    def __call__(self, split: Split) -> Chain | None:
        """The chain for a split that is done first."""
        begins = split.first if split.table is None else split.first[:-1]
        if begins not in self._able:
            self._able[begins] = tuple(bid.robot for bid in self._bids(begins, self._mission.options))
        first = self._bids(split.first, self._able[begins])
        if not first:
            return None
        second = self._bids(split.second, self._mission.options)
        return soonest(split, first, [each for each in second if self._takes(each.robot, split.table)])

    def _takes(self, robot: str, table: str | None) -> bool:
        surfaces = self._mission.options[robot].knowledge.surfaces
        return table is None or self._takes_from(robot, surfaces[table])

    def options(self, commands: tuple[Command, ...]) -> Mapping[str, Prepared]:
        """What each robot would do; one that has no way to do it at all is left out."""
        options: dict[str, Prepared] = {}
        for name, prepared in self._mission.options.items():
            try:
                options[name] = with_commands(prepared, commands)
            except InputError:
                continue
        return options

    def _bids(self, commands: tuple[Command, ...], robots: Iterable[str]) -> Sequence[Bid]:
        part = replace(self._mission, options=self.options(commands))
        bids = [self._bid(part, name) for name in robots if name in part.options]
        return [bid for bid in bids if not bid.problems]
