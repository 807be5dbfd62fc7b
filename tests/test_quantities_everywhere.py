"""Every number that a file may hold has a quantity: a new field without one is found here."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Annotated, Any, get_args, get_origin

import pytest
from pydantic import BaseModel

from skills.quantities import quantity_of
from tests.sources import PRODUCT, dotted, modules

OURS_ALONE = (
    "executive/tree/estimate.py",
    "plant/models/catalogue.py",
    "plant/sensors/camera_spec.py",
    "skills/class_forms.py",
)
"""Modules whose models describe files that come with the project, that Errand writes, or that other programs write."""


def files() -> list[str]:
    """The modules with models of files that a user writes."""
    named = {path for path, text in modules(*PRODUCT).items() if "BaseModel)" in text}
    return sorted(named - set(OURS_ALONE))


def bare(hint: Any) -> Iterator[Any]:
    """The numbers without a quantity in the type of a field."""
    if quantity_of(hint) is not None:
        return
    if get_origin(hint) is Annotated:
        yield from bare(get_args(hint)[0])
    elif hint in (int, float):
        yield hint
    else:
        for part in get_args(hint):
            yield from bare(part)


def without_quantity(model: type[BaseModel]) -> list[str]:
    """The fields of a model that are, or hold, a number without a quantity."""
    hints = {name: Annotated[(f.annotation, *(f.metadata or ("",)))] for name, f in model.model_fields.items()}
    return [name for name, hint in hints.items() if list(bare(hint))]


@pytest.mark.parametrize("module", files())
def test_every_number_of_a_file_has_a_quantity(module: str) -> None:
    name = dotted(module)
    kinds = [each for each in vars(import_module(name)).values() if isinstance(each, type) and each.__module__ == name]
    models = [each for each in kinds if issubclass(each, BaseModel)]
    assert {model.__name__: names for model in models if (names := without_quantity(model))} == {}


def test_a_number_without_a_quantity_is_found() -> None:
    class File(BaseModel):
        """A file."""

        share: float = 0.5
        places: tuple[tuple[float, float], ...] | None = None
        name: str = ""

    assert without_quantity(File) == ["share", "places"]
