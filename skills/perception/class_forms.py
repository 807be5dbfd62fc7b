"""What the classes of objects are like in general: `class_forms.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, TypeAdapter

from skills.files.yaml_source import read_yaml

PERSON: Final = "person"
"""The class of people."""
THING: Final = "thing"
"""The class word for any object: what stands out from its surface, whether the detector has a class for it or not."""


class ClassForm(BaseModel):
    """One class: id in messages, form, lengths (from, to) in m of its longest and second longest side, usual length.

    `mass_kg` is from the lightest to the heaviest usual one; None: nothing is known. `least_kg_m3` is the least mass
    per volume of the bar about it (its longest side times the shortest twice); None: its size says nothing of its mass.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    id: int
    form: Literal["round", "tank", "long", "box", "person"]
    length_m: tuple[float, float]
    width_m: tuple[float, float]
    usual_m: float
    mass_kg: tuple[float, float] | None = None
    least_kg_m3: float | None = None

    def least_mass_kg(self, size_m: tuple[float, float, float]) -> float:
        """What one that was seen with a size (three sides in m) weighs at least; 0.0 where nothing is known.

        What is hidden of it makes it seem smaller, and so lighter, not heavier.
        """
        if self.mass_kg is None:
            return 0.0
        longest, shortest = max(size_m), min(size_m)
        by_size_kg = 0.0 if self.least_kg_m3 is None else self.least_kg_m3 * longest * shortest**2
        return max(self.mass_kg[0], min(by_size_kg, self.mass_kg[1]))


@lru_cache(maxsize=1)
def class_forms() -> Mapping[str, ClassForm]:
    """The classes by name. Raises pydantic.ValidationError when the file beside this module is malformed."""
    forms = read_yaml(Path(__file__).with_name("class_forms.yaml")).data
    return MappingProxyType(TypeAdapter(dict[str, ClassForm]).validate_python(forms))
