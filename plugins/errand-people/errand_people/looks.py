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
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, TypeVar

from skills.quantities import Coordinate

Pose = StrEnum("Pose", "STANDING SITTING LYING")
Gesture = StrEnum("Gesture", "WAVING RAISING_LEFT_ARM RAISING_RIGHT_ARM POINTING_LEFT POINTING_RIGHT NONE")
"""Gesture of a person, whose own left and right are meant; none while the arms hang."""
Colour = StrEnum("Colour", "RED ORANGE YELLOW GREEN BLUE WHITE GREY BLACK")
Trait = StrEnum("Trait", "POSE GESTURE CLOTHES_COLOUR")
TRAITS: Final = tuple(Trait)
TraitT = TypeVar("TraitT")
KINDS_NOTE: Final = "the kind of clothing is not told apart"
"""Words for an answer about clothes."""


@dataclass(frozen=True)
class Appearance:
    """Appearance of a person. Each None is a trait that was not asked for, or that a look left unsure."""

    pose: Pose | None = None
    gesture: Gesture | None = None
    clothes_colour: Colour | None = None

    def traits(self) -> dict[Trait, str]:
        """Returns the traits that are given, by name."""
        return {trait: value for trait in TRAITS if (value := getattr(self, trait)) is not None}

    def only(self, traits: Sequence[Trait]) -> "Appearance":
        """Returns the appearance with these traits alone."""
        pose, gesture = (
            (self.pose if Trait.POSE in traits else None),
            (self.gesture if Trait.GESTURE in traits else None),
        )
        return Appearance(pose, gesture, self.clothes_colour if Trait.CLOTHES_COLOUR in traits else None)

    def unsure_of(self, wanted: "Appearance") -> tuple[Trait, ...]:
        """Traits that another appearance gives and this one does not."""
        return tuple(trait for trait in wanted.traits() if getattr(self, trait) is None)

    def contradicts(self, wanted: "Appearance") -> bool:
        """Returns whether a trait is given by both, and differs."""
        own = self.traits()
        return any(own.get(trait, value) != value for trait, value in wanted.traits().items())

    def text(self) -> str:
        """Text of the traits: "sitting, waving, dressed in red"; "a person" without any."""
        gesture = None if self.gesture is None else gesture_text(self.gesture)
        colour = None if self.clothes_colour is None else f"dressed in {self.clothes_colour}"
        return ", ".join(filter(None, (self.pose, gesture, colour))) or "a person"


def gesture_text(gesture: Gesture) -> str:
    """Gesture in a sentence: "raising the left arm", "pointing to the left", "making no gesture"."""
    if gesture is Gesture.NONE:
        return "making no gesture"
    return gesture.replace("raising_", "raising the ").replace("pointing_", "pointing to the ").replace("_arm", " arm")


@dataclass(frozen=True)
class LookedAt:
    """Result of looks at a person: the appearance, the axis (x, y) in the world (m), and the time of the last look."""

    appearance: Appearance
    place_W: tuple[Coordinate, Coordinate]
    stamp_s: float

    def merged(self, later: "LookedAt") -> "LookedAt":
        """Adds a later look; a trait on which the looks differ is unsure again.

        Only a sure lying pose implies that there is no gesture.
        """
        a, b = self.appearance, later.appearance
        if _agreed(a.pose, b.pose) is None:
            a, b = (replace(one, gesture=None) if one.pose is Pose.LYING else one for one in (a, b))
        colour: Colour | None = _agreed(a.clothes_colour, b.clothes_colour)
        both = Appearance(_agreed(a.pose, b.pose), _agreed(a.gesture, b.gesture), colour)
        return LookedAt(both, later.place_W, later.stamp_s)


def _agreed(one: TraitT | None, other: TraitT | None) -> TraitT | None:
    """Value of a trait that two looks give; None when they differ, or neither gives it."""
    if one is None or other is None:
        return other if one is None else one
    return one if one == other else None
