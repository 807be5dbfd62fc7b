"""General knowledge of object classes and attributes: `class_forms.yaml` and `colour_words.yaml`."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from skills.inputs.errors import InputError
from skills.inputs.plugins import class_entries
from skills.inputs.schema import Strict
from skills.inputs.yaml_source import read_yaml

FORMS_FILE: Final = "class_forms.yaml"
ANY_OBJECT: Final = "thing"
"""The class word for any object that stands on a surface, whether the detector knows its class or not."""
NON: Final = "non-"
"""Before a colour: an object without it."""
MEANS_BIG: Final[Mapping[str, bool]] = MappingProxyType(
    dict.fromkeys(("big", "large", "huge"), True) | dict.fromkeys(("small", "little", "tiny"), False)
)
"""Attributes of size: whether each says that an object is larger than usual in its class."""


class ClassForm(Strict):
    """One class: id in messages, form, ranges (from, to) in m of the two longest sides, and the usual length.

    `mass_kg` is from the lightest to the heaviest usual object; None when unknown.
    """

    id: int
    form: Literal["round", "tank", "long", "box", "person"]
    length_m: tuple[float, float]
    width_m: tuple[float, float]
    usual_m: float
    mass_kg: tuple[float, float] | None = None


ANY_FORM: Final = ClassForm(id=0, form="round", length_m=(0.01, 0.6), width_m=(0.005, 0.4), usual_m=0.15)
"""Form of objects of a class that has none, such as one that only its tag tells."""


class ColourRange(Strict):
    """A range of hue (degrees, may wrap past 360), saturation and value (0 to 1)."""

    hue_deg: tuple[float, float] = (0.0, 360.0)
    saturation: tuple[float, float] = (0.0, 1.0)
    value: tuple[float, float] = (0.0, 1.0)

    def share(self, colours: NDArray[np.uint8]) -> float:
        """Fraction of colours (N, 3) RGB in the range."""
        import cv2  # a caller that only lists the words does not load it

        hsv = cv2.cvtColor(colours.reshape(1, -1, 3), cv2.COLOR_RGB2HSV_FULL)[0].astype(np.float64)
        hue, saturation, value = hsv[:, 0] * (360 / 255), hsv[:, 1] / 255, hsv[:, 2] / 255
        low, high = self.hue_deg
        in_hue = (hue >= low) & (hue <= high) if low <= high else (hue >= low) | (hue <= high)
        in_saturation = (saturation >= self.saturation[0]) & (saturation <= self.saturation[1])
        in_value = (value >= self.value[0]) & (value <= self.value[1])
        return float(np.mean(in_hue & in_saturation & in_value))


@lru_cache(maxsize=1)
def shipped_forms() -> Mapping[str, ClassForm]:
    """Loads the project's own classes by name. Raises pydantic.ValidationError when their file is malformed."""
    forms = read_yaml(Path(__file__).with_name(FORMS_FILE)).data
    return MappingProxyType(TypeAdapter(dict[str, ClassForm]).validate_python(forms))


@lru_cache(maxsize=1)
def class_forms() -> Mapping[str, ClassForm]:
    """Loads all classes by name, including those from other distributions.

    Raises InputError when a class of another distribution is malformed, or repeats the name or id of another class.
    """
    found = dict(shipped_forms())
    for file, forms in class_entries(FORMS_FILE, ClassForm):
        for name, form in forms.items():
            if name in found or form.id in (other.id for other in found.values()):
                hint = "give it another name and a new id, or uninstall that distribution"
                raise InputError(f"class {name!r} has the name or the id ({form.id}) of another", hint=hint, file=file)
            found[name] = form
    return MappingProxyType(found)


def class_form(name: str) -> ClassForm:
    """Form of a class; `ANY_FORM` for a class that has none."""
    return class_forms().get(name, ANY_FORM)


@lru_cache(maxsize=1)
def colour_words() -> Mapping[str, ColourRange]:
    """Loads the colour words. Raises pydantic.ValidationError when the file beside this module is malformed."""
    words = read_yaml(Path(__file__).with_name("colour_words.yaml")).data["attributes"]
    return TypeAdapter(dict[str, ColourRange]).validate_python(words)


def known_attributes() -> frozenset[str]:
    """Attribute words that can be verified by the pixels or the size of a detected object: "red", "non-red", "big"."""
    return frozenset(colour_words()) | {f"{NON}{colour}" for colour in colour_words()} | frozenset(MEANS_BIG)
