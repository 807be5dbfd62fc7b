"""What is varied of a world from run to run: light, clutter, people who walk about, friction."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Final

from skills.files.errors import InputError

__all__ = ["MOST_CLUTTER", "MOST_PEOPLE", "NORMAL_LIGHT", "NO_VARIATION", "Variation"]

NORMAL_LIGHT: Final = "normal"
MOST_CLUTTER: Final = 40
MOST_PEOPLE: Final = 8
_FRICTION: Final = (0.05, 5.0)


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
        for name, value, most in (("clutter", self.clutter, MOST_CLUTTER), ("people", self.people, MOST_PEOPLE)):
            if not 0 <= value <= most:
                raise InputError(f"{name} {value} is out of range", hint=f"give 0 to {most}")
        least, most_friction = _FRICTION
        if not least <= self.friction <= most_friction:
            hint = f"give {least:g} to {most_friction:g}; 1 is as usual"
            raise InputError(f"friction {self.friction:g} is out of range", hint=hint)

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
