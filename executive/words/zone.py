"""Zones in a knowledge file, and the Nav2 filter masks that they name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import BeforeValidator, Field, model_validator

from executive.words.outlines import Polygon
from skills.api import FilterType, Zone, ZoneKind, ZoneMask
from skills.inputs.errors import InputError
from skills.inputs.outside import file_beside, is_file
from skills.inputs.schema import Name, Strict, validate
from skills.inputs.yaml_source import KeyPath, YamlSource, read_yaml
from skills.quantities import Angle, Number, Quantity, Speed

_ROS: Final = "ros__parameters"


class FilterInfo(Strict):
    """Filter info of a Nav2 mask: what its values mean. A value v, in percent, stands for base + multiplier * v."""

    type: FilterType = Field(description="0 keep-out, 1 speed limit in percent of full speed, 2 speed limit in m/s")
    base: Number = Field(default=0.0, description="of the limit, in percent or m/s")
    multiplier: Number = Field(default=1.0, description="of the limit, for each percent of a cell's value")


class ZoneFacts(Strict):
    """Zone of the map. Its ground is a room (`place`), a `polygon`, or a `mask` of Nav2.

    A mask of kind `keep_out` or `speed_limit` is read with its filter info; without filter info, as in Nav2's examples:
    a keep-out cell has the value 100 and smaller values are costs; a speed limit is 100 % less the value.
    """

    kind: ZoneKind = Field(description="what holds in it")
    place: str | None = Field(default=None, description="the room that it covers")
    polygon: Polygon | None = Field(default=None, description="outline, corners (x, y)")
    mask: Name | None = Field(default=None, description="YAML file of a Nav2 filter mask, beside this file")
    info: FilterInfo | Name | None = Field(
        default=None, description="filter info of the mask, or the Nav2 parameter file beside this one that holds it"
    )
    speed: Speed | None = Field(default=None, description="speed limit, m/s")
    share: Annotated[float, Quantity(gt=0.0, le=1.0)] | None = Field(
        default=None, description="speed limit as a share of the robot's full speed"
    )
    direction: Angle | None = Field(default=None, description="direction of a one-way zone, radians")

    @model_validator(mode="after")
    def _fits_its_kind(self) -> ZoneFacts:
        given = {name for name in type(self).model_fields if name != "kind" and getattr(self, name) is not None}
        if len(given & _GROUNDS) != 1:
            raise ValueError("give one of 'place', 'polygon' and 'mask'")
        masked = "mask" in given
        if masked and self.kind not in _PLAIN_INFO:
            raise ValueError("a zone with a 'mask' is of kind 'keep_out' or 'speed_limit'")
        wanted = () if masked else _KEYS.get(self.kind, ())
        extra = given - _GROUNDS - ({"info"} if masked else set())
        if len(extra) != bool(wanted) or not extra <= {*wanted}:
            where, what = " with a mask" if masked else "", " or ".join(map(repr, wanted)) or "no other key"
            raise ValueError(f"a zone of kind '{self.kind}'{where} has {what} beside its ground")
        return self

    def zone(self, name: str, rooms: Mapping[str, Polygon]) -> Zone:
        """Zone as the skills' own data type; `rooms` are the outlines of the rooms by name."""
        corners = rooms[self.place] if self.place is not None else self.polygon or ()
        info = self.info if isinstance(self.info, FilterInfo) else _PLAIN_INFO.get(self.kind)
        mask = ZoneMask(self.mask, info.type, info.base, info.multiplier) if self.mask and info else None
        return Zone(name, self.kind, corners, mask, self.speed, self.share, self.direction or 0.0)


def _by_name(value: Any) -> Any:
    """Gives names to zones in a list, each written as kind and room: `keep_out: bathroom`. Raises ValueError."""
    if not isinstance(value, list):
        return value
    zones: dict[str, Any] = {}
    for each in value:
        kinds = [kind for kind in ZoneKind if isinstance(each, dict) and kind in each]
        if len(kinds) != 1 or not isinstance(each[kinds[0]], str):
            raise ValueError(f"a zone of a list is written as its kind with a room, as '{_EXAMPLE}'")
        (kind,) = kinds
        room = each[kind]
        name = room if room not in zones else f"{room}, {kind.replace('_', ' ')}"
        zones[name] = {"kind": kind, "place": room, **{key: more for key, more in each.items() if key != kind}}
    return zones


_EXAMPLE: Final = "keep_out: bathroom"
if TYPE_CHECKING:
    Zones = dict[str, ZoneFacts]
else:
    Zones = Annotated[
        dict[Name, ZoneFacts],
        BeforeValidator(_by_name, json_schema_input_type=dict[Name, ZoneFacts] | list[dict[str, str | float]]),
    ]
"""Zones by name in a mission."""
ZONES: Final = (
    "Zones that hold while the steps run, besides those of the world: by name as in knowledge, or a list of kinds with "
    f"rooms, as in `{_EXAMPLE}`."
)

_GROUNDS: Final = {"place", "polygon", "mask"}
_KEYS: Final = {ZoneKind.SPEED_LIMIT: ("speed", "share"), ZoneKind.ONE_WAY: ("direction",)}
"""Keys of which a zone has one, by its kind."""
_PLAIN_INFO: Final = {
    ZoneKind.KEEP_OUT: FilterInfo(type=FilterType.KEEP_OUT),
    ZoneKind.SPEED_LIMIT: FilterInfo(type=FilterType.SPEED_SHARE, base=100.0, multiplier=-1.0),
}
"""Filter info of a mask that has none, by the kind of its zone."""


def with_files(source: YamlSource, name: str, facts: ZoneFacts) -> ZoneFacts:
    """Finds the files that a zone names, beside its source, and reads its filter info. Raises InputError."""
    if facts.mask is None:
        return facts
    path: KeyPath = ("zones", name)
    mask = _file(source, (*path, "mask"), facts.mask)
    info = facts.info
    if isinstance(info, str):
        info = _filter_info(_file(source, (*path, "info"), info), facts.kind)
    if info is not None and (info.type is FilterType.KEEP_OUT) is not (facts.kind is ZoneKind.KEEP_OUT):
        what = f"a filter of type {info.type:d} is not of kind '{facts.kind}'"
        raise source.error((*path, "kind"), what, "type 0 is 'keep_out', types 1 and 2 are 'speed_limit'")
    return facts.model_copy(update={"mask": str(mask.absolute()), "info": info})


def _file(source: YamlSource, path: KeyPath, name: str) -> Path:
    """Path of the file that the value at `path` names. Raises InputError with the line when there is no such file."""
    try:
        found = file_beside(source.path, name)
    except InputError as error:
        raise source.error(path, error.message, error.hint) from error
    if not is_file(found):
        raise source.error(path, f"there is no file {name!r} beside {source.path.name}", "name a file that exists")
    return found


def _filter_info(path: Path, kind: ZoneKind) -> FilterInfo:
    """Reads the filter info for this kind of zone from a Nav2 parameter file. Raises InputError if it has none."""
    source = read_yaml(path)
    servers = source.data if isinstance(source.data, dict) else {}
    found = {
        (name, _ROS): {key: value for key, value in node[_ROS].items() if key in FilterInfo.model_fields}
        for name, node in servers.items()
        if isinstance(node, dict) and isinstance(node.get(_ROS), dict) and "type" in node[_ROS]
    }
    infos = [validate(FilterInfo, source.below(place, data)) for place, data in found.items()]
    fitting = [each for each in infos if (each.type is FilterType.KEEP_OUT) is (kind is ZoneKind.KEEP_OUT)]
    if len(fitting) != 1:
        what = f"{len(fitting)} costmap filter info servers in it are of kind '{kind}'"
        raise InputError(what, hint="write 'info: {type: .., base: .., multiplier: ..}' for the zone", file=path)
    return fitting[0]
