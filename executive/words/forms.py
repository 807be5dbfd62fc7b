"""Declarations for models: mappings in a file, unions of models by key, and options of the command line."""

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import InitErrorDetails

from skills.inputs.errors import listing
from skills.inputs.schema import Strict


def aliases(model: type[BaseModel]) -> dict[str, str]:
    """Returns a model's keys as a file writes them, each with the name of its field."""
    return {field.alias or name: name for name, field in model.model_fields.items()}


@dataclass(frozen=True)
class Forms:
    """Union of models; the key that a mapping has selects the model.

    `refused` returns the message for a mapping whose keys select no model or several models.
    """

    models: Mapping[str, type[Strict]]
    refused: Callable[[Sequence[str]], str]

    def read(self, data: Any) -> Any:
        """Reads a mapping as the model that its keys select. Raises ValueError unless they select exactly one."""
        kinds = tuple(dict.fromkeys(self.models.values()))
        if isinstance(data, kinds):
            return data
        if not isinstance(data, Mapping):
            return kinds[0].model_validate(data)
        found = [key for key in self.models if data.get(key) is not None]
        chosen = {self.models[key] for key in found}
        if len(chosen) != 1:
            self._refuse_unknown(data)
            raise ValueError(self.refused(found))
        (model,) = chosen
        return model.model_validate(self._fitting(data, found[0], model), by_alias=True, by_name=False)

    def _refuse_unknown(self, data: Mapping[Any, Any]) -> None:
        """Raises ValidationError for keys that no model has."""
        known = {key for model in self.models.values() for key in aliases(model)}
        unknown = [key for key in data if key not in known]
        if unknown and not any(key in self.models for key in data):
            faults = [InitErrorDetails(type="extra_forbidden", loc=(key,), input=data[key]) for key in unknown]
            raise ValidationError.from_exception_data("mapping", faults)

    def _fitting(self, data: Mapping[Any, Any], form: str, model: type[Strict]) -> dict[Any, Any]:
        """Drops empty keys of other models. Raises ValueError for keys that cannot be used together."""
        own, fitting = aliases(model), dict(data)
        for key in data:
            users = [name for name, other in self.models.items() if key in aliases(other)]
            if key in own or not users:
                continue
            if data[key] is not None:
                raise ValueError(f"'{key}' goes with {listing(map(repr, users), last='or')}")
            del fitting[key]
        for key, name in own.items():
            if model.model_fields[name].is_required() and data.get(key) is None:
                raise ValueError(f"'{form}' needs '{key}' beside it")
        return fitting


class OptionGroup(enum.StrEnum):
    """Headings above options in the help of a command."""

    REQUEST = "Request"
    WORLD = "World"
    ROBOTS = "Robots"
    DISTURBANCES = "Faults and variations"
    OUTPUT = "Output"
    PAGE = "Live page"


@dataclass(frozen=True)
class Option:
    """Command-line option that sets a field; a number must be in the range of the field's quantity.

    `name` is the option's name, by default the field's; an `argument` has no name. `read` converts the typed value, of
    type `typed`, to the field's value or raises InputError. `group` is the option's heading in the help.
    """

    help: str
    name: str = ""
    metavar: str | None = None
    argument: bool = False
    read: Callable[[Any], Any] | None = None
    typed: Any = str
    group: OptionGroup | None = None
