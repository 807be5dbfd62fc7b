"""What the classes of objects are like in general: `class_forms.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

import yaml
from pydantic import BaseModel, ConfigDict, TypeAdapter

PERSON: Final = "person"
"""The class of people."""
THING: Final = "thing"
"""The class word for any object: what stands out from its surface, whether the detector has a class for it or not."""


class ClassForm(BaseModel):
    """One class: id in messages, form, lengths (from, to) in m of its longest and second longest side, usual length."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: int
    form: Literal["round", "tank", "long", "box", "person"]
    length_m: tuple[float, float]
    width_m: tuple[float, float]
    usual_m: float


@lru_cache(maxsize=1)
def class_forms() -> Mapping[str, ClassForm]:
    """The classes by name. Raises pydantic.ValidationError when the file beside this module is malformed."""
    text = Path(__file__).with_name("class_forms.yaml").read_text(encoding="utf-8")
    return MappingProxyType(TypeAdapter(dict[str, ClassForm]).validate_python(yaml.safe_load(text)))
