"""Appearance of a person, as far as the robot perceives it: pose, gesture, and colour of the upper clothing.

Two skills use it. Both give observations of people, as `meet_person` does; other skills
take their positions as they take those of named people.

`find_person` searches a room for people of an appearance. Ports in: `area_W`, `place`, `person` (the name in messages),
`pose`, `gesture`, `clothes_colour` (None: any), `count` (1: the first who fits; 0: everybody who fits), and `avoid`
(people who do not count). Ports out: `person`, the first who fits, and `people`, all who fit.

`read_person` looks at one person nearby. Ports in: `person`, `place_W` (None: the nearest one ahead), `place`, and
`traits` (those to tell). Ports out: `person`, each trait that was asked for as a word, and `text`, a sentence.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeVar, get_args

from skills.quantities import Coordinate

Pose = Literal["standing", "sitting", "lying"]
Gesture = Literal["waving", "raising_left_arm", "raising_right_arm", "pointing_left", "pointing_right", "none"]
"""Left and right are the person's own; `none` is a person whose arms hang."""
Colour = Literal["red", "orange", "yellow", "green", "blue", "white", "grey", "black"]
Trait = Literal["pose", "gesture", "clothes_colour"]
TRAITS: Final[tuple[Trait, ...]] = get_args(Trait)
TraitT = TypeVar("TraitT")
KINDS_NOTE: Final = "the kind of clothing is not told apart"
"""Words for an answer about clothes."""


@dataclass(frozen=True)
class Appearance:
    """What a person looks like. Each None is a trait that was not asked for, or that a look left unsure."""

    pose: Pose | None = None
    gesture: Gesture | None = None
    clothes_colour: Colour | None = None

    def traits(self) -> dict[Trait, str]:
        """Returns the traits that are given, by name."""
        return {trait: value for trait in TRAITS if (value := getattr(self, trait)) is not None}

    def only(self, traits: Sequence[Trait]) -> "Appearance":
        """Returns the appearance with these traits alone."""
        pose, gesture = (self.pose if "pose" in traits else None), (self.gesture if "gesture" in traits else None)
        return Appearance(pose, gesture, self.clothes_colour if "clothes_colour" in traits else None)

    def unsure_of(self, wanted: "Appearance") -> tuple[Trait, ...]:
        """Traits that another appearance gives and this one does not."""
        return tuple(trait for trait in wanted.traits() if getattr(self, trait) is None)

    def contradicts(self, wanted: "Appearance") -> bool:
        """Returns whether a trait is given by both, and differs."""
        own = self.traits()
        return any(own.get(trait, value) != value for trait, value in wanted.traits().items())

    def text(self) -> str:
        """Text of the traits: "sitting, waving, dressed in red"; "a person" without any."""
        own = self.traits()
        if (colour := own.pop("clothes_colour", None)) is not None:
            own["clothes_colour"] = f"dressed in {colour}"
        return ", ".join(gesture_text(value) for value in own.values()) or "a person"


def gesture_text(value: str) -> str:
    """Trait in a sentence: "raising the left arm", "pointing to the left", "making no gesture"."""
    words = {"none": "making no gesture", "raising_left_arm": "raising the left arm"}
    words |= {"raising_right_arm": "raising the right arm"}
    return words.get(value, value.replace("pointing_", "pointing to the "))


@dataclass(frozen=True)
class LookedAt:
    """Result of looks at a person: the appearance, the axis (x, y) in the world (m), and the time of the last look."""

    appearance: Appearance
    place_W: tuple[Coordinate, Coordinate]
    stamp_s: float

    def merged(self, later: "LookedAt") -> "LookedAt":
        """Adds a later look; a trait on which the looks differ is unsure again."""
        a, b = self.appearance, later.appearance
        colour: Colour | None = _agreed(a.clothes_colour, b.clothes_colour)
        both = Appearance(_agreed(a.pose, b.pose), _agreed(a.gesture, b.gesture), colour)
        return LookedAt(both, later.place_W, later.stamp_s)


def _agreed(one: TraitT | None, other: TraitT | None) -> TraitT | None:
    """Value of a trait that two looks give; None when they differ, or neither gives it."""
    if one is None or other is None:
        return other if one is None else one
    return one if one == other else None
