"""Fields of a request as options of the command line, and the command line that produces a request."""

from __future__ import annotations

import dataclasses
import enum
import json
import shlex
from collections.abc import Iterator, Mapping
from typing import Any, get_args, get_origin, get_type_hints

from executive.mission.request import Request
from executive.words.forms import Option
from skills.quantities import quantity_of
from skills.robot import Pose2D


@dataclasses.dataclass(frozen=True)
class RequestField:
    """Field with an option; `part` is the field of the request that contains it (empty: the request itself)."""

    part: str
    name: str
    kind: Any
    option: Option
    default: Any

    @property
    def several(self) -> bool:
        """True if the option may be repeated."""
        return get_origin(self.kind) is tuple

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the option."""
        return (self.option.name or f"--{self.name.replace('_', '-')}",)

    def arguments(self, value: Any) -> list[str]:
        """Returns the command-line arguments that produce a value."""
        if self.option.argument:
            return [str(value)]
        if isinstance(value, bool):
            yes, _, no = self.names[0].partition("/")
            return [yes if value or not no else no]
        if isinstance(value, Mapping):
            words = [f"{name}={json.dumps(each)}" for name, each in value.items()]
        elif self.several:
            words = [*map(str, value)] if self.option.read is None else [",".join(map(str, value))]
        else:
            words = [_text(value)]
        return [f"{self.names[0]}={word}" for word in words]


def _text(value: Any) -> str:
    if isinstance(value, Pose2D):
        return f"{value.x_m!r} {value.y_m!r} {value.yaw_rad!r}"
    return str(value.value if isinstance(value, enum.Enum) else value)


def request_fields(model: Any = Request, part: str = "") -> Iterator[RequestField]:
    """Yields the fields that have an option, including those inside parts of the request."""
    hints = get_type_hints(model, include_extras=True)
    for each in dataclasses.fields(model):
        hint = hints[each.name]
        option = next((mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, Option)), None)
        if option is not None:
            default = each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
            kind = get_args(hint)[0] if quantity_of(hint) is None else hint
            yield RequestField(part, each.name, kind, option, default)
        elif not part and dataclasses.is_dataclass(hint):
            yield from request_fields(hint, each.name)


def request_arguments(request: Request) -> list[str]:
    """Returns the arguments of `errand run` that produce this request."""
    arguments = list[str]()
    for each in request_fields():
        value = getattr(getattr(request, each.part) if each.part else request, each.name)
        if value != each.default:
            arguments += each.arguments(value)
    return arguments


def command_of(request: Request) -> str:
    """Returns the command line that repeats the run of this request, whose `out` is that run's own folder."""
    scenario, files = request.given_scenario or (request.scenario, request.scenario_files)
    asked = dataclasses.replace(request, out=Request.out, scenario=scenario, scenario_files=files)
    return shlex.join(["errand", "run", *request_arguments(asked)])
