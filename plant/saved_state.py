"""What of the plant is kept over its process: each part that changes names the attributes that are its state."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar

from skills.files.kept_values import packed, unpacked

State = dict[str, Any]


class Kept:
    """A part of the plant whose state is that of the attributes that its class and those above it name in `keeps`.

    A dataclass that names none keeps all its fields. An attribute may be such a part itself, or a mapping of some.
    """

    _keeps: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, *, keeps: tuple[str, ...] = ()) -> None:
        super().__init_subclass__()
        cls._keeps = (*cls._keeps, *keeps)

    def state(self) -> State:
        """What changes from step to step, as values of JSON."""
        return {key: _state(getattr(self, name)) for key, name in self._kept_names().items()}

    def restore(self, state: State) -> None:
        """Goes on from such a state. Raises KeyError: a part of it is missing."""
        for key, name in self._kept_names().items():
            value = getattr(self, name)
            if isinstance(value, Kept):
                value.restore(state[key])
            elif _holds_parts(value):
                for each, part in value.items():
                    part.restore(state[key][each])
            else:
                setattr(self, name, unpacked(state[key]))

    @classmethod
    @cache
    def _kept_names(cls) -> Mapping[str, str]:
        """The names of the attributes, by those that they have in the state."""
        names = cls._keeps or [field.name for field in dataclasses.fields(cls)]  # type: ignore[arg-type]
        return {name.lstrip("_"): name for name in names}


def _state(value: Any) -> Any:
    if isinstance(value, Kept):
        return value.state()
    return {key: part.state() for key, part in value.items()} if _holds_parts(value) else packed(value)


def _holds_parts(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(next(iter(value.values()), None), Kept)
