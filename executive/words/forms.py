"""Models of mappings in a file, and unions of them that are told apart by their keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import InitErrorDetails

from skills.files.errors import listing


class Strict(BaseModel):
    """A mapping without unknown keys, which never changes; code names its fields, files write their aliases."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True, defer_build=True
    )


def aliases(model: type[BaseModel]) -> dict[str, str]:
    """The keys that a file gives a model, with the names of their fields."""
    return {field.alias or name: name for name, field in model.model_fields.items()}


@dataclass(frozen=True)
class Forms:
    """Models by the keys that tell them apart; several keys may tell of one model.

    `refused` says what is wrong with a mapping that has these of the keys, of which none or several tell of a model.
    """

    models: Mapping[str, type[Strict]]
    refused: Callable[[Sequence[str]], str]

    def read(self, data: Any) -> Any:
        """The mapping as the model of its key. Raises ValueError: no key tells, or keys do not go together."""
        kinds = tuple(dict.fromkeys(self.models.values()))
        if isinstance(data, kinds):
            return data
        if not isinstance(data, Mapping):
            return kinds[0].model_validate(data)
        told = [key for key in self.models if data.get(key) is not None]
        chosen = {self.models[key] for key in told}
        if len(chosen) != 1:
            self._refuse_unknown(data)
            raise ValueError(self.refused(told))
        (model,) = chosen
        return model.model_validate(self._fitting(data, told[0], model), by_alias=True, by_name=False)

    def _refuse_unknown(self, data: Mapping[Any, Any]) -> None:
        """Raises ValidationError where some keys are those of no model."""
        known = {key for model in self.models.values() for key in aliases(model)}
        unknown = [key for key in data if key not in known]
        if unknown and not any(key in self.models for key in data):
            faults = [InitErrorDetails(type="extra_forbidden", loc=(key,), input=data[key]) for key in unknown]
            raise ValidationError.from_exception_data("mapping", faults)

    def _fitting(self, data: Mapping[Any, Any], told: str, model: type[Strict]) -> dict[Any, Any]:
        """The keys without those of other models that have no value. Raises ValueError: keys that do not fit."""
        own, fitting = aliases(model), dict(data)
        for key in data:
            users = [form for form, other in self.models.items() if key in aliases(other)]
            if key in own or not users:
                continue
            if data[key] is not None:
                raise ValueError(f"'{key}' goes with {listing(map(repr, users), last='or')}")
            del fitting[key]
        for key, name in own.items():
            if model.model_fields[name].is_required() and data.get(key) is None:
                raise ValueError(f"'{told}' needs '{key}' beside it")
        return fitting
