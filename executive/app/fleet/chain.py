"""Splits a mission that no robot can do alone into two parts for two robots, with a table as the hand-over point."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from executive.app.fleet.auction import Bid
from executive.app.fleet.fleet_mission import FleetMission, is_plain, with_commands
from executive.app.prepare.prepared import Prepared
from executive.words.command import Command
from executive.words.knowledge import SurfaceFacts
from executive.words.task import basic
from skills.inputs.errors import InputError


@dataclass(frozen=True)
class Split:
    """Commands of a mission, split into two parts.

    The first part puts the held object on the `table`, and the second part takes it from there. Without a `table` the
    gripper is empty between the parts.
    """

    first: tuple[Command, ...]
    second: tuple[Command, ...]
    table: str | None = None


@dataclass(frozen=True)
class Chain:
    """Split mission with the bid of one robot for each part."""

    split: Split
    first: Bid
    second: Bid

    @property
    def ends_s(self) -> float:
        """End of the second part, which begins after the first, in s from now."""
        begins_s = max(self.first.ready_s + self.first.duration_s, self.second.ready_s)
        return begins_s + self.second.duration_s


def splits(commands: Sequence[Command], tables: Iterable[str]) -> Iterator[Split]:
    """Yields each split of a mission of plain commands into two parts."""
    own = tuple(commands)
    for number in range(1, len(own)):
        before, after = own[number - 1], own[number]
        if after.item is None:
            yield Split(own[:number], own[number:])
        elif before.takes and before.object == after.item:
            item, count = after.item, after.item_count
            for table in tables:
                put = Command(item=item, goal=table, item_count=count)
                take = Command(goal=table, task=basic().take, object=item, object_count=count)
                yield Split((*own[:number], put), (take, *own[number:]), table)


def soonest(split: Split, first: Iterable[Bid], second: Sequence[Bid]) -> Chain | None:
    """Returns the two different robots that finish a split mission first; None if no two robots can do its parts."""
    able = [(a, b) for a in first for b in second if not a.problems and not b.problems and a.robot != b.robot]
    chains = [Chain(split, a, b) for a, b in able]
    return min(chains, key=lambda chain: (chain.ends_s, chain.first.robot, chain.second.robot), default=None)


BidOn = Callable[[FleetMission, str], Bid]
TakesFrom = Callable[[str, SurfaceFacts], bool]


def best_split(mission: FleetMission, bid: BidOn, takes_from: TakesFrom) -> Split | None:
    """Returns the split with which two robots finish a mission first.

    None if no two robots can do it, or if the mission contains more than plain commands. `bid` returns a robot's bid
    for a part; `takes_from` returns whether a robot reaches an object that another robot puts on a table.
    """
    prepared = next(iter(mission.options.values()))
    if len(mission.options) < 2 or not is_plain(prepared.tree):
        return None

    def bids(commands: tuple[Command, ...], robots: Iterable[str]) -> Sequence[Bid]:
        part = replace(mission, options=options_for(mission, commands))
        found = [bid(part, name) for name in robots if name in part.options]
        return [one for one in found if not one.problems]

    able: dict[tuple[Command, ...], tuple[str, ...]] = {}
    chains: list[Chain | None] = []
    for split in splits(prepared.tree.commands, prepared.knowledge.surfaces):
        begins = split.first if split.table is None else split.first[:-1]
        if begins not in able:  # the bids for the part before the table are the same for all tables
            able[begins] = tuple(one.robot for one in bids(begins, mission.options))
        if first := bids(split.first, able[begins]):
            second = bids(split.second, mission.options)
            if (table := split.table) is not None:
                surfaces = {name: each.knowledge.surfaces for name, each in mission.options.items()}
                second = [one for one in second if takes_from(one.robot, surfaces[one.robot][table])]
            chains.append(soonest(split, first, second))
    best = min(filter(None, chains), key=lambda chain: chain.ends_s, default=None)
    return None if best is None else best.split


def options_for(mission: FleetMission, commands: tuple[Command, ...]) -> Mapping[str, Prepared]:
    """Compiles the commands for each robot; leaves out robots for which they cannot be compiled."""
    options: dict[str, Prepared] = {}
    for name, prepared in mission.options.items():
        with suppress(InputError):
            options[name] = with_commands(prepared, commands)
    return options
