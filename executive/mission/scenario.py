"""Scenarios: faults of the robot, and events in its world, while a mission runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Final

from executive.words.forms import Option
from executive.words.forms import OptionGroup as Group
from skills.inputs.errors import definite
from skills.quantities import Quantity

RandomFaults = Annotated[int, Quantity(ge=0, le=100)]
"""Number of faults that a seed draws."""


@dataclass(frozen=True)
class Scenario:
    """Scenario of a run: faults in their text form, the number of random faults, and events as plain data.

    `people` are routes by the person's name, `answers` are people's answers to the robot's questions, and `crowd` is
    the number of people who wander about. `doors` are doorways with the times at which they close and open, `moves` are
    objects with the time and destination of their move. All points are in the world frame, in metres.
    """

    faults: Annotated[
        tuple[str, ...],
        Option(
            'Adds a fault, such as "camera.hand: dropout 5 s at 20 s"; may be repeated.',
            "--fault",
            metavar="WORDS",
            group=Group.DISTURBANCES,
        ),
    ] = ()
    random: Annotated[
        RandomFaults, Option("Adds so many faults that the seed draws.", "--random-faults", group=Group.DISTURBANCES)
    ] = 0
    people: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    doors: tuple[Mapping[str, Any], ...] = ()
    moves: tuple[Mapping[str, Any], ...] = ()
    answers: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    crowd: int = 0

    def __bool__(self) -> bool:
        return self != NO_SCENARIO

    @property
    def moving(self) -> set[str]:
        """Names of the people and doors that the scenario moves; in a run, only one scenario may move each."""
        return {*self.people, *(door["name"] for door in self.doors)}

    def merge(self, other: Scenario) -> Scenario:
        """Combines two scenarios into one."""
        pairs = ((getattr(self, each.name), getattr(other, each.name)) for each in fields(self))
        both: list[Any] = [{**one, **more} if isinstance(one, Mapping) else one + more for one, more in pairs]
        return Scenario(*both)

    def with_drawn(self, faults: tuple[str, ...]) -> Scenario:
        """Copies the scenario with drawn faults instead of a number of random faults."""
        return replace(self, faults=(*self.faults, *faults), random=0)

    def lines(self) -> tuple[str, ...]:
        """One line for each fault and event."""
        people = [f"{name} {_verb(route)} at {route['start']:g} s" for name, route in self.people.items()]
        people += [f"a crowd of {self.crowd} wanders about"] if self.crowd else []
        doors = []
        for door in self.doors:
            times = sorted((door[verb], verb) for verb in ("closes", "opens") if door[verb] is not None)
            doors.append(f"the {door['name']} {' and '.join(f'{verb} at {at_s:g} s' for at_s, verb in times)}")
        moves = []
        for move in self.moves:
            to = f"the {move['to']}" if isinstance(move["to"], str) else "({:g}, {:g}, {:g})".format(*move["to"])
            moves.append(f"somebody moves {definite(move['name'])} to {to} at {move['at']:g} s")
        return (*(f"fault: {words}" for words in self.faults), *people, *doors, *moves)


def _verb(route: Mapping[str, Any]) -> str:
    """Verb that describes how a person walks."""
    return "is ready to follow" if route.get("follows") else "wanders off" if route.get("wanders") else "sets off"


NO_SCENARIO: Final = Scenario()
"""Scenario without faults and events."""
