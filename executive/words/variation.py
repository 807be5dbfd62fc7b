"""What is varied of a world from run to run: light, clutter, people who walk about, friction."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Annotated, Final

from skills.files.errors import InputError
from skills.quantities import Quantity, QuantityError, number_of

__all__ = ["NORMAL_LIGHT", "NO_VARIATION", "Brightness", "Clutter", "Friction", "MorePeople", "Variation"]

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
class Variation:
    """How a world differs from what its files say.

    `light` is one of the plant's lights by name, or a brightness (1.0 is day light). `clutter` more objects lie about,
    of classes that the mission does not ask for; `people` more people walk about; the friction of all loose objects
    and of the robots is multiplied by `friction`.

    Raises:
        InputError: a value is out of range.
    """

    light: str = NORMAL_LIGHT
    clutter: int = 0
    people: int = 0
    friction: float = 1.0

    def __post_init__(self) -> None:
        for name, kind in (("clutter", Clutter), ("people", MorePeople), ("friction", Friction)):
            try:
                number_of(getattr(self, name), kind)
            except QuantityError as error:
                raise InputError(f"{name}: {error.what}", hint=error.hint) from error

    def __bool__(self) -> bool:
        return self != NO_VARIATION

    def arguments(self) -> list[str]:
        """The options of `errand run` that mean the same."""
        options = [f"--{name}={value}" for name, value in asdict(self).items() if value != getattr(NO_VARIATION, name)]
        return options

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

    def to_text(self) -> str:
        """As JSON."""
        return json.dumps(asdict(self))

    @staticmethod
    def of_text(text: str) -> Variation:
        """What `to_text` wrote."""
        return Variation(**json.loads(text))


NO_VARIATION: Final = Variation()
"""All is as the world's files say."""
