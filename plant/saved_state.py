"""Saved state of the plant: each stateful part names the attributes that change from step to step."""

import dataclasses
from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar

from executive.words.json_values import pack, unpack

State = dict[str, Any]


class Stateful:
    """Part of the plant whose state is saved and restored by attributes.

    A class names its attributes in `saved`, in addition to those of its bases; a dataclass without `saved` saves all
    its fields. An attribute may be stateful itself, or a mapping of stateful parts.
    """

    _saved: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, *, saved: tuple[str, ...] = ()) -> None:
        super().__init_subclass__()
        cls._saved = (*cls._saved, *saved)

    def state(self) -> State:
        """Returns the saved attributes as JSON values."""
        return {key: _state(getattr(self, name)) for key, name in self._saved_names().items()}

    def restore(self, state: State) -> None:
        """Restores the saved attributes. Raises KeyError when the state lacks one of them."""
        for key, name in self._saved_names().items():
            value = getattr(self, name)
            if isinstance(value, Stateful):
                value.restore(state[key])
            elif _holds_parts(value):
                for each, part in value.items():
                    part.restore(state[key][each])
            else:
                setattr(self, name, unpack(state[key]))

    @classmethod
    @cache
    def _saved_names(cls) -> Mapping[str, str]:
        """Names of the attributes, by their keys in the state."""
        names = cls._saved or [field.name for field in dataclasses.fields(cls)]  # type: ignore[arg-type]
        return {name.lstrip("_"): name for name in names}


def _state(value: Any) -> Any:
    if isinstance(value, Stateful):
        return value.state()
    return {key: part.state() for key, part in value.items()} if _holds_parts(value) else pack(value)


def _holds_parts(value: Any) -> bool:
    return isinstance(value, dict) and isinstance(next(iter(value.values()), None), Stateful)
