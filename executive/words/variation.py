"""Variations of a world between runs: light, clutter, walking people, friction."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Final

from executive.words.forms import Option
from executive.words.forms import OptionGroup as Group
from skills.inputs.errors import InputError, suggestion
from skills.quantities import Quantity, QuantityError, number_in, number_of

NORMAL_LIGHT: Final = "normal"
MOST_CLUTTER: Final = 40
MOST_PEOPLE: Final = 8
Brightness = Annotated[float, Quantity(ge=0.0, le=5.0)]
"""Factor of the brightness; 1 is day light."""
Clutter = Annotated[int, Quantity(ge=0, le=MOST_CLUTTER)]
MorePeople = Annotated[int, Quantity(ge=0, le=MOST_PEOPLE)]
Friction = Annotated[float, Quantity(ge=0.05, le=5.0)]
"""Factor of the friction; 1 is normal."""


@dataclass(frozen=True)
class Light:
    """Light of a world, relative to normal daylight.

    `brightness` multiplies all beams, `colour` (red, green, blue; 0 to 1) tints them. A `sun` (direction of its beam in
    the world frame, and intensity) is added.
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
"""Lights by name."""


def parse_light(words: str) -> Light:
    """Parses the name of a light, or a brightness (0 to 5). Raises InputError for any other text."""
    try:
        return LIGHTS[words] if words in LIGHTS else Light(number_in(words, Brightness))
    except QuantityError as error:
        hint = suggestion(words, LIGHTS, f"known are {', '.join(LIGHTS)}, or give a brightness of 0 to 5")
        raise InputError(f"unknown light '{words[:40]}'", hint=hint) from error


@dataclass(frozen=True)
class Variation:
    """Changes to a world as its files describe it.

    `light` is a name in `LIGHTS`, or a brightness (1.0 is daylight). `clutter` adds this number of objects of classes
    that the mission does not mention; `people` adds walking people; `friction` multiplies the friction of all loose
    objects and of the robots.

    Raises InputError when a value is out of range, or the light is unknown.
    """

    light: Annotated[
        str,
        Option(
            "normal, dim, bright, evening, low sun, or a brightness (1 is day light).",
            metavar="NAME",
            group=Group.DISTURBANCES,
        ),
    ] = NORMAL_LIGHT
    clutter: Annotated[
        Clutter, Option("Adds so many objects; the seed chooses where they lie.", group=Group.DISTURBANCES)
    ] = 0
    people: Annotated[
        MorePeople, Option("Adds so many walking people; the seed chooses their routes.", group=Group.DISTURBANCES)
    ] = 0
    friction: Annotated[
        Friction, Option("Multiplies the friction of loose objects and robots.", group=Group.DISTURBANCES)
    ] = 1.0

    def __post_init__(self) -> None:
        parse_light(self.light)
        for name, kind in (("clutter", Clutter), ("people", MorePeople), ("friction", Friction)):
            try:
                number_of(getattr(self, name), kind)
            except QuantityError as error:
                raise InputError(f"{name}: {error.what}", hint=error.hint) from error

    def __bool__(self) -> bool:
        return self != NO_VARIATION

    def lines(self) -> tuple[str, ...]:
        """One line for each value that differs from the world's files."""
        people = "1 person more walks about" if self.people == 1 else f"{self.people} people more walk about"
        lines = {
            f"light: {self.light}": self.light != NORMAL_LIGHT,
            f"clutter: {self.clutter} objects more": self.clutter > 0,
            people: self.people > 0,
            f"friction: {self.friction:g} times": self.friction != 1.0,
        }
        return tuple(words for words, varied in lines.items() if varied)


NO_VARIATION: Final = Variation()
"""The world as its files describe it."""
