"""Zones of the map as skills know them: keep-out, preferred, speed limit, one way, silent."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from skills.quantities import Angle, Coordinate, Share, Speed


class ZoneKind(enum.StrEnum):
    """Kind of a zone."""

    KEEP_OUT = "keep_out"  # no part of the body enters
    PREFERRED = "preferred"  # paths lead through it where that is not much longer
    SPEED_LIMIT = "speed_limit"  # the base is no faster while a part of the body is in it
    ONE_WAY = "one_way"  # the base moves in its direction, or across, and never against it
    SILENT = "silent"  # the robot shows what it has to say, and does not speak


class FilterType(enum.IntEnum):
    """Type of a costmap filter of Nav2, by its number in `nav2_msgs/CostmapFilterInfo`."""

    KEEP_OUT = 0
    SPEED_SHARE = 1  # percent of the full speed
    SPEED = 2  # m/s


@dataclass(frozen=True)
class ZoneMask:
    """Filter mask of Nav2: the YAML file of its picture, and the values (type, base, multiplier) of its filter info.

    The limit in a cell is base + multiplier * value, where value is the cell's occupancy in percent; 0 is no limit.
    """

    file: str
    type: FilterType
    base: float
    multiplier: float


@dataclass(frozen=True)
class Zone:
    """Zone of the map: its kind, and its ground as corners (x, y) in the world frame (m) or as a filter mask.

    A speed limit is `speed_m_s`, or a `share` of the robot's full speed; a mask has its own. `direction_rad` is that of
    a one-way zone.
    """

    name: str
    kind: ZoneKind
    corners_W: tuple[tuple[Coordinate, Coordinate], ...] = ()
    mask: ZoneMask | None = None
    speed_m_s: Speed | None = None
    share: Share | None = None
    direction_rad: Angle = 0.0

    @property
    def words(self) -> str:
        """Rule of the zone in words, with its name: "keep out of: bathroom"."""
        speed = (
            f"{self.speed_m_s:g} m/s" if self.speed_m_s is not None else f"{100 * (self.share or 1):g} % of full speed"
        )
        return f"{_WORDS[self.kind].format(speed=speed if self.mask is None else 'the speed of its mask')}: {self.name}"


def zone_messages(zones: Iterable[Zone]) -> list[dict[str, Any]]:
    """Encodes the zones that have an outline: name, kind, rule in words, outlines (world frame, m), one-way direction.

    The outlines of a mask are those of its keep-out cells or of its limits. Raises InputError for an unreadable mask.
    """
    found = []
    for zone in zones:
        outlines: list[Any] = [zone.corners_W]
        if zone.mask is not None:
            from skills.estimate.grid_map import load_filter_mask

            least = 100 if zone.kind is ZoneKind.KEEP_OUT else 1
            outlines = [each.round(3).tolist() for each in load_filter_mask(Path(zone.mask.file)).outlines_W(least)]
        ahead = {"direction_rad": zone.direction_rad} if zone.kind is ZoneKind.ONE_WAY else {}
        message = {"name": zone.name, "kind": zone.kind.value, "rule": zone.words, "outlines": outlines, **ahead}
        found += [message] if outlines else []
    return found


_WORDS: Final = {
    ZoneKind.KEEP_OUT: "keep out of",
    ZoneKind.PREFERRED: "preferably through",
    ZoneKind.SPEED_LIMIT: "at most {speed} in",
    ZoneKind.ONE_WAY: "one way through",
    ZoneKind.SILENT: "silent in",
}


def zones_sentence(names: Sequence[str], what: str) -> str:
    """ "The bathroom is a keep-out zone." or "The hall and the lab are keep-out zones."."""
    *first, last = (f"the {name}" for name in names)
    said = f"{', '.join(first)} and {last} are {what}s" if first else f"{last} is a {what}"
    return f"{said[0].upper()}{said[1:]}."
