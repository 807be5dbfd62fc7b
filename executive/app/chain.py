"""A mission that no robot can do alone, in two parts for two robots, which hand over what is held by a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from executive.app.auction import Bid
from executive.app.fleet import FleetMission, is_plain, with_commands
from executive.app.prepared import Prepared
from executive.words.command import Command, Task
from executive.words.knowledge import SurfaceFacts
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

    def bids(commands: tuple[Command, ...], robots: Iterable[str]) -> Sequence[Bid]:
        part = replace(mission, options=_options(mission, commands))
        found = [bid(part, name) for name in robots if name in part.options]
        return [one for one in found if not one.problems]

    able: dict[tuple[Command, ...], tuple[str, ...]] = {}
    chains: list[Chain | None] = []
    for split in splits(prepared.tree.commands, prepared.knowledge.surfaces):
        begins = split.first if split.table is None else split.first[:-1]
        if begins not in able:  # what a robot could not even begin is asked once for all tables
            able[begins] = tuple(one.robot for one in bids(begins, mission.options))
        if first := bids(split.first, able[begins]):
            second = bids(split.second, mission.options)
            if (table := split.table) is not None:
                surfaces = {name: each.knowledge.surfaces for name, each in mission.options.items()}
                second = [one for one in second if takes_from(one.robot, surfaces[one.robot][table])]
            chains.append(soonest(split, first, second))
    best = min(filter(None, chains), key=lambda chain: chain.ends_s, default=None)
    if best is None:
        return None
    first_part, second_part = (_options(mission, commands) for commands in (best.split.first, best.split.second))
    return ChainedMission(first_part, second_part, best.split.table)


def _options(mission: FleetMission, commands: tuple[Command, ...]) -> Mapping[str, Prepared]:
    """What each robot would do of commands; one that has no way to do them at all is left out."""
    options: dict[str, Prepared] = {}
    for name, prepared in mission.options.items():
        with suppress(InputError):
            options[name] = with_commands(prepared, commands)
    return options
