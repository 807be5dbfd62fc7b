"""What of the plant is kept over its process: each part that changes names the attributes that are its state."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
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
        return {name: _state(getattr(self, name)) for name in self._kept_names()}

    def restore(self, state: State) -> None:
        """Go on from such a state. Raises KeyError: a part of it is missing."""
        for name in self._kept_names():
            value = getattr(self, name)
            if isinstance(value, Kept):
                value.restore(state[name])
            elif _holds_parts(value):
                for key, part in value.items():
                    part.restore(state[name][key])
            else:
                setattr(self, name, unpacked(state[name]))

    def _kept_names(self) -> tuple[str, ...]:
        if dataclasses.is_dataclass(self) and not self._keeps:
            return tuple(field.name for field in dataclasses.fields(self))
        return self._keeps


def _state(value: Any) -> Any:
    if isinstance(value, Kept):
        return value.state()
    return {key: part.state() for key, part in value.items()} if _holds_parts(value) else packed(value)


def _holds_parts(value: Any) -> bool:
    return isinstance(value, Mapping) and any(isinstance(part, Kept) for part in value.values())
