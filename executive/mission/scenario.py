"""Scenarios: faults of the robot, and events in its world, while a mission runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final

from executive.words.option import Option
from skills.quantities import Quantity

RandomFaults = Annotated[int, Quantity(ge=0, le=100)]
"""How many faults a seed draws."""


@dataclass(frozen=True)
class Scenario:
    """Faults by their words, the number that the seed draws, and events as plain data.

    `people` are routes by name, `doors` doorways with the times at which they close and open, `moves` objects with the
    time at which they are moved and where to; all points are in the world frame, in metres.
    """

    faults: Annotated[
        tuple[str, ...],
        Option(
            'Adds a fault, such as "camera.hand: dropout 5 s at 20 s"; may be repeated.', "--fault", metavar="WORDS"
        ),
    ] = ()
    random: Annotated[RandomFaults, Option("Adds so many faults that the seed draws.", "--random-faults")] = 0
    people: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    doors: tuple[Mapping[str, Any], ...] = ()
    moves: tuple[Mapping[str, Any], ...] = ()

    def __bool__(self) -> bool:
        return self != NO_SCENARIO

    @property
    def moving(self) -> set[str]:
        """The people and doors that it moves, by name; in one run, only one scenario may move each."""
        return {*self.people, *(door["name"] for door in self.doors)}

    def and_also(self, other: Scenario) -> Scenario:
        """Both together."""
        return Scenario(
            (*self.faults, *other.faults),
            self.random + other.random,
            {**self.people, **other.people},
            (*self.doors, *other.doors),
            (*self.moves, *other.moves),
        )

    def with_drawn(self, faults: tuple[str, ...]) -> Scenario:
        """The same with the random faults drawn."""
        return replace(self, faults=(*self.faults, *faults), random=0)

    def lines(self) -> tuple[str, ...]:
        """The faults and events, one line each."""
        people = (f"{name} sets off at {route['start']:g} s" for name, route in self.people.items())
        doors = (f"the {door['name']} {_times(door)}" for door in self.doors)
        moves = (f"somebody moves the {_moved(move)} at {move['at']:g} s" for move in self.moves)
        return (*(f"fault: {words}" for words in self.faults), *people, *doors, *moves)


NO_SCENARIO: Final = Scenario()
"""Nothing goes wrong, and nothing happens but what the robot does."""


def _times(door: Mapping[str, Any]) -> str:
    """The times at which a door closes and opens, in order."""
    told = sorted((door[verb], verb) for verb in ("closes", "opens") if door[verb] is not None)
    return " and ".join(f"{verb} at {at_s:g} s" for at_s, verb in told)


def _moved(move: Mapping[str, Any]) -> str:
    """The object that is moved, and its destination."""
    to = move["to"]
    return f"{move['name']} to {f'the {to}' if isinstance(to, str) else '({:g}, {:g}, {:g})'.format(*to)}"
