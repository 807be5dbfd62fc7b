"""Variation of a world from run to run: light, clutter, people who walk about, friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Final

from executive.words.option import Option
from skills.files.errors import InputError, suggestion
from skills.quantities import Quantity, QuantityError, number_in, number_of

NORMAL_LIGHT: Final = "normal"
MOST_CLUTTER: Final = 40
MOST_PEOPLE: Final = 8
Brightness = Annotated[float, Quantity(ge=0.0, le=5.0)]
"""1 is day light."""
Clutter = Annotated[int, Quantity(ge=0, le=MOST_CLUTTER)]
MorePeople = Annotated[int, Quantity(ge=0, le=MOST_PEOPLE)]
Friction = Annotated[float, Quantity(ge=0.05, le=5.0)]
"""A factor; 1 is as usual."""


@dataclass(frozen=True)
class Light:
    """A light, as it differs from the usual day light.

    All beams are multiplied by `brightness` and have a `colour` (red, green, blue; 0 to 1). With a `sun` (direction in
    which its beam goes, world frame, and intensity), that one comes on top.
    """

    brightness: float = 1.0
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    sun: tuple[tuple[float, float, float], float] | None = None


DAY_LIGHT: Final = Light()
LIGHTS: Final[Mapping[str, Light]] = MappingProxyType(
    {
        NORMAL_LIGHT: DAY_LIGHT,
        "dim": Light(0.4),
        "bright": Light(1.5),
        "evening": Light(0.6, (1.0, 0.78, 0.55)),
        "low sun": Light(0.5, sun=((0.95, 0.0, -0.31), 1.6)),
    }
)
"""The lights that have names."""


def light_called(words: str) -> Light:
    """The light of a name, or of a brightness (0 to 5). Raises InputError: it is neither."""
    try:
        return LIGHTS[words] if words in LIGHTS else Light(number_in(words, Brightness))
    except QuantityError as error:
        hint = suggestion(words, LIGHTS, f"known are {', '.join(LIGHTS)}, or give a brightness of 0 to 5")
        raise InputError(f"unknown light '{words[:40]}'", hint=hint) from error


@dataclass(frozen=True)
class Variation:
    """A world's difference from what its files say.

    `light` is one of `LIGHTS` by name, or a brightness (1.0 is day light). `clutter` more objects lie about,
    of classes that the mission does not ask for; `people` more people walk about; the friction of all loose objects
    and of the robots is multiplied by `friction`.

    Raises:
        InputError: a value is out of range, or the light is unknown.
    """

    light: Annotated[
        str, Option("normal, dim, bright, evening, low sun, or a brightness (1 is day light).", metavar="NAME")
    ] = NORMAL_LIGHT
    clutter: Annotated[Clutter, Option("Adds so many objects; the seed chooses where they lie.")] = 0
    people: Annotated[MorePeople, Option("Adds so many walking people; the seed chooses their routes.")] = 0
    friction: Annotated[Friction, Option("Multiplies the friction of loose objects and robots.")] = 1.0

    def __post_init__(self) -> None:
        light_called(self.light)
        for name, kind in (("clutter", Clutter), ("people", MorePeople), ("friction", Friction)):
            try:
                number_of(getattr(self, name), kind)
            except QuantityError as error:
                raise InputError(f"{name}: {error.what}", hint=error.hint) from error

    def __bool__(self) -> bool:
        return self != NO_VARIATION

    def lines(self) -> tuple[str, ...]:
        """What is varied, one line each."""
        people = "1 person more walks about" if self.people == 1 else f"{self.people} people more walk about"
        told = {
            f"light: {self.light}": self.light != NORMAL_LIGHT,
            f"clutter: {self.clutter} objects more": self.clutter > 0,
            people: self.people > 0,
            f"friction: {self.friction:g} times": self.friction != 1.0,
        }
        return tuple(words for words, varied in told.items() if varied)


NO_VARIATION: Final = Variation()
"""All is as the world's files say."""
